import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.scenes import water_jet as jet
from sph_gym.scenes.shared.reference import Run
from sph_gym.scenes.water_jet import REFERENCE, plate_pressure, water_jet
from tests.scenes.planted import planted


def test_the_ideal_pressure_carries_the_jet():
    x = np.linspace(-12.0, 12.0, 240001)
    p = plate_pressure(x)
    assert plate_pressure(np.array([0.0]))[0] == 1.0
    assert p.sum() * 1e-4 == pytest.approx(2.0, rel=1e-6)
    assert np.allclose(p, p[::-1], rtol=1e-9)
    assert np.all(np.diff(p[120000:]) <= 0)


def test_the_ideal_speed_is_that_of_the_map():
    q = np.linspace(0.0, 0.99, 50)
    x = 2 / np.pi * (np.arctan(q) + np.arctanh(q))
    assert np.allclose(plate_pressure(x), 1 - q**2, atol=1e-6)


def _planted(factor=1.0):
    scene = water_jet(dx=0.002, width=0.02, speed=5.0)
    n, walls = len(np.asarray(scene.x)), np.asarray(scene.walls.particles)
    p = factor * 12500.0 * plate_pressure(walls[:, 0] / 0.02)
    return planted(scene, np.asarray(scene.v), p=np.concatenate([np.zeros(n), p]))


def test_the_error_is_that_of_the_state():
    assert jet.error(_planted()) == pytest.approx(0.0, abs=1e-9)
    place = jet._face(_planted())[0]
    middle = plate_pressure(place[np.abs(place) < 2])
    expected = 100 * 0.1 * np.sqrt(np.mean(middle**2))
    assert jet.error(_planted(1.1)) == pytest.approx(expected)


def test_measures_of_an_ideal_run():
    sim, times = _planted(), np.linspace(0.0, 0.04, 101)
    seen = jet.observe(sim)
    seen |= {"film": 0.5}
    load = 1000.0 * 5.0**2 * 0.02
    moments = [seen | {"momentum": load * t} for t in times]
    run = Run(sim, times, moments)
    assert jet.force(run) == pytest.approx(1.0)
    measures = {measure.quantity: measure.value for measure in jet.judge(run)}
    # the pressure of the plate's middle is taken over a patch, and its ends carry nothing
    assert max(measures.values()) < 1.5


def test_who_is_behind_the_plate_is_counted():
    scene = water_jet(dx=0.002)
    x = np.array(scene.x)
    x[:3] = [(0.0, -0.003), (0.07, -0.1), (0.0, -0.001)]
    x[3] = (0.09, -0.1)
    assert jet.observe(planted(scene, np.asarray(scene.v), x=x))["passed"] == 2


@pytest.mark.parametrize(
    ("argument", "value"),
    [("dx", 0.0), ("width", 0.003), ("speed", -1.0), ("speed", np.nan), ("length", 0.1)],
)
def test_wrong_values_are_named(argument, value):
    with pytest.raises(ValueError, match=f"{argument}: expected"):
        water_jet(**{argument: value})


def test_a_coarse_run_pushes_as_hard_as_it_should():
    run = REFERENCE.run(Simulation(water_jet(dx=0.002), threads=1))
    measures = {measure.quantity: measure for measure in REFERENCE.judge(run)}
    assert all(measure.bound in (None, 0.0) for measure in measures.values())
    assert measures["RMS error of the mean pressure"].value < 8.0
    assert measures["force by momentum, error"].value < 3.0
    assert measures["force by pressure, error"].value < 8.0
    assert measures["most behind the plate"].value == 0
    assert len(REFERENCE.chart(run).curves) == 2
