from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.scenes.hydrostatic_tank import (
    REFERENCE,
    bottom_pressure_error,
    depth_of,
    error,
    hydrostatic,
    hydrostatic_tank,
    profile,
)
from sph_gym.solver.gravity import Gravity


def compressed():
    """The tank as it will be at rest: every layer squeezed by the weight above it, walls too."""
    scene = hydrostatic_tank(dx=0.02)
    depth = depth_of(scene)

    def squeeze(places):
        x, y = np.array(places).T
        return np.stack([x, y - 9.81 / scene.fluid.c0**2 * y * (depth - y / 2)], axis=-1)

    effects = replace(scene.effects, gravity=Gravity(0.0, -9.81))
    walls = replace(scene.walls, particles=squeeze(scene.walls.particles))
    return Simulation(replace(scene, x=squeeze(scene.x), effects=effects, walls=walls), threads=1)


@pytest.mark.parametrize("name", ["dx", "width", "depth", "gravity"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, "deep"])
def test_wrong_arguments_are_named(name, value):
    with pytest.raises(ValueError, match=f"{name}: expected"):
        hydrostatic_tank(**{name: value})


@pytest.mark.parametrize(("name", "value"), [("ramp", -1.0), ("seconds", 0.0)])
def test_wrong_times_are_named(name, value):
    with pytest.raises(ValueError, match=f"{name}: expected"):
        hydrostatic_tank(**{name: value})


def test_an_episode_is_short_and_the_reference_is_long():
    assert hydrostatic_tank().duration == 6.0
    assert {arguments["seconds"] for arguments in REFERENCE.resolutions} == {20.0}
    scene = hydrostatic_tank(dx=0.05, seconds=20.0)
    assert scene.duration == 20.0


def test_without_gravity_there_is_no_error():
    sim = Simulation(hydrostatic_tank(dx=0.05), threads=1)
    assert error(sim) == 0.0


def test_gravity_at_once_finds_no_pressure():
    # nothing is compressed yet: the lowest of five bins of two rows lacks 0.9 of rho0 g H
    sim = Simulation(hydrostatic_tank(dx=0.05, ramp=0.0), threads=1)
    assert np.isclose(error(sim), 90.0, atol=0.1)


def test_a_compressed_tank_has_the_right_pressure():
    sim = compressed()
    heights, pressures = profile(sim)
    assert len(heights) == 10
    # away from the surface, where kernels lack neighbours
    expected = hydrostatic(sim, heights)
    assert np.allclose(pressures[:-1], expected[:-1], atol=0.01 * 9810 * 0.5)
    assert error(sim) < 6.0
    assert abs(bottom_pressure_error(sim)) < 0.01


def test_the_error_sees_a_pressure_that_is_wrong():
    sim = compressed()
    right = bottom_pressure_error(sim)
    c = sim.controls
    sim.controls = c._replace(stiffness=1.2 * c.stiffness)
    assert np.isclose(bottom_pressure_error(sim), 1.2 * (1 + right) - 1)
    assert error(sim) > 10.0


def test_the_profile_is_that_of_whole_rows():
    sim = Simulation(hydrostatic_tank(dx=0.02), threads=1)
    heights, _ = profile(sim)
    rows = np.unique(np.round(np.array(sim.scene.x)[:, 1], 9))
    assert len(rows) == 25
    assert len(heights) == 10
    # means of two or three rows each, evenly weighted
    assert np.isclose(np.average(heights, weights=[2, 3, 3, 2, 2, 3, 3, 3, 2, 2]), 0.25, atol=0.01)


def test_a_short_coarse_run_comes_to_rest():
    run = REFERENCE.run(Simulation(hydrostatic_tank(dx=0.05, seconds=4.0), threads=1))
    found = {measure.quantity: measure for measure in REFERENCE.judge(run)}
    assert found["pressure profile, largest error"].value < 4.0
    assert found["pressure profile, largest error"].bound is None
    assert found["kinetic energy"].value < 1e-5
    assert len(REFERENCE.chart(run).curves) == 2
