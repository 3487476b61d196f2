import math
from typing import NamedTuple

import numpy as np
import pytest

from sph_gym.studies.accuracy import axes, fronts


class Run(NamedTuple):
    wall: float
    error: float
    good: bool = True


def worth(ladder, tried):
    start = ladder[0]
    return fronts.worth((start.error, tried.error), (start.wall, tried.wall), ladder, "wall")


def line(order, sizes=(10, 20, 40, 80)):
    """Runs whose error goes as dx^order and whose time as dx^-3; the nominal one first."""
    runs = [Run(1e-3 * n**3, n**-order) for n in sizes]
    return [runs[1], runs[0], *runs[2:]]


def test_the_front_is_what_nobody_beats():
    runs = [Run(1, 8), Run(2, 4), Run(2, 5), Run(3, 4.5), Run(4, 1), Run(0.5, 9, False)]
    assert fronts.front(runs, "wall") == [Run(1, 8), Run(2, 4), Run(4, 1)]


def test_the_cheapest_is_within_the_error():
    runs = [Run(1, 8), Run(2, 4), Run(1.5, 3.9), Run(1.2, 0.1, False)]
    assert fronts.cheapest(runs, 4, "wall") == Run(1.5, 3.9)
    assert fronts.cheapest(runs, 1, "wall") is None


@pytest.mark.parametrize("order", [0.5, 1, 2])
def test_a_power_law_has_its_order_and_elasticity(order):
    runs = line(order)
    dx = [1 / n for n in (20, 10, 40, 80)]
    assert fronts.order(dx, [run.error for run in runs]) == pytest.approx(order)
    assert fronts.elasticity(runs, "wall") == pytest.approx(-order / 3)


def test_no_elasticity_without_a_change_of_time():
    assert math.isnan(fronts.elasticity([Run(1, 2), Run(1.4, 5)], "wall"))
    assert math.isfinite(fronts.elasticity([Run(1, 2), Run(1.6, 5)], "wall"))
    assert math.isnan(fronts.elasticity([Run(1, 2), Run(9, 5, False)], "wall"))


@pytest.mark.parametrize("order", [1, 2])
def test_resolution_alone_buys_nothing(order):
    runs = line(order)
    assert [worth(runs, run).gain for run in runs] == pytest.approx([1.0] * 4)
    assert not any(worth(runs, run).bound for run in runs)


def test_worth_is_time_at_equal_error():
    runs = line(1.0)
    start = runs[0]
    assert worth(runs, start._replace(wall=start.wall / 3)) == (pytest.approx(3), "")
    assert worth(runs, start._replace(error=start.error / 2)) == (pytest.approx(8), "")
    assert worth(runs, start._replace(error=start.error / 3)) == (pytest.approx(27), "")


def test_beyond_the_measured_errors_there_is_only_a_bound():
    runs = line(1.0)
    start = runs[0]
    # not what a power law would have: 8000 and 1 / 27
    assert worth(runs, start._replace(error=start.error / 20)) == (pytest.approx(64), ">")
    assert worth(runs, start._replace(error=start.error * 3)) == (pytest.approx(1 / 8), "<")


def test_errors_within_the_scatter_of_a_flat_ladder_are_equal():
    ladder = [Run(8, 0.036), Run(1, 0.039), Run(64, 0.037)]
    assert fronts.flat(ladder, "wall")
    assert not fronts.flat(line(0.5), "wall")
    assert worth(ladder, Run(4, 0.001)) == (pytest.approx(2), "")
    assert worth(ladder, Run(4, 0.0389)) == (pytest.approx(2), "")
    assert worth(ladder, Run(4, 0.078)) == (pytest.approx(0.25), "<")


@pytest.mark.parametrize("ends", [(0.011, 0.9), (1.2, 2.9), (3e5, 2e9), (0.97, 1.6), (0.1, 9)])
def test_ticks_are_few_round_numbers_within(ends):
    found = axes.ticks(*ends)
    assert 3 <= len(found) <= 10
    assert all(ends[0] <= tick <= ends[1] for tick in found)
    assert np.all(np.diff(found) > 0)
