from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sph_gym import Simulation, Walls, disc
from sph_gym.scenes.couette import couette
from sph_gym.scenes.hydrostatic_tank import hydrostatic_tank
from sph_gym.scenes.lid_driven_cavity import lid_driven_cavity
from sph_gym.solver import pressures, sampling
from sph_gym.solver.sampling import interpolate
from tests.scenes.planted import planted


def test_a_linear_flow_is_found_between_the_particles(monkeypatch):
    scene = lid_driven_cavity(dx=0.05)
    x = np.asarray(scene.x)
    sim = planted(scene, np.stack([2 * x[:, 1], 1 - x[:, 0]], axis=-1))
    points = np.random.default_rng(0).uniform(0.25, 0.75, (20, 2))
    found = interpolate(sim, points)
    exact = np.stack([2 * points[:, 1], 1 - points[:, 0]], axis=-1)
    assert np.allclose(found, exact, atol=2e-3)
    monkeypatch.setattr(sampling, "CHUNK", 3 * sim.n_particles)
    assert np.allclose(interpolate(sim, points), found, rtol=1e-14)


def test_walls_take_part_if_they_are_asked_to():
    scene = lid_driven_cavity(dx=0.05)
    sim = planted(scene, np.zeros_like(np.asarray(scene.x)))
    at_lid = [[0.5, 1.0]]
    assert interpolate(sim, at_lid)[0, 0] == pytest.approx(0.5)
    assert np.array_equal(interpolate(sim, at_lid, walls=False), [[0.0, 0.0]])


def test_weights_reach_through_periodic_ends():
    scene = couette(dx=0.1)
    x = np.asarray(scene.x)
    sim = planted(scene, np.stack([np.where(x[:, 0] < 0.3, 1.0, 0.0), 0 * x[:, 0]], axis=-1))
    (far,) = interpolate(sim, [[1.6, 0.5]], walls=False)
    assert far[0] == pytest.approx(0.5)


def test_nobody_near_is_not_a_number():
    scene = lid_driven_cavity(dx=0.1)
    sim = planted(scene, np.ones_like(np.asarray(scene.x)))
    assert np.isnan(interpolate(sim, [[9.0, 9.0]])).all()
    with pytest.raises(ValueError, match="points: expected"):
        interpolate(sim, [1.0, 2.0])


# --- Pressure, velocity, level --------------------------------------------------------------


def resting(seconds=2.5):
    """Water at rest in the tank, after a ramp."""
    sim = Simulation(hydrostatic_tank(dx=0.05, ramp=1.0), threads=1)
    sim.advance(seconds)
    return sim


def test_at_rest_pressure_level_and_forces_are_hydrostatic():
    sim = resting()
    weight = sim.mass * sim.n_fluid * 9.81
    at_floor = 1000 * 9.81 * 0.5
    p = sim.pressure_at([[0.25, 0.0], [0.1, 0.0], [0.0, 0.25], [0.25, 0.25]])
    assert np.allclose(p / at_floor, [1.0, 1.0, 0.5, 0.5], atol=0.01)
    assert sim.pressure_at([[0.25, 0.6], [9.0, 9.0]]).tolist() == [0.0, 0.0]
    assert np.allclose(sim.level_at([0.1, 0.25, 0.4]), 0.5, atol=0.05 * 0.05)
    assert isinstance(sim.level_at(0.2), float)
    assert np.isnan(sim.level_at([-1.0, 0.7])).all()
    assert np.allclose(sim.force_on("particles") / weight, [0.0, -1.0], atol=0.002)
    assert np.allclose(sim.force_on("bottom") / weight, [0.0, -1.0], atol=0.01)
    # half rho g H^2 on each side, here half of the weight
    assert np.allclose(sim.force_on("right") / weight, [0.5, 0.0], atol=0.01)
    total = sum(sim.force_on(side) for side in ("left", "right", "bottom"))
    assert np.allclose(total, sim.force_on("particles"), rtol=0, atol=1e-10 * weight)


def linear(scene, slope=(-3.0, -7.0), start=50.0):
    """A planted simulation whose pressures are a plane, and velocities another."""
    x = np.asarray(scene.x)
    p = np.concatenate([start + x @ slope, np.zeros(len(np.asarray(scene.walls.particles)))])
    sim = planted(scene, np.stack([2 * x[:, 1], 1 - x[:, 0]], axis=-1), p=p)
    sim._local_x, sim._origin = sim.x, np.zeros(2)
    sim.engine = SimpleNamespace(model=SimpleNamespace(mirrors=None))
    return sim


def test_planes_are_found_right_up_to_the_walls():
    scene = lid_driven_cavity(dx=0.05)
    sim = linear(scene)
    points = np.array([[0.0, 0.0], [1.0, 0.3], [0.52, 0.0], [0.333, 0.777]])
    exact = 50.0 + points @ (-3.0, -7.0)
    assert np.allclose(pressures.pressure_at(sim, points), exact, atol=0.01)
    v = np.stack([2 * points[:, 1], 1 - points[:, 0]], axis=-1)
    assert np.allclose(sampling.velocity_at(sim, points), v, atol=0.01)
    assert np.isnan(sampling.velocity_at(sim, [[1.2, 0.5]])).all()


def test_few_particles_make_no_slope():
    scene = lid_driven_cavity(dx=0.05)
    sim = linear(scene)
    # one particle, then a row of them: nothing is known of the slope across
    for count in (1, 5):
        sim._local_x = np.stack([0.3 + 0.05 * np.arange(count), np.full(count, 0.2)], axis=-1)
        sim.n_fluid, sim.p = count, 7.0 + np.arange(count)
        (p,) = pressures.pressure_at(sim, [[0.3, 0.22]])
        assert p == pytest.approx(7.0, abs=0.05)


def test_a_fluid_with_a_clamp_has_no_tension():
    scene = lid_driven_cavity(dx=0.05)
    free = replace(scene, fluid=replace(scene.fluid, clamp=False))
    for kind, least in ((free, -7.0), (replace(free, fluid=replace(free.fluid, clamp=True)), 0.0)):
        sim = linear(kind, (0.0, 0.0), -7.0)
        assert pressures.pressure_at(sim, [[0.5, 0.5]])[0] == pytest.approx(least)


def test_the_level_ignores_what_flies_and_knows_walls_and_obstacles():
    scene = hydrostatic_tank(dx=0.05)
    sim = planted(scene, np.zeros_like(np.asarray(scene.x)))
    sim._origin, sim.engine = np.zeros(2), SimpleNamespace(model=SimpleNamespace(stroke=None))
    drop = disc(0.25, 0.9, 0.1, 0.05)
    x = np.asarray(scene.x)
    # a puddle of two rows beside the deep water
    x = np.concatenate([x[(x[:, 0] < 0.25) | (x[:, 1] < 0.1)], drop])
    sim.n_fluid, sim._local_x = len(x), np.concatenate([x, np.asarray(scene.walls.particles)])
    assert np.allclose(sampling.level_at(sim, [0.0, 0.1, 0.48]), [0.5, 0.5, 0.1], atol=0.005)
    # where there is no other water, the drop has the level
    sim.n_fluid, sim._local_x = len(drop), np.concatenate([drop, sim._local_x[len(x) :]])
    assert sampling.level_at(sim, 0.25) == pytest.approx(1.0, abs=0.02)
    assert np.isnan(sampling.level_at(sim, 0.02))


def test_the_level_is_right_up_to_plates_around_the_water():
    plates = [(0.0, -0.1, 0.0, 2.0), (-0.1, 0.0, 0.6, 0.0), (0.5, -0.1, 0.5, 2.0)]
    scene = replace(hydrostatic_tank(dx=0.05), walls=Walls(plates=plates))
    sim = planted(scene, np.zeros_like(np.asarray(scene.x)))
    sim._origin, sim.engine = np.zeros(2), SimpleNamespace(model=SimpleNamespace(stroke=None))
    sim._local_x = np.asarray(scene.x)
    assert np.allclose(sampling.level_at(sim, [0.0, 0.02, 0.25, 0.5]), 0.5, atol=0.005)


@pytest.mark.parametrize("points", [[1.0, 2.0], [[1.0]], [[np.nan, 0.0]], "x", None, [[1], [1, 2]]])
def test_points_are_checked(points):
    sim = linear(lid_driven_cavity(dx=0.1))
    for measure in (pressures.pressure_at, sampling.velocity_at):
        with pytest.raises(ValueError, match="points: expected"):
            measure(sim, points)


@pytest.mark.parametrize("x", [[[1.0]], np.nan, "left", None, [1, [2]]])
def test_columns_are_checked(x):
    with pytest.raises(ValueError, match="x: expected"):
        sampling.level_at(linear(lid_driven_cavity(dx=0.1)), x)
