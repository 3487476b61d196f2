"""Far from the origin: single precision counts positions from the middle of the scene."""

from dataclasses import replace

import numpy as np
import pytest

from sph_gym import CentralGravity, Effects, Motion, RollingTank, Scene, Simulation, Walls
from sph_gym.solver.origin import moved, origin
from tests.cases import DX, STILL, WATER, scene, square

AWAY = np.array([1e4, -2e4])


def patch(by, **changes):
    """A square that flies to the right and rings."""
    x = 0.98 * square() + by
    arguments = {"x": x, "v": np.tile((1.0, 0.0), (len(x), 1))} | changes
    return scene("open space", dtype="float64", **({"effects": STILL} | arguments))


@pytest.mark.without_jit
def test_nothing_is_displaced_where_the_precision_suffices():
    near, far = patch(np.zeros(2)), patch(AWAY)
    assert not origin(near, np.float32).any()
    assert not origin(far, np.float64).any()
    assert moved(near, np.zeros(2)) is near
    assert Simulation(near, "float32").x.tobytes() == near.x.astype(np.float32).tobytes()


def test_a_fluid_10_km_away_moves_as_one_at_home():
    home, away = (Simulation(patch(by), "float32") for by in (np.zeros(2), AWAY))
    for sim in (home, away):
        for _ in range(20):
            assert not sim.advance(sim.scene.frame).diverged
    here, there = home.diagnostics(), away.diagnostics()
    for name in ("com_x", "com_y", "front", "lowest"):
        shift = AWAY[0] if name in ("com_x", "front") else AWAY[1]
        assert there[name] - shift == pytest.approx(here[name], abs=1e-3 * DX), name
    for name in ("kinetic_energy", "internal_energy", "density_error", "extent_x"):
        assert there[name] == pytest.approx(here[name], rel=1e-3), name
    # a millimetre is all that single precision tells apart there
    gap = away.x.astype(float) - (home.x + AWAY)
    assert np.abs(gap).max() < 2e-3
    assert away.x.dtype == np.float32


def test_angular_momentum_and_potential_energy_are_those_of_the_users_origin():
    effects = replace(STILL, gravity=(0.0, -9.81))
    single, double = (Simulation(patch(AWAY, effects=effects), d) for d in ("float32", "float64"))
    for name in ("angular_momentum", "potential_energy", "com_x", "com_y"):
        one, other = single.diagnostics()[name], double.diagnostics()[name]
        assert one == pytest.approx(other, rel=1e-6), name


def test_a_snapshot_goes_on_to_the_last_bit():
    sim, twin = (Simulation(patch(AWAY), "float32") for _ in range(2))
    sim.advance(0.01)
    twin.restore(sim.snapshot())
    for each in (sim, twin):
        each.advance(0.01)
    assert sim.x.tobytes() == twin.x.tobytes()
    assert sim.diagnostics() == twin.diagnostics()


@pytest.mark.without_jit
def test_all_that_has_a_place_is_displaced():
    walls = Walls(
        particles=[(0.0, -0.1)],
        box=(-np.inf, np.inf, -0.5, 2.0),
        plates=[(0.0, 0.0, 1.0, 0.5)],
        period_x=(-1.0, 3.0),
        velocity=[(1.0, 0.0)],
        motion=Motion((0.0, 0.1)),
    )
    body = Scene("body", [(0.5, 1.0)], 0.1, 0.25, WATER, walls=walls)
    other = moved(body, np.array([10.0, 20.0]))
    assert other.x.tolist() == [[10.5, 21.0]]
    assert other.walls.particles.tolist() == [[10.0, 19.9]]
    assert other.walls.box == (-np.inf, np.inf, 19.5, 22.0)
    assert other.walls.plates.tolist() == [[10.0, 20.0, 11.0, 20.5]]
    assert other.walls.period_x == (9.0, 13.0)
    assert other.walls.period_y is None
    for field in (CentralGravity(2.0, 0.1, 0.2), RollingTank(9.81, 0.1, 1.0, (0.1, 0.2))):
        turned = replace(body, effects=Effects(gravity=field))
        there = moved(turned, np.array([10.0, 20.0])).effects.field
        place = there.pivot if isinstance(field, RollingTank) else (there.x, there.y)
        assert place == pytest.approx((10.1, 20.2))


def test_strays_do_not_take_the_origin_along():
    home = square()
    strays = np.concatenate([home, [(1e18, 0.0), (1e18, 1e18)]])
    assert not origin(patch(np.zeros(2), x=strays, v=np.zeros_like(strays)), np.float64).any()


@pytest.mark.parametrize("x", [10.0, 160.0])
def test_a_slow_particle_arrives_in_single_precision(x):
    # in a thousand steps of some 1e-5 m, which single precision can't tell apart at x
    start, v = [(x, 0.0)], [(3e-3, 0.0)]
    sim = Simulation(scene("none", x=start, v=v, duration=1.0), "float32")
    sim.controls = sim.controls._replace(dt=1e-3)
    assert not sim.advance(1.0).diverged
    assert sim._local_x[0, 0] - (x - sim._origin[0]) == pytest.approx(3e-3, rel=0.01)
