"""Periodic domains: no place in them is special, and nothing is lost at their ends."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sph_gym import Controls, Motion, Scene, Simulation, Walls, channel_particles, lattice
from tests.cases import (
    C0,
    DX,
    FREE,
    PERIOD,
    STIFFNESS,
    UNCOMPILED,
    assert_close,
    scene,
    simulation,
    uncompiled,
)
from tests.solver.test_integrators import integrators
from tests.solver.test_terms import PERIODS, agrees, periodic_cloud

LENGTH = PERIOD[1] - PERIOD[0]
N = 12


def wrapped(x):
    """Positions in the domain of the cases; rounding may not put one onto its upper end."""
    x = PERIOD[0] + np.mod(np.asarray(x) - PERIOD[0], LENGTH)
    return np.where(x >= PERIOD[1], PERIOD[0], x)


def apart(x, other):
    """How far places are from others, or from their images [m]."""
    offset = np.asarray(x) - other
    return np.abs(offset - LENGTH * np.round(offset / LENGTH)).max()


# --- Translation ----------------------------------------------------------------------------

shifts = st.floats(-1.0, 1.0)


@given(shifts, shifts)
def test_no_place_is_special(across, up):
    here = simulation("periodic")
    x = wrapped(np.asarray(here.scene.x) + np.array([across, up]))
    there = simulation("periodic", x=x, v=here.scene.v)
    assert_close(there.rho, here.rho, 1e-12)
    assert_close(there.a, here.a, 1e-10)
    assert (there.neighbor_counts == here.neighbor_counts).all()
    for sim in (here, there):
        assert sim.advance(3 * sim.controls.dt).n_substeps == 3
    assert_close(there.v, here.v, 1e-10)
    assert apart(there.x, here.x + np.array([across, up])) < 1e-10 * LENGTH


def test_momentum_is_kept_through_the_ends():
    x = wrapped(np.asarray(scene("periodic").x) + LENGTH / 2)
    sim = simulation("periodic", x=x, speed=3.0)
    sim.controls = sim.controls._replace(dt=1e-4)
    a, v = sim.a, sim.v
    assert_close(a.sum(axis=0), np.zeros(2), 1e-13, at_least=np.abs(a).sum())
    x = sim.x
    assert not sim.advance(3e-3).diverged
    assert (np.abs(sim.x - x) > LENGTH / 2).any()  # some came in again at the other end
    assert_close(sim.v.sum(axis=0), v.sum(axis=0), 1e-12, at_least=np.abs(v).sum())


# --- Lattices -------------------------------------------------------------------------------


def full(h_over_dx, n, origin=0.0, dtype="float64", **more):
    """A lattice that fills a domain of n x n particles."""
    ends = (origin, origin + n * DX)
    walls = Walls(period_x=ends, period_y=ends)
    return simulation(
        "periodic", dtype=dtype, x=lattice(*ends, *ends, DX), v=None, h=h_over_dx * DX,
        walls=walls, **more,
    )  # fmt: skip


@pytest.mark.parametrize("origin", [0.0, 0.3, -17.1])
@pytest.mark.parametrize(
    ("h_over_dx", "n"), [(2.0, 8), (2.0, 11), (3.0, 12), (4.0, 16), (2.6, 11), (1.5, 6), (2.0, 40)]
)
def test_a_lattice_without_ends_is_at_rest(h_over_dx, n, origin):
    """Most of them are as small as they may be, 4 h."""
    sim = full(h_over_dx, n, origin)
    assert sim.rho == pytest.approx(1000.0, rel=1e-11)
    reach = np.arange(-5, 6)
    r = np.hypot(*np.meshgrid(reach, reach))
    if not float(h_over_dx).is_integer():
        assert (sim.neighbor_counts == (r < h_over_dx).sum() - 1).all()
    assert_close(sim.a, np.zeros_like(sim.a), 1e-9, at_least=C0**2 / DX)
    assert not sim.advance(10 * sim.controls.dt).diverged
    assert np.abs(sim.v).max() < 1e-9


def test_all_particles_of_a_lattice_have_the_same_neighbors():
    # at the edge of the support, where rounding decides, on both sides alike
    for h_over_dx, n in ((2.0, 9), (3.0, 13), (4.0, 17)):
        sim = full(h_over_dx * (1 + 1e-9), n)
        reach = np.arange(-5, 6)
        r = np.hypot(*np.meshgrid(reach, reach))
        assert (sim.neighbor_counts == (r <= h_over_dx).sum() - 1).all()


def test_a_domain_must_be_wide_enough():
    ends = (0.0, 8 * DX)
    x = lattice(*ends, *ends, DX)
    for name in ("period_x", "period_y"):
        Scene("fits", x=x, dx=DX, h=2 * DX, fluid=FREE, walls=Walls(**{name: ends}))
        with pytest.raises(ValueError, match=name):
            Scene("narrow", x=x, dx=DX, h=2.01 * DX, fluid=FREE, walls=Walls(**{name: ends}))
        with pytest.raises(ValueError, match=rf"x: .*{name}"):
            Scene("out", x=x + DX, dx=DX, h=2 * DX, fluid=FREE, walls=Walls(**{name: ends}))


# --- Ends -----------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", ["float64", pytest.param("float32", marks=UNCOMPILED)])
@pytest.mark.parametrize(
    ("periods", "lost"),
    [
        ((1.2, 0.0), False),
        ((-1.1, 0.4), False),
        ((1.7, 0.0), True),
        ((0.0, -1.5), True),
        ((3.7, 0.1), True),
        ((10.0, 10.0), True),
    ],
)
def test_who_ends_more_than_a_period_outside_has_blown_up(periods, lost, dtype):
    """It would have been kept there, and summed over nobody."""
    dt = 1e-3
    x, path = np.array([0.07, 0.03]), LENGTH * np.array(periods)
    sim = simulation("periodic", dtype=dtype, x=[x], v=[path / dt])
    sim.controls = sim.controls._replace(dt=dt)
    report = sim.advance(dt)
    assert report.diverged == lost
    assert (PERIOD[0] <= sim.x).all()
    assert (sim.x < PERIOD[1]).all()
    if lost:
        assert report.bad_particle == 0
        assert report.cause in ("energy", "cfl", "tunnelling")
    else:
        assert apart(sim.x[0], x + path) < 1e-6


@uncompiled
@integrators
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("others", [{}, {"period_x": (0.0, 1.0), "period_y": (0.0, 1.0)}])
def test_a_plate_behind_an_end_stops_who_comes_through_it(axis, direction, others, integrator):
    place = 0.5 - 0.49 * direction
    plate = np.array([place, 0.2, place, 0.8])
    x, v = np.array([0.5 + 0.47 * direction, 0.5]), np.array([10.0 * direction, 0.4])
    if axis == 1:
        plate, x, v = plate[[1, 0, 3, 2]], x[::-1], v[::-1]
    period = {("period_x", "period_y")[axis]: (0.0, 1.0)} | others
    walls = Walls(plates=[plate], restitution=0.5, **period)
    sim = simulation("plates", x=[x], v=[v], walls=walls, integrator=integrator)
    sim.controls = Controls(5e-3, STIFFNESS, 0.3)
    skin = 0.01 * DX * direction
    # it has either hit it, been put in front of it and come back, or just that
    way = sim.v[0, axis]
    sim.advance(5e-3)
    assert sim.v[0, axis] == pytest.approx(-0.5 * way)
    assert sim.v[0, 1 - axis] == pytest.approx(0.4)
    beyond = (sim.x[0, axis] - place + 0.5) % 1.0 - 0.5
    assert beyond * direction <= -skin * direction + 1e-12
    assert beyond * direction > -0.05
    assert not sim.advance(0.1).diverged
    assert sim.v[0, axis] == pytest.approx(-0.5 * way)


@uncompiled
def test_a_plate_across_the_corner_of_two_periods_stops_a_path_to_its_image():
    ends = (0.0, 1.0)
    walls = Walls(plates=[(0.0, 0.03, 0.03, 0.0)], period_x=ends, period_y=ends)
    sim = simulation("plates", x=[(0.98, 0.98)], v=[(10.0, 10.0)], walls=walls)
    sim.controls = Controls(5e-3, STIFFNESS, 0.3)
    sim.advance(5e-3)
    assert sim.x[0] == pytest.approx(2 * [0.015 - 0.01 * DX / np.sqrt(2)])
    assert sim.v[0] == pytest.approx((0.0, 0.0), abs=1e-12)


@uncompiled
@pytest.mark.parametrize("integrator", ["symplectic_euler", "kick_drift_kick"])
def test_a_periodic_cloud_against_plates_is_that_of_the_naive_solver(integrator):
    plates = [(0.001, 0.02, 0.002, 0.1), (0.03, 0.003, 0.1, 0.001), (0.06, 0.05, 0.118, 0.07)]
    start = periodic_cloud(PERIODS["both"], walls=Walls(plates=plates, restitution=0.7))
    agrees(replace(start, integrator=integrator), 6, neighbors=["grid"])


@pytest.mark.parametrize("v", [(70.0, 30.0), (-70.0, 30.0), (0.0, -55.0), (-90.0, -90.0)])
def test_a_lonely_particle_flies_round_and_round(v):
    x = np.array([0.07, 0.03])
    sim = simulation("periodic", x=[x], v=[v])
    sim.controls = sim.controls._replace(dt=1e-3)
    for k in range(1, 41):
        sim.advance(1e-3)
        assert apart(sim.x[0], x + k * 1e-3 * np.array(v)) < 1e-12
        assert (PERIOD[0] <= sim.x).all()
        assert (sim.x < PERIOD[1]).all()
        assert tuple(sim.v[0]) == v


def test_two_particles_meet_across_the_ends():
    gap = 0.4 * DX
    x = [(PERIOD[0] + gap, PERIOD[0] + gap), (PERIOD[1] - gap, PERIOD[1] - gap)]
    sim = simulation("periodic", x=x, v=None, h=1.5 * DX)
    assert sim.neighbor_counts.tolist() == [1, 1]
    x = [(0.0, 0.0), (-2 * gap, -2 * gap)]
    near = simulation("periodic", x=x, v=None, h=1.5 * DX)
    assert_close(sim.a, near.a, 1e-12)
    assert np.abs(sim.a).max() > 0.0
    assert sim.diagnostics()["min_spacing"] == pytest.approx(0.8 * np.sqrt(2))


@uncompiled
@pytest.mark.parametrize("pressure", ["like fluid", "extrapolated"])
def test_a_belt_that_moves_comes_round(pressure):
    """Walls that slide as a whole are where they were after a period, and so is all they do."""
    n = 6
    walls = Walls(
        channel_particles(n * DX, 4 * DX, DX, layers=2),
        pressure=pressure,
        motion=Motion((n * DX / 0.01, 0.0)),
        period_x=(0.0, n * DX),
    )
    x = lattice(0.0, n * DX, 0.0, 4 * DX, DX) + 0.1 * DX
    controls = Controls(1e-5, STIFFNESS, 0.3)
    sim = Simulation(
        Scene("belt", x=x, dx=DX, h=1.5 * DX, fluid=FREE, walls=walls, controls=controls)
    )
    before = sim.rho, sim.a, sim.x[sim.n_fluid :]
    for time in (0.01, 0.37):
        snapshot = sim.snapshot()
        sim.restore(snapshot | {"time": time, "clock": time})
        assert_close(sim.rho, before[0], 1e-10)
        assert_close(sim.a, before[1], 1e-8)
        at = sim.x[sim.n_fluid :]
        apart = at - before[2]
        apart[:, 0] -= n * DX * np.round(apart[:, 0] / (n * DX))
        assert np.abs(apart).max() < 1e-12
        assert at[:, 0].min() >= -1e-12
        assert at[:, 0].max() <= n * DX + 1e-12
