import math
from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Simulation, Walls, lattice, scenes, tank_particles
from tests.cases import BOX, DX, STILL, WIDTH, fluid, scene, simulation, uncompiled


def behind(box):
    """One boundary particle behind each side, which then isn't a mirror."""
    x_min, x_max, y_min, y_max = np.nan_to_num(box, posinf=99.0, neginf=-99.0)
    x, y = x_min + 0.9 * (x_max - x_min), y_min + 0.9 * (y_max - y_min)
    gap = DX / 2
    return [(x_min - gap, y), (x_max + gap, y), (x, y_min - gap), (x, y_max + gap)]


def boxed(x, v, box, restitution=0.5, **more):
    """A lonely particle in a box."""
    walls = Walls(behind(box), box=box, restitution=restitution)
    return simulation("everything", x=[x], v=[v], walls=walls, effects=STILL, **more)


def bounce(x, v, restitution):
    """A lonely particle in a unit box after one step of 0.01 s."""
    controls = scene().controls._replace(dt=0.01)
    sim = boxed(x, v, (0.0, 1.0, 0.0, 1.0), restitution, controls=controls)
    sim.advance(0.01)
    return sim.x[0], sim.v[0]


@pytest.mark.without_jit
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize(("axis", "side"), [(0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0)])
def test_a_particle_bounces_off_a_side(axis, side, restitution):
    x, v = np.full(2, 0.5), np.array([0.25, 0.25])
    x[axis], v[axis] = abs(side - 0.01), 4.0 if side else -4.0
    after_x, after_v = bounce(x, v, restitution)
    assert after_x[axis] == side
    assert after_v[axis] == -restitution * v[axis]
    other = 1 - axis
    assert after_x[other] == pytest.approx(0.5 + 0.01 * 0.25)
    assert after_v[other] == 0.25


def test_a_corner_turns_both_components_round():
    x, v = bounce((0.01, 0.99), (-4.0, 8.0), 0.5)
    assert x.tolist() == [0.0, 1.0]
    assert v.tolist() == [2.0, -4.0]


def test_a_particle_that_comes_back_by_itself_keeps_its_velocity():
    sim = boxed((0.5, 0.5), (3.0, 0.0), (0.0, 1.0, 0.0, 1.0))
    outside = sim.snapshot()
    outside["fluid"]["x"][:] = -0.5
    sim.restore(outside)
    sim.advance(sim.controls.dt)
    assert sim.x[0, 0] == 0.0
    assert sim.v[0, 0] == 3.0


@pytest.mark.slow
def test_an_infinite_side_is_open():
    sim = boxed((0.0, 1.0), (-50.0, 70.0), (-math.inf, math.inf, 0.0, math.inf))
    dt = sim.controls.dt
    sim.advance(5 * dt)
    assert sim.x[0] == pytest.approx([-250 * dt, 1.0 + 350 * dt])


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_nothing_leaves_the_box(dtype):
    box = (0.0, WIDTH, 0.0, WIDTH)
    walls = Walls(behind(box), box=box, restitution=0.5)
    sim = simulation("everything", dtype=dtype, speed=20.0, walls=walls)
    sides = np.array(box, dtype)
    touched = np.zeros(4, bool)
    for _ in range(40):
        sim.advance(sim.controls.dt)
        x = sim.x[: sim.n_fluid]
        assert (sides[0] <= x[:, 0]).all()
        assert (x[:, 0] <= sides[1]).all()
        assert (sides[2] <= x[:, 1]).all()
        assert (x[:, 1] <= sides[3]).all()
        touched |= (x[:, [0, 0, 1, 1]] == sides).any(axis=0)
    assert touched.all()


# --- Boundary particles ---------------------------------------------------------------------


def test_boundary_particles_stay_where_they_are():
    sim = simulation("everything")
    walls = np.asarray(sim.scene.walls.particles)
    sim.advance(10 * sim.controls.dt)
    assert (sim.x[sim.n_fluid :] == walls).all()
    assert not sim.v[sim.n_fluid :].any()
    assert not sim.a[sim.n_fluid :].any()


def test_boundary_particles_push_before_a_particle_arrives():
    x = np.asarray(scene(cloud="lattice 3").x) - (0.0, 0.3 * DX)
    sim = simulation("everything", "lattice 3", effects=STILL, x=x, v=None)
    lowest = x[:, 1] == x[:, 1].min()
    assert fluid(sim, "a")[lowest, 1].min() > 9.81


def test_a_lattice_in_step_with_its_tank_feels_nothing():
    sim = simulation("everything", "lattice 3", effects=STILL, v=None)
    x = fluid(sim, "x")
    reached = (x[:, 1] < WIDTH - 3.1 * DX) & (fluid(sim, "rho") > 0)
    assert reached.sum() > 80
    assert fluid(sim, "rho")[reached] == pytest.approx(1000.0, rel=1e-12)
    below = x[:, 1] < WIDTH - 6.1 * DX
    assert np.abs(fluid(sim, "a")[below]).max() < 1e-6


def test_a_short_dam_break_does_not_leak():
    dam = scenes.make("dam_break", dx=0.05)
    box = dam.walls.box
    leaky = replace(dam, walls=Walls(particles=dam.walls.particles))
    sim = Simulation(leaky)
    assert not sim.advance(0.6).diverged
    x = fluid(sim, "x")
    assert x[:, 0].max() > 2.0  # it has run along the floor
    assert x[:, 0].min() > box[0] - 0.5 * dam.dx
    assert x[:, 0].max() < box[1] + 0.5 * dam.dx
    assert x[:, 1].min() > box[2] - 0.5 * dam.dx


# --- Boundary particles and nothing behind them ----------------------------------------------


def stray(mach, dx=0.05, guard=None, start=(0.02, 0.1), direction=(0.0, -1.0), **kwargs):
    """Two particles, one of them on its way, to the floor by default, with c0 = 10 m/s."""
    floor = lattice(-0.5, 0.5, -3 * dx, 0.0, dx)
    x, v = [(-0.3, 1.0), start], [(0.0, 0.0), 10.0 * mach * np.array(direction)]
    walls = Walls(floor, **(guard or {}))
    return simulation("none", x=x, v=v, dx=dx, h=2.6 * dx, walls=walls, frame=0.05, **kwargs)


@pytest.mark.without_jit
@pytest.mark.parametrize("neighbors", ["grid", "brute"])
@pytest.mark.parametrize("mach", [0.9, 4.0, 30.0])
def test_who_gets_into_a_wall_is_reported_at_the_end_of_that_step(mach, neighbors):
    sim = stray(mach, neighbors=neighbors)
    report = sim.advance(0.05)
    assert (report.diverged, report.cause, report.link) == (True, "tunnelling", "walls")
    assert report.bad_particle == 1
    assert sim.time == pytest.approx(report.n_substeps * report.dt)
    assert np.isfinite(sim.x).all()
    # who is in stays in; who has jumped right through goes on in shorter steps
    inside = -0.15 < sim.x[1, 1] < 0.0
    assert inside == (mach < 30)
    assert sim.advance(1e-5).diverged == inside


@uncompiled
@pytest.mark.parametrize("integrator", ["kick_drift_kick", "predictor_corrector"])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_every_integrator_tells_who_gets_into_a_wall(integrator, dtype):
    sim = stray(0.9, integrator=integrator, dtype=dtype)
    report = sim.advance(0.05)
    assert (report.cause, report.link, report.bad_particle) == ("tunnelling", "walls", 1)
    assert sim.time == pytest.approx(report.n_substeps * report.dt)


@uncompiled
@pytest.mark.parametrize(
    "guard", [{"box": (-9.0, 9.0, 0.0, 9.0)}, {"plates": [(-0.5, 0.0, 0.5, 0.0)]}]
)
@pytest.mark.parametrize("mach", [0.9, 4.0])
def test_nobody_gets_into_a_wall_with_a_guard_at_its_face(mach, guard):
    sim = stray(mach, guard=guard)
    assert not sim.advance(0.05).diverged
    assert sim.x[1, 1] >= 0


@uncompiled
@pytest.mark.parametrize("mach", [0.9, 4.0, 30.0])
def test_nobody_gets_into_an_obstacle_within_a_box_unnoticed(mach):
    sim = stray(mach, guard={"box": (-9.0, 9.0, -1.0, 9.0)})
    report = sim.advance(0.05)
    assert (report.cause, report.link, report.bad_particle) == ("tunnelling", "walls", 1)


@pytest.mark.parametrize("mach", [4.0, 30.0])
@pytest.mark.parametrize(
    ("start", "direction"),
    [((0.02, 3.0), (0.0, 1.0)), ((0.02, 0.1), (0.0, 1.0)), ((-0.4, 0.2), (1.0, 0.0))],
    ids=["far away", "away from it", "along it"],
)
def test_strays_may_be_as_fast_as_they_like_where_no_wall_is_in_their_way(mach, start, direction):
    sim = stray(mach, start=start, direction=direction)
    assert not sim.advance(0.02).diverged
    assert fluid(sim, "v")[1] == pytest.approx(10.0 * mach * np.array(direction), abs=5.0)


@uncompiled
@pytest.mark.parametrize("mach", [4.0, 30.0])
def test_nobody_leaps_through_a_wall_at_the_end_of_a_periodic_domain_unnoticed(mach):
    sim = stray(mach, start=(0.0, 0.1), direction=(0.6, -0.8), guard={"period_x": (-0.5, 0.5)})
    report = sim.advance(0.05)
    assert (report.cause, report.link, report.bad_particle) == ("tunnelling", "walls", 1)


@pytest.mark.without_jit
def test_walls_are_unbacked_where_neither_plates_nor_the_box_are_before_them():
    dx, h, box = 0.05, 0.13, (0.0, 1.0, 0.0, np.inf)
    tank = tank_particles(1.0, 0.5, dx)
    obstacle = np.concatenate([tank, lattice(0.4, 0.6, 0.0, 0.2, dx)])
    elsewhere = [(0.3, 0.4, 0.7, 0.4)]
    around = [(0.4, 0.0, 0.4, 0.2), (0.4, 0.2, 0.6, 0.2), (0.6, 0.2, 0.6, 0.0)]
    assert Walls(tank).unbacked(dx, h).any()
    assert not Walls(tank, box=box).unbacked(dx, h).any()
    assert Walls(obstacle, box=box).unbacked(dx, h).any()
    assert Walls(obstacle, box=box, plates=elsewhere).unbacked(dx, h).any()
    assert not Walls(obstacle, box=box, plates=around).unbacked(dx, h).any()
    assert not Walls(box=box).unbacked(dx, h).any()


def test_a_hole_of_one_particle_is_no_wall():
    dx = 0.05
    around = lattice(-0.2, 0.25, -0.2, 0.25, dx)
    hole = np.hypot(*(around - 0.025).T) > 0.5 * dx
    walls = Walls(around[hole])
    sim = simulation("none", x=[(0.025, 0.025)], v=[(0.0, 0.0)], dx=dx, h=2.6 * dx, walls=walls)
    assert hole.sum() == 80
    assert not sim.advance(0.05).diverged


@pytest.mark.without_jit
def test_lattice_is_centred_on_its_cells():
    x = lattice(1.0, 1.0 + 3 * DX, -2.0, -2.0 + 2 * DX, DX)
    assert len(x) == 6
    assert x.min(axis=0) == pytest.approx([1.0 + DX / 2, -2.0 + DX / 2])
    assert x.max(axis=0) == pytest.approx([1.0 + 2.5 * DX, -2.0 + 1.5 * DX])


@pytest.mark.without_jit
@pytest.mark.parametrize("layers", [1, 3])
def test_tank_continues_the_lattice_of_what_it_holds(layers):
    together = np.concatenate(
        [lattice(0, WIDTH, 0, WIDTH, DX), tank_particles(WIDTH, WIDTH, DX, layers)]
    )
    n = 12 + 2 * layers
    places = np.round(together / DX - 0.5).astype(int)
    assert np.abs(together - (places + 0.5) * DX).max() < 1e-12
    assert len(set(map(tuple, places))) == len(together) == n * (12 + layers)


def test_the_box_of_the_cases_is_open_above():
    assert BOX[3] == math.inf
