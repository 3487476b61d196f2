"""Means of forces along a side: lines are found right up to the ends of what is wet."""

import numpy as np
import pytest

from sph_gym.solver import sampling
from sph_gym.solver.loads import Load, stretches

DX, H = 0.02, 0.052
START, SLOPE = 100.0, -40.0
pytestmark = pytest.mark.without_jit


def load(x, low=-np.inf, high=np.inf, period=None, slope=SLOPE):
    """Return the load by particles at x (n,) [m] with a pressure that is a line."""
    force = (START + slope * x) * DX
    begins, ends = stretches(x, DX, 2.5)
    return Load(0.0, x, force, np.full(len(x), slope), begins, ends, low, high, period, DX, H)


def test_a_line_is_found_up_to_its_ends(monkeypatch):
    x = (np.arange(20) + 0.5) * DX
    places = np.linspace(0.0, 20 * DX, 41)
    found = load(x).pressure(places)
    line = START + SLOPE * places
    assert found == pytest.approx(line, rel=1e-3)
    monkeypatch.setattr(sampling, "CHUNK", 3 * len(x))
    assert load(x).pressure(places) == pytest.approx(found, rel=1e-14)
    assert load(x).pressure(np.zeros(0)).shape == (0,)


def test_rows_that_alternate_are_averaged():
    x = (np.arange(20) + 0.5) * DX
    even = load(x)
    uneven = even._replace(force=even.force * (1 + 0.1 * (-1.0) ** np.arange(20)))
    places = np.linspace(0.0, 20 * DX, 41)
    inner = (places > H) & (places < 20 * DX - H)
    off = np.abs(uneven.pressure(places) / even.pressure(places) - 1)
    assert off[inner].max() < 0.006
    assert off.max() < 0.04


def test_what_is_beyond_an_end_counts_before_it():
    x = np.array([0.2, 1.5, 2.5, 3.5, 4.5]) * DX
    cut = load(x, low=0.0, slope=0.0)._replace(begins=np.zeros(1))
    total = np.trapezoid(cut.pressure(places := np.linspace(0.0, 5 * DX, 501)), places)
    assert total == pytest.approx(cut.force.sum(), rel=0.02)


def test_it_is_dry_where_nothing_is_near():
    one = load(np.array([0.0]), slope=0.0)
    places = np.array([0.0, 1.2, -1.2, 1.3, -1.3, 9.0]) * DX
    assert one.pressure(places) == pytest.approx([START] * 3 + [0.0] * 3)
    nothing = load(np.zeros(0))
    assert nothing.pressure(np.array([0.0, 1.0])).tolist() == [0.0, 0.0]


def test_a_side_may_close_upon_itself():
    x = (np.arange(10) + 0.5) * DX
    length = 10 * DX
    around = np.concatenate([x - length, x, x + length])
    closed = load(around, period=(0.0, length), slope=0.0)
    places = np.array([0.0, 0.3, 0.9, 1.0, -2.1, 7.4]) * length
    assert closed.pressure(places) == pytest.approx(START, rel=1e-12)


def test_gaps_end_a_stretch():
    begins, ends = stretches(np.array([0.1, 0.5, 0.14]), DX, 2.5)
    assert begins == pytest.approx([0.09, 0.49])
    assert ends == pytest.approx([0.15, 0.51])
    assert [len(part) for part in stretches(np.zeros(0), DX, 2.5)] == [0, 0]
