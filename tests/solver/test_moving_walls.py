"""Lids, belts, pistons, sides of a box that move, and what the fluid at them feels."""

from dataclasses import replace

import numpy as np
import pytest

from sph_gym import (
    Controls,
    Effects,
    Fluid,
    Motion,
    Scene,
    Simulation,
    Walls,
    lattice,
    tank_particles,
)
from tests.cases import C0, DX, STIFFNESS, UNCOMPILED, WATER, assert_close, fluid
from tests.solver.test_integrators import integrators
from tests.solver.test_terms import SIDE, TANK, agrees, cloud, extrapolated

pytestmark = UNCOMPILED
SLICK = Effects(laminar_viscosity=0.1)


# --- What no slip is ------------------------------------------------------------------------


def drag(v_fluid, v_wall, **walls):
    """Mean acceleration [m/s^2] along the floor of the two lowest rows of a resting lattice."""
    x = lattice(0.0, SIDE, 0.0, SIDE, DX)
    v = np.tile((v_fluid, 0.0), (len(x), 1))
    floor = TANK[TANK[:, 1] < 0]
    start = cloud(
        x=x, v=v, effects=SLICK, walls=Walls(floor, velocity=(v_wall, 0.0), **walls),
        fluid=replace(WATER, kernel="wendland_c2"),
    )  # fmt: skip
    a = fluid(Simulation(start), "a")
    lowest = x[:, 1] < 1.6 * DX
    return a[lowest, 0].mean()


@pytest.mark.parametrize("pressure", ["like fluid", "extrapolated"])
def test_a_wall_drags_the_fluid_along(pressure):
    assert drag(0.0, 1.0, pressure=pressure) > 0.1
    assert drag(1.0, 0.0, pressure=pressure) < -0.1
    assert drag(1.0, 1.0, pressure=pressure) == pytest.approx(0.0, abs=1e-9)
    # only the difference counts
    assert drag(3.0, 5.0, pressure=pressure) == pytest.approx(drag(0.0, 2.0, pressure=pressure))


def test_a_mirrored_velocity_makes_the_fluid_at_the_wall_that_of_the_wall():
    """2 v_wall - v is twice as far from v as v_wall is."""
    like = drag(0.0, 1.0)
    mirrored = drag(0.0, 1.0, pressure="extrapolated")
    # but for the densities of the walls, which differ a bit
    assert mirrored == pytest.approx(2 * like, rel=0.05)


@pytest.mark.parametrize("pressure", ["like fluid", "extrapolated"])
def test_at_a_wall_without_friction_nothing_drags(pressure):
    assert drag(0.0, 1.0, pressure=pressure, slip="free-slip") == pytest.approx(0.0, abs=1e-12)


# --- Pressure at extrapolated walls ---------------------------------------------------------


def wall_pressures(rho, clamp=False, time=0.0, **more):
    """A block between floor and side walls whose density [kg/m^3] is given, at a time [s]."""
    water = Fluid(c0=C0, kernel="wendland_c2", clamp=clamp)
    x = lattice(0.0, SIDE, 0.0, SIDE, DX)
    effects = replace(more.pop("effects", Effects()), continuity=True)
    sim = Simulation(cloud(x=x, v=None, fluid=water, effects=effects, walls=extrapolated(**more)))
    sim.restore(sim.snapshot() | {"time": time, "clock": time})
    snapshot = sim.snapshot()
    columns, n = snapshot["fluid"], sim.n_fluid
    # a density is a sum of weights plus what is carried
    present = sim.engine.fluid.rho[:n]
    columns["offset"][:n] += rho(columns["y"][:n]) - present
    sim.restore(snapshot)
    return sim


def test_a_uniform_pressure_is_taken_over():
    sim = wall_pressures(lambda y: np.full_like(y, 1010.0))
    wet = sim.p[sim.n_fluid :] != 0.0
    assert 10 < wet.sum() <= len(TANK)
    assert sim.p[sim.n_fluid :][wet] == pytest.approx(sim.p[0])
    assert sim.rho[sim.n_fluid :][wet] == pytest.approx(1010.0)
    assert sim.rho[sim.n_fluid :][~wet] == pytest.approx(1000.0)


@pytest.mark.parametrize("clamp", [True, False])
def test_tension_at_a_wall_is_cut_off_only_if_the_fluid_is_clamped(clamp):
    sim = wall_pressures(lambda y: np.full_like(y, 990.0), clamp)
    assert sim.p[sim.n_fluid :].min() == (0.0 if clamp else pytest.approx(sim.p[0]))


def test_under_gravity_it_is_the_hydrostatic_one():
    """Linear in the depth, also below the floor, where there is no fluid."""
    g, c2 = 9.81, 1.3 * C0**2
    sim = wall_pressures(
        lambda y: 1000.0 * (1 + 7 * g * (SIDE - y) / (c2 * 1.0)) ** (1 / 7),
        effects=Effects(gravity=(0.0, -g)),
    )
    p, y = sim.p, sim.x[:, 1]
    # p = rho0 g d with Tait's B, and rho hardly differs from rho0
    assert p[: sim.n_fluid] == pytest.approx(1000.0 * g * (SIDE - y[: sim.n_fluid]), rel=1e-9)
    floor = (y < 0) & (np.abs(sim.x[:, 0] - SIDE / 2) < 0.4 * SIDE)
    assert p[floor] == pytest.approx(1000.0 * g * (SIDE - y[floor]), rel=0.02)


def test_an_accelerated_wall_feels_its_own_acceleration():
    g = 9.81
    falling = Motion(amplitude=(0.0, 0.01), frequency=np.sqrt(g / 0.01) / (2 * np.pi))
    quarter = 0.25 / falling.frequency  # where the walls fall as fast as everything else
    sim = wall_pressures(
        lambda y: np.full_like(y, 1005.0), time=quarter, effects=Effects(gravity=(0.0, -g)),
        motion=falling,
    )  # fmt: skip
    wet = sim.p[sim.n_fluid :] != 0.0
    assert sim.p[sim.n_fluid :][wet] == pytest.approx(sim.p[0], rel=1e-6)


# --- Motion ---------------------------------------------------------------------------------


@integrators
@pytest.mark.parametrize("pressure", ["like fluid", "extrapolated"])
def test_boundary_particles_move_as_told(integrator, pressure):
    chosen = TANK[:, 0] < 0
    motion = Motion((0.5, -0.25), (0.01, 0.02), 3.0, particles=chosen)
    walls = Walls(TANK, pressure=pressure, velocity=(2.0, 0.0), motion=motion)
    sim = Simulation(cloud(n=2, walls=walls, integrator=integrator))
    for _ in range(4):
        sim.advance(2.5 * sim.controls.dt)
        t, omega = sim.time, 6 * np.pi
        shift = np.array([0.5 * t, -0.25 * t]) + np.array([0.01, 0.02]) * np.sin(omega * t)
        speed = (0.5, -0.25) + np.array([0.01, 0.02]) * omega * np.cos(omega * t)
        assert_close(sim.x[sim.n_fluid :], TANK + chosen[:, None] * shift, 1e-12)
        assert_close(sim.v[sim.n_fluid :], (2.0, 0.0) + chosen[:, None] * speed, 1e-12)
    assert sim.scene.walls.top_speed >= np.hypot(*sim.v[sim.n_fluid :].T).max()


@pytest.mark.every(2)
@integrators
@pytest.mark.parametrize("pressure", ["like fluid", "extrapolated"])
def test_nothing_passes_a_piston(integrator, pressure):
    n = 5
    walls = tank_particles(n * DX, 3 * DX, DX, layers=2, lid=True)
    left = (walls[:, 0] < 0) & (walls[:, 1] > 0) & (walls[:, 1] < 3 * DX)
    speed = 1.5
    motion = Motion((speed, 0.0), particles=left)
    x = lattice(2 * DX, n * DX, 0.0, 3 * DX, DX)
    water = Fluid(c0=20.0, kernel="wendland_c2")
    sim = Simulation(
        Scene(
            "piston", x=x, dx=DX, h=2 * DX, fluid=water, effects=Effects(artificial_viscosity=0.3),
            walls=Walls(walls, pressure=pressure, motion=motion), integrator=integrator,
            controls=Controls(4e-4, water.stiffness(20.0), 0.3),
        )
    )  # fmt: skip
    for _ in range(7):
        assert not sim.advance(4e-3).diverged
        face = speed * sim.time
        x, v = fluid(sim, "x"), sim.v
        assert x[:, 0].min() > face
        assert x[:, 0].max() < n * DX
        assert x[:, 1].min() > 0.0
        assert x[:, 1].max() < 3 * DX
        assert v[sim.n_fluid :][left, 0] == pytest.approx(speed)
        assert not v[sim.n_fluid :][~left].any()
    assert face > 2 * DX
    assert fluid(sim, "v")[:, 0].mean() > 0.0
    assert sim.p.max() > 0.0


# --- Sides of the box -----------------------------------------------------------------------


def one(x, v, sides, velocity, restitution, dt=0.01, box=(0.0, 1.0, 0.0, 1.0), **more):
    """A lonely particle after a step, in a box of which some sides move."""
    walls = Walls(box=box, restitution=restitution, motion=Motion(velocity, sides=sides))
    start = cloud(x=[x], v=[v], walls=walls, fluid=WATER, **more)
    sim = Simulation(start)
    sim.controls = Controls(dt, STIFFNESS, 0.3)
    sim.advance(dt)
    return sim.x[0], sim.v[0]


@integrators
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize(
    ("side", "axis", "place", "speed"),
    [
        ("left", 0, 0.0, 3.0),
        ("right", 0, 1.0, -3.0),
        ("bottom", 1, 0.0, 3.0),
        ("top", 1, 1.0, -3.0),
    ],
)
def test_a_moving_side_hits_like_a_bat(side, axis, place, speed, restitution, integrator):
    x, v = np.full(2, 0.5), np.full(2, 0.25)
    velocity = np.zeros(2)
    velocity[axis] = speed
    x[axis], v[axis] = place + 0.01 * np.sign(speed), -speed / 2
    after_x, after_v = one(x, v, (side,), velocity, restitution, integrator=integrator)
    # as the side sees it, it came with -1.5 of its speed
    assert after_v[axis] == pytest.approx(speed + 1.5 * restitution * speed)
    inwards = np.sign(speed)
    assert (after_x[axis] - (place + 0.01 * speed)) * inwards >= -1e-12
    assert after_v[1 - axis] == 0.25


def test_a_side_that_flees_slows_what_follows_it():
    x, v = one((0.01, 0.5), (-4.0, 0.0), ("left",), (-1.0, 0.0), 1.0)
    assert v[0] == pytest.approx(2.0)
    # put a tenth of dx in front of a side that no boundary particle stands for
    assert x[0] == pytest.approx(-0.01 + 0.1 * DX)


def test_the_other_sides_stand_still():
    x, v = one((0.99, 0.5), (4.0, 0.0), ("left",), (-1.0, 0.0), 0.5)
    assert x[0] == 1.0 - 0.1 * DX
    assert v[0] == pytest.approx(-2.0)


def test_an_open_side_may_move():
    box = (-np.inf, np.inf, 0.0, np.inf)
    x, v = one((0.5, 0.5), (4.0, 1.0), ("left", "top"), (1.0, 1.0), 0.5, box=box)
    assert x == pytest.approx([0.54, 0.51])
    assert tuple(v) == (4.0, 1.0)


@integrators
@pytest.mark.parametrize("restitution", [0.0, 1.0])
@pytest.mark.parametrize(
    ("side", "axis", "begin", "speed"),
    [("left", 0, 0.0, 3.0), ("right", 0, 1.0, -3.0), ("bottom", 1, 0.0, 3.0), ("top", 1, 1, -3.0)],
)
def test_a_moving_side_pushes_nobody_through_a_plate(
    side, axis, begin, speed, restitution, integrator
):
    place, inwards = begin + 0.025 * np.sign(speed), np.sign(speed)
    plate = np.array([place, -1.0, place, 2.0])[[axis, 1 - axis, 2 + axis, 3 - axis]]
    x, velocity = np.full(2, 0.5), np.zeros(2)
    x[axis], velocity[axis] = begin + 0.01 * inwards, speed
    walls = Walls(
        box=(0.0, 1.0, 0.0, 1.0), restitution=restitution, plates=[plate],
        motion=Motion(tuple(velocity), sides=(side,)),
    )  # fmt: skip
    sim = Simulation(cloud(x=[x], v=[np.zeros(2)], walls=walls, fluid=WATER, integrator=integrator))
    sim.controls = Controls(0.01, STIFFNESS, 0.3)
    for _ in range(4):
        # who is hit again and again between the two may well become too fast
        sim.advance(0.01)
        assert (sim.x[0, axis] - place) * inwards < 0.0
        assert sim.x[0, 1 - axis] == 0.5


@pytest.mark.parametrize("integrator", ["symplectic_euler", "kick_drift_kick"])
def test_a_cloud_between_a_closing_box_and_plates_is_that_of_the_naive_solver(integrator):
    walls = Walls(
        box=(0.0, SIDE, 0.0, SIDE), restitution=0.5,
        motion=Motion((8.0, 0.0), sides=("left",)),
        plates=[(0.012, -0.1, 0.013, 0.2), (0.02, 0.055, 0.08, 0.045)],
    )  # fmt: skip
    start = cloud(walls=walls, speed=10.0, integrator=integrator)
    agrees(replace(start, x=np.clip(start.x, 0.0, SIDE)), 10, neighbors=["grid"])


@integrators
def test_nothing_leaves_a_box_that_closes(integrator):
    walls = Walls(
        box=(0.0, SIDE, 0.0, SIDE), restitution=0.5, motion=Motion((-2.0, 0.0), sides=("right",))
    )
    start = cloud(walls=walls, speed=20.0, fluid=WATER, integrator=integrator)
    sim = Simulation(replace(start, x=np.clip(start.x, 0.0, SIDE)))
    for _ in range(20):
        sim.advance(sim.controls.dt)
        x = sim.x
        assert x.min() >= 0.0
        assert x[:, 1].max() <= SIDE
        assert x[:, 0].max() <= SIDE - 2.0 * sim.time + 1e-12
