"""Gauges: points, faces and intervals, and the texts that name them."""

import numpy as np
import pytest

from sph_gym import Gauge
from tests import cases

MIDDLE, HALF = cases.WIDTH / 2, cases.WIDTH / 4


@pytest.fixture(scope="module")
def sim():
    return cases.simulation("everything", "lattice 3")


def test_a_point_reads_what_the_simulation_measures(sim):
    point = [[MIDDLE, HALF]]
    assert Gauge("pressure", point[0]).read(sim) == sim.pressure_at(point)
    assert np.array_equal(Gauge("velocity", point[0]).read(sim), sim.velocity_at(point)[0])
    assert Gauge("level", MIDDLE).read(sim) == sim.level_at(MIDDLE)
    for walls in ("particles", "right", np.arange(5)):
        assert np.array_equal(Gauge("force", walls).read(sim), sim.force_on(walls))


def test_a_face_is_a_mean_in_which_dry_parts_have_no_pressure(sim):
    x = cases.WIDTH
    low, high = HALF, HALF + 6 * cases.DX
    heights = low + (np.arange(12) + 0.5) * cases.DX / 2
    exact = sim.pressure_at(np.stack([np.full(12, x), heights], axis=-1)).mean()
    assert Gauge("pressure", (x, low, x, high)).read(sim)[0] == pytest.approx(exact)
    # twice as long, half of it in the air
    whole = Gauge("pressure", (x, 0.0, x, x)).read(sim)
    above = Gauge("pressure", (x, 0.0, x, 3 * x)).read(sim)
    assert above == pytest.approx(whole / 3, rel=0.05)
    dry = Gauge("pressure", (x, 3 * x, x, 4 * x))
    assert dry.read(sim).tolist() == [0.0]


def test_dry_parts_of_discs_and_velocities_do_not_count(sim):
    surface = (MIDDLE, cases.WIDTH, 2 * cases.DX)
    v = Gauge("velocity", surface).read(sim)
    assert np.isfinite(v).all()
    assert np.isnan(Gauge("velocity", (9.0, 9.0, 0.1)).read(sim)).all()
    assert Gauge("pressure", (9.0, 9.0, 0.1)).read(sim).tolist() == [0.0]
    assert Gauge("level", (0.0, 4 * cases.WIDTH)).read(sim)[0] == pytest.approx(
        cases.WIDTH, abs=0.1 * cases.DX
    )


@pytest.mark.parametrize(
    ("text", "quantity", "columns"),
    [
        ("pressure:1.2,0.1", "pressure", ["pressure:1.2 0.1 [Pa]"]),
        ("P1=pressure:3.2,0.1,3.2,0.2", "pressure", ["P1 [Pa]"]),
        ("velocity:1,2,0.5", "velocity", ["velocity:1 2 0.5 x [m/s]", "velocity:1 2 0.5 y [m/s]"]),
        ("level:0.5", "level", ["level:0.5 [m]"]),
        ("force:plate0", "force", ["force:plate0 x [N/m]", "force:plate0 y [N/m]"]),
    ],
)
def test_texts_name_gauges(text, quantity, columns):
    gauge = Gauge.parse(text)
    assert gauge.quantity == quantity
    assert gauge.columns == columns


@pytest.mark.parametrize(
    "text", ["", "pressure", "pressure:", ":1,2", "=level:1", "level:a", "pressure:1,,2"]
)
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError, match=r"(gauge|quantity): expected"):
        Gauge.parse(text)


@pytest.mark.parametrize(
    ("quantity", "at", "named"),
    [
        ("presure", (0, 0), "quantity"),
        ("pressure", 1.0, "at"),
        ("pressure", (0, 0, 0, 0, 0), "at"),
        ("pressure", (0, 0, -1), "radius"),
        ("velocity", (0, np.nan), "at"),
        ("velocity", None, "at"),
        ("level", (0, 1, 2), "at"),
        ("level", [1, [2]], "at"),
    ],
)
def test_other_places_are_refused(quantity, at, named):
    with pytest.raises(ValueError, match=f"{named}: expected"):
        Gauge(quantity, at)


@pytest.mark.parametrize("name", ["", "a/b", 3])
def test_other_names_are_refused(name):
    with pytest.raises(ValueError, match="name: expected"):
        Gauge("level", 0.1, name)
