"""Forces on walls: they are what the solver applies, and add up."""

from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.solver import contact
from tests import cases

# like fluid, and extrapolated on walls that move; both without slip and with all pair forces
WALLED = ["everything", "all, euler"]


@pytest.mark.parametrize(("configuration", "cloud"), [(c, "jittered") for c in WALLED])
@pytest.mark.without_jit
def test_momentum_balances_to_rounding(configuration, cloud):
    sim = cases.simulation(configuration, cloud)
    gravity = sim.scene.effects.field.on(sim.time, cases.fluid(sim, "x"), cases.fluid(sim, "v"))
    gained = sim.mass * (cases.fluid(sim, "a") - gravity).sum(axis=0)
    force = sim.force_on("particles")
    scale = sim.mass * np.abs(cases.fluid(sim, "a")).sum()
    assert np.abs(force).max() > 1e-3 * scale
    assert np.allclose(-gained, force, rtol=0, atol=1e-12 * scale)


def test_parts_add_up_and_a_query_changes_nothing():
    sim = cases.simulation("everything", "disordered")
    before = sim.snapshot()
    n = sim.n_particles - sim.n_fluid
    mask = np.arange(n) % 3 == 0
    parts = sim.force_on(mask), sim.force_on(np.flatnonzero(~mask))
    scale = np.abs(sim.force_on("particles")).max()
    assert np.allclose(sum(parts), sim.force_on("particles"), rtol=0, atol=1e-12 * scale)
    by_side = sum(sim.force_on(side) for side in ("left", "right", "bottom"))
    assert np.allclose(by_side, sim.force_on("particles"), rtol=0, atol=1e-12 * scale)
    assert sim.force_on(np.array([], int)).tolist() == [0.0, 0.0]
    after = sim.snapshot()
    assert after["time"] == before["time"]
    for name, column in before["fluid"].items():
        assert np.array_equal(column, after["fluid"][name])


def test_a_side_without_particles_takes_the_pressure_along_it():
    sim = cases.simulation("everything", "lattice 3", speed=0.0)
    y = cases.fluid(sim, "x")[:, 1]
    # as if there were no boundary particles
    bare = Held(sim, 100.0 - 100.0 * y / cases.WIDTH, sim._local_x[: sim.n_fluid])
    assert np.allclose(contact.force_on(bare, "bottom"), [0.0, -100.0 * cases.WIDTH], rtol=0.01)
    assert np.allclose(contact.force_on(bare, "right"), [50.0 * cases.WIDTH, 0.0], rtol=0.01)


def test_a_plate_feels_the_difference_of_its_faces():
    # deep water on the left of a thin plate without particles, none on the right
    sim = cases.simulation("plates", "lattice 3", speed=0.0)
    x = cases.fluid(sim, "x")
    middle = cases.WIDTH / 2
    plate = np.array([middle, 0.0, middle, cases.WIDTH])
    pressures = np.where(x[:, 0] < middle, 100.0, 40.0)
    held = Held(sim, pressures, sim._local_x)
    force = contact._of_plate(held, plate)
    assert np.allclose(force, [60.0 * cases.WIDTH, 0.0], rtol=0.02)
    turned = contact._of_plate(held, plate[[2, 3, 0, 1]])
    assert np.allclose(force, turned)
    longer = contact._of_plate(held, np.array([middle, -1.0, middle, 1.0 + cases.WIDTH]))
    assert np.allclose(longer, force, rtol=0.02)
    assert sim.force_on("plate0").shape == (2,)


class Held:
    """A simulation with other pressures and places."""

    def __init__(self, sim, p, x):
        self._sim, self.p, self._local_x = sim, p, x

    def __getattr__(self, name):
        return getattr(self._sim, name)


@pytest.mark.parametrize(
    "walls", ["lid", "top", "plate0", [0.5], [[1]], [-1], [10**6], [True], None, 3, [1, [2]], {}]
)
def test_other_walls_are_refused(walls):
    with pytest.raises(ValueError, match="walls: expected"):
        cases.simulation("everything").force_on(walls)


def test_a_scene_without_walls_has_no_force():
    sim = cases.simulation("open space")
    for walls in ("particles", "bottom", [0]):
        with pytest.raises(ValueError, match="walls: expected"):
            sim.force_on(walls)


def test_far_from_the_origin_and_in_single_precision():
    scene = cases.scene("everything", "jittered", dtype="float32")
    expected = {side: Simulation(scene).force_on(side) for side in ("left", "bottom")}
    away = np.array([3e4, -2e4])
    walls = replace(
        scene.walls,
        particles=np.asarray(scene.walls.particles) + away,
        box=tuple(np.array(scene.walls.box) + np.repeat(away, 2)),
    )
    far = Simulation(replace(scene, x=np.asarray(scene.x) + away, walls=walls), "float32")
    for side, force in expected.items():
        assert np.allclose(far.force_on(side), force, rtol=0, atol=1e-3 * np.abs(force).max())
