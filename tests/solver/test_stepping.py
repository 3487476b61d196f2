"""Time: one step and several against the naive solver, free fall, and what a step may not do."""

from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Fluid, Gravity, Simulation
from sph_gym.solver.kernels import viscous_share
from sph_gym.solver.stepping import stable_dt
from tests.cases import (
    ALL_EFFECTS,
    C0,
    CLOUDS,
    DX,
    assert_close,
    compiled_cases,
    configurations,
    fluid,
    scene,
    simulation,
)
from tests.naive import Naive
from tests.solver.test_forces import TOLERANCE

# half of dx / c0, long enough for the fast clouds to reach the box
DT = 1e-3


@compiled_cases
def test_one_step_is_that_of_the_naive_solver(configuration, dtype, cloud):
    sim = simulation(configuration, cloud, dtype)
    # the overlapping cloud starts with accelerations of up to 1e8 m/s^2
    assert_naive_step(sim, DT / 100 if cloud == "overlapping" else DT, TOLERANCE[dtype])


@configurations
def test_one_step_by_brute_force_is_that_of_the_naive_solver(configuration, dtype):
    sim = simulation(configuration, "jittered", dtype, "brute")
    assert_naive_step(sim, DT, TOLERANCE[dtype])


def assert_naive_step(sim, dt, tolerance):
    """One step of a simulation from its start leads where the naive solver gets."""
    naive = Naive(sim.scene, sim.controls)
    start = naive.start(np.asarray(sim.scene.x), np.asarray(sim.scene.v))
    sim.controls = sim.controls._replace(dt=dt)
    assert sim.advance(dt).n_substeps == 1
    new = naive.go_on(start, dt)
    assert_close(fluid(sim, "v"), new.v, tolerance)
    assert_close(fluid(sim, "x") - start.x, new.x - start.x, tolerance)
    assert_close(sim.rho[: sim.n_fluid], new.rho, tolerance)


@pytest.mark.parametrize(
    ("configuration", "gravity"),
    [
        ("everything", Gravity(1.5, -9.81, ramp=3.5e-4)),
        ("open space", Gravity(0.0, 0.0)),
        ("periodic", None),
    ],
)
def test_several_steps_are_those_of_the_naive_solver(configuration, gravity):
    effects = scene(configuration).effects
    sim = simulation(configuration, effects=replace(effects, gravity=gravity))
    naive = Naive(sim.scene, sim.controls)
    x, v, dt = np.asarray(sim.scene.x), np.asarray(sim.scene.v), 1e-4
    sim.controls = sim.controls._replace(dt=dt)
    assert sim.advance(5 * dt).n_substeps == 5
    for k in range(5):
        x, v = naive.step(x, v, k * dt, dt)
    assert_close(fluid(sim, "x"), x, 1e-10)
    assert_close(fluid(sim, "v"), v, 1e-10)
    assert_close(fluid(sim, "a"), naive.acceleration(x, v, 5 * dt), 1e-8)


# --- Free fall ------------------------------------------------------------------------------


def fall(ramp=0.0, **more):
    gravity = Gravity(1.5, -9.81, ramp)
    return simulation("open space", effects=replace(ALL_EFFECTS, gravity=gravity), **more)


@pytest.mark.without_jit
def test_free_fall_of_a_lonely_particle_is_that_of_symplectic_euler():
    x, v, g = np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([1.5, -9.81])
    sim = fall(x=[x], v=[v])
    n, dt = 50, sim.controls.dt
    sim.advance(n * dt)
    assert sim.v[0] == pytest.approx(v + n * dt * g, rel=1e-13)
    assert sim.x[0] == pytest.approx(x + n * dt * v + g * dt**2 * n * (n + 1) / 2, rel=1e-13)


def test_a_resting_lattice_falls_as_one():
    sim = fall(cloud="lattice 3", v=None)
    x, n, dt, g = sim.x, 30, sim.controls.dt, np.array([1.5, -9.81])
    sim.advance(n * dt)
    assert_close(sim.v, np.broadcast_to(n * dt * g, sim.v.shape), 1e-10)
    assert_close(sim.x - x, np.broadcast_to(g * dt**2 * n * (n + 1) / 2, sim.x.shape), 1e-10)


def test_gravity_comes_on_over_its_ramp():
    sim = fall(ramp=0.05, x=[(0.0, 0.0)], v=None)
    dt = 1e-3
    sim.controls = sim.controls._replace(dt=dt)
    assert not sim.a.any()
    for n in (20, 30, 30):  # into the ramp, to its end, beyond it
        sim.advance(n * dt)
    shares = np.minimum(np.arange(80) * dt / 0.05, 1.0)
    assert sim.v[0] == pytest.approx(shares.sum() * dt * np.array([1.5, -9.81]), rel=1e-12)
    assert sim.a[0] == pytest.approx([1.5, -9.81])


def test_a_ramp_is_looked_up_at_the_time_of_each_substep():
    whole, parts = (fall(ramp=0.05, x=[(0.0, 0.0)], v=None) for _ in range(2))
    for sim in (whole, parts):
        sim.controls = sim.controls._replace(dt=1e-3)
    whole.advance(0.02)
    for _ in range(20):
        parts.advance(0.001)
    assert parts.v[0] == pytest.approx(whole.v[0], rel=1e-12)


# --- Energy ---------------------------------------------------------------------------------


def test_a_matched_kernel_keeps_the_energy():
    water = Fluid(c0=C0, kernel="wendland_c2", clamp=False)
    sim = simulation("none", "jittered", fluid=water, speed=0.5)
    sim.controls = sim.controls._replace(dt=2e-5)

    def energy():
        numbers = sim.diagnostics()
        return numbers["kinetic_energy"] + numbers["internal_energy"]

    before = energy()
    assert not sim.advance(0.02).diverged
    assert energy() == pytest.approx(before, rel=1e-3)


# --- The stable step ------------------------------------------------------------------------


@pytest.mark.without_jit
def test_stable_dt_is_the_smallest_limit():
    assert stable_dt(0.1, 20.0, 0.0, None) == pytest.approx(0.4 * 0.1 / 20.0)
    assert stable_dt(0.1, 20.0, 1.0, 0.0) == pytest.approx(0.4 * 0.1 / 20.0)
    assert stable_dt(0.1, 20.0, 1e9, None) == pytest.approx(0.25 * (0.1 / 1e9) ** 0.5)
    assert stable_dt(0.1, 20.0, 1.0, 5.0) == pytest.approx(0.125 * 0.1**2 / 5.0)


@pytest.mark.parametrize("cloud", CLOUDS)
@pytest.mark.parametrize("configuration", ["none", "open space"])
def test_stable_dt_of_a_simulation(configuration, cloud):
    sim = simulation(configuration, cloud)
    h, c = sim.scene.h, np.sqrt(7 * sim.controls.stiffness / 1000.0)
    limits = [0.4 * h / c, 0.25 * np.sqrt(h / np.linalg.norm(sim.a, axis=1).max())]
    if configuration == "open space":
        limits.append(viscous_share(h, DX) * h**2 / ALL_EFFECTS.laminar_viscosity)
    assert sim.stable_dt() == pytest.approx(min(limits), rel=1e-12)


def test_stable_dt_follows_state_and_stiffness():
    sim = Simulation(scene("none", "jittered", speed=0.0))
    sim.controls = sim.controls._replace(stiffness=1000.0)
    soft = sim.stable_dt()
    sim.controls = sim.controls._replace(stiffness=16000.0)
    assert sim.stable_dt() == pytest.approx(soft / 4, rel=1e-12)
    sim.advance(0.005)
    a_max = np.linalg.norm(sim.a, axis=1).max()
    c = np.sqrt(7 * 16.0)
    h = 2.6 * DX
    assert sim.stable_dt() == pytest.approx(min(0.4 * h / c, 0.25 * np.sqrt(h / a_max)))
