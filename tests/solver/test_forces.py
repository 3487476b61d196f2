"""Density, pressure and acceleration against the naive solver, and what the forces conserve."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sph_gym import Effects, Fluid, Scene, Simulation, lattice
from tests.cases import (
    C0,
    CLOUDS,
    DX,
    DYNAMIC_PRESSURE,
    STILL,
    WATER,
    WIDTH,
    assert_close,
    clouds,
    compiled_cases,
    configurations,
    fluid,
    scene,
    simulation,
    uncompiled,
)
from tests.naive import Naive

TOLERANCE = {"float64": 1e-10, "float32": 1e-4}


@compiled_cases
def test_fields_are_those_of_the_naive_solver(configuration, dtype, cloud):
    sim = simulation(configuration, cloud, dtype)
    assert_naive(sim, TOLERANCE[dtype])
    assert not sim.a[sim.n_fluid :].any()


@configurations
def test_brute_force_finds_the_fields_of_the_naive_solver(configuration, dtype):
    sim = simulation(configuration, "disordered", dtype, "brute")
    assert_naive(sim, TOLERANCE[dtype])


def assert_naive(sim, tolerance):
    """The fields of a simulation are those of the naive solver at its start."""
    naive = Naive(sim.scene, sim.controls)
    state = naive.start(np.asarray(sim.scene.x), np.asarray(sim.scene.v))
    assert_same_fields(sim, naive, state, tolerance)


def assert_same_fields(sim, naive, state, tolerance):
    """rho, p and a of a simulation are those that belong to a state of the naive solver."""
    x, v, rho, time, _ = state
    rho, p, _ = naive.fields(x, v, time, rho if sim.scene.effects.continuity else None)
    assert_close(sim.rho, rho, tolerance)
    assert_close(sim.p, p, tolerance, at_least=DYNAMIC_PRESSURE)
    a = naive.acceleration(x, v, time, rho[: len(x)])
    assert_close(fluid(sim, "a"), a, tolerance, at_least=9.81)


# --- Densities that are known ---------------------------------------------------------------


def at_rest(x, h_over_dx, **changes):
    return Simulation(Scene("at rest", x=x, dx=DX, h=h_over_dx * DX, fluid=WATER, **changes))


def block(n):
    return lattice(0.0, n * DX, 0.0, n * DX, DX)


@pytest.mark.without_jit
@pytest.mark.parametrize(("h_over_dx", "share"), [(2.0, 0.31), (3.0, 0.14), (4.0, 0.08)])
def test_density_of_an_isolated_particle_is_its_own(h_over_dx, share):
    sim = at_rest([(3.0, -2.0)], h_over_dx)
    assert sim.rho[0] / 1000.0 == pytest.approx(share, abs=0.01)


@pytest.mark.parametrize(("h_over_dx", "share"), [(2.0, 1.31), (3.0, 1.14), (4.0, 1.08)])
def test_density_of_a_coincident_pair_in_a_lattice(h_over_dx, share):
    n = 11
    x = block(n)
    sim = at_rest(np.concatenate([x, x[n * n // 2][None]]), h_over_dx)
    assert sim.rho[[n * n // 2, n * n]] / 1000.0 == pytest.approx(share, abs=0.01)


def test_density_at_a_free_surface():
    n = 11
    sim = at_rest(block(n), 3.0)
    assert sim.rho[n // 2] / 1000.0 == pytest.approx(0.69, abs=0.01)
    assert sim.rho[0] / 1000.0 == pytest.approx(0.48, abs=0.01)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("dx", [1e-6, 1e-3, 1.0, 1e3])
def test_density_knows_no_unit_of_length(dx, dtype):
    n = 11
    x = lattice(0.0, n * dx, 0.0, n * dx, dx)
    sim = Simulation(Scene("lattice", x=x, dx=dx, h=2.6 * dx, fluid=WATER), dtype)
    assert sim.rho[n * n // 2] == pytest.approx(1000.0, rel=1e-5)


# --- Forces that are known ------------------------------------------------------------------


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, -1.0), (0.6, 0.8)])
def test_two_compressed_particles_push_apart(direction):
    # with h = dx a lonely particle has the rest density, and any neighbour compresses it
    x = np.array([(0.0, 0.0), direction]) * 0.9 * DX
    sim = at_rest(x, 1.0)
    assert (sim.rho > 1000.0).all()
    apart = sim.a @ np.array(direction)
    assert apart[0] < 0.0 < apart[1]
    assert sim.a[0] == pytest.approx(-sim.a[1], rel=1e-12)
    across = sim.a @ np.array([-direction[1], direction[0]])
    assert_close(across, np.zeros(2), 1e-12, at_least=apart[1])


def test_two_separated_particles_pull_together_only_without_the_clamp():
    x = [(0.0, 0.0), (1.5 * DX, 0.0)]
    assert not at_rest(x, 2.0).a.any()
    pulled = Simulation(Scene("pair", x=x, dx=DX, h=2 * DX, fluid=Fluid(c0=C0, clamp=False))).a
    assert pulled[0, 0] > 0.0 > pulled[1, 0]


@pytest.mark.without_jit
def test_coincident_particles_do_not_push_each_other():
    sim = at_rest([(0.1, 0.1)] * 5, 2.0, v=[(i, -i) for i in range(5)])
    assert sim.p.min() > 0.0
    assert not sim.a.any()


@uncompiled
@pytest.mark.parametrize("name", ["artificial_viscosity", "laminar_viscosity"])
def test_viscosity_slows_an_approach(name):
    pair = {"x": [(0.0, 0.0), (DX, 0.0)], "v": [(1.0, 0.0), (-1.0, 0.0)]}
    a = Simulation(
        Scene("pair", **pair, dx=DX, h=2 * DX, fluid=WATER, effects=Effects(**{name: 0.1}))
    ).a
    assert a[0, 0] < 0.0 < a[1, 0]


@uncompiled
def test_artificial_viscosity_lets_a_parting_pair_go():
    pair = {"x": [(0.0, 0.0), (DX, 0.0)], "v": [(-1.0, 0.0), (1.0, 0.0)]}
    effects = Effects(artificial_viscosity=0.1)
    assert not Simulation(
        Scene("pair", **pair, dx=DX, h=2 * DX, fluid=WATER, effects=effects)
    ).a.any()


# --- What is conserved ----------------------------------------------------------------------

# pressure alone, and with all that acts between pairs
pairs_only = pytest.mark.parametrize(
    ("configuration", "parts"),
    [("none", {}), ("open space", {"effects": STILL})],
    ids=["pressure", "all pair effects"],
)


@clouds
@pairs_only
def test_forces_between_particles_add_up_to_nothing(configuration, parts, cloud):
    a = simulation(configuration, cloud, **parts).a
    assert_close(a.sum(axis=0), np.zeros(2), 1e-13, at_least=np.abs(a).sum())


@pytest.mark.parametrize("cloud", CLOUDS)
@pairs_only
def test_momentum_and_the_motion_of_the_centre_are_conserved(configuration, parts, cloud):
    sim = simulation(configuration, cloud, **parts)
    # short enough for the violence of the overlapping cloud
    sim.controls = sim.controls._replace(dt=1e-5)
    x, v, dt = sim.x, sim.v, 1e-5
    assert not sim.advance(20 * dt).diverged
    most = np.abs(sim.v).sum()
    assert_close(sim.v.sum(axis=0), v.sum(axis=0), 1e-13, at_least=most)
    moved = (sim.x - x).sum(axis=0)
    assert_close(moved, 20 * dt * v.sum(axis=0), 1e-13, at_least=20 * dt * most)


def test_pressure_exerts_no_torque():
    sim = simulation("none")
    x, a = sim.x, sim.a
    torque = x[:, 0] * a[:, 1] - x[:, 1] * a[:, 0]
    assert abs(torque.sum()) <= 1e-13 * np.abs(torque).sum()


# --- What makes no difference ---------------------------------------------------------------
# Positions and velocities are multiples of 2^-30, so that moving them rounds nothing off.


def dyadic(values):
    return np.round(np.asarray(values) * 2.0**30) / 2.0**30


def open_space(x, v):
    """Pressure and all viscosity, without gravity, in open space."""
    return simulation("open space", x=x, v=v, effects=STILL)


CLOUD = scene("open space")
X, V = dyadic(CLOUD.x), dyadic(CLOUD.v)
shifts = st.integers(-1000, 1000)


@given(shifts, shifts)
def test_translation_changes_nothing(across, up):
    here, there = open_space(X, V), open_space(X + np.array([across, up]), V)
    assert_close(there.rho, here.rho, 1e-12)
    assert_close(there.a, here.a, 1e-12)


@given(shifts, shifts)
def test_a_moving_observer_sees_the_same(across, up):
    wind = np.array([across, up]) / 64
    still, moving = open_space(X, V), open_space(X, V + wind)
    assert_close(moving.a, still.a, 1e-12)
    dt = 2.0**-12
    for sim in (still, moving):
        sim.controls = sim.controls._replace(dt=dt)
        sim.advance(4 * dt)
    assert_close(moving.v - wind, still.v, 1e-12)
    assert_close(moving.x - 4 * dt * wind, still.x, 1e-12)


@pytest.mark.without_jit
@pytest.mark.parametrize("turns", [1, 2, 3])
def test_rotation_by_right_angles_rotates_the_result(turns):
    rotation = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), turns)
    sim, turned = open_space(X, V), open_space(X @ rotation.T, V @ rotation.T)
    assert_close(turned.rho, sim.rho, 1e-12)
    assert_close(turned.a, sim.a @ rotation.T, 1e-12)


def test_reflection_reflects_the_result():
    mirror = np.array([-1.0, 1.0])
    sim, mirrored = open_space(X, V), open_space(X * mirror, V * mirror)
    assert_close(mirrored.a, sim.a * mirror, 1e-12)


@pytest.mark.parametrize("configuration", ["open space", "everything"])
def test_permuting_the_particles_permutes_the_result(configuration):
    order = np.random.default_rng(1).permutation(len(X))
    sim = simulation(configuration, x=X, v=V)
    permuted = simulation(configuration, x=X[order], v=V[order])
    for field in ("rho", "p", "a"):
        assert_close(fluid(permuted, field), fluid(sim, field)[order], 1e-12)
    for each in (sim, permuted):
        each.advance(5 * each.controls.dt)
    assert_close(fluid(permuted, "v"), fluid(sim, "v")[order], 1e-12)


def test_width_of_the_cloud_is_that_of_the_tank():
    assert np.asarray(scene(cloud="lattice 2").x).max() == pytest.approx(WIDTH - DX / 2)
