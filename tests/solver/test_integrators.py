"""How steps are put together: orders, what is kept, and that cuts leave no trace."""

from dataclasses import replace

import numpy as np
import pytest

from sph_gym import CentralGravity, Controls, Effects, Fluid, Scene, Simulation, scenes
from sph_gym.solver.integrators import VISCOUS_SHARES
from sph_gym.solver.stepping import STEPS
from tests.cases import (
    C0,
    DX,
    STIFFNESS,
    WATER,
    assert_close,
    fluid,
    scene,
    set_entries,
    simulation,
    uncompiled,
)
from tests.naive import Naive
from tests.solver.test_simulation import assert_same
from tests.solver.test_terms import FIELDS, WALLS, cloud

INTEGRATORS = ("symplectic_euler", "kick_drift_kick", "predictor_corrector")
integrators = pytest.mark.parametrize("integrator", INTEGRATORS)
# one for each integrator, with walls that move and densities in the state
everything = pytest.mark.parametrize("configuration", ["all, euler", "all, kick", "all, predictor"])


# --- A smooth problem -----------------------------------------------------------------------

OMEGA = 2.0
START = {"x": [(1.0, 0.0), (-0.5, 0.75)], "v": [(0.0, 1.5), (1.0, 0.5)]}


def orbits(integrator, n_steps, periods=1.0):
    """Two particles, far from each other, around the centre of a spring."""
    effects = Effects(gravity=CentralGravity(OMEGA))
    sim = Simulation(
        Scene("orbit", **START, dx=DX, h=2 * DX, fluid=WATER, effects=effects,
              integrator=integrator),
        neighbors="brute",
    )  # fmt: skip
    seconds = periods * 2 * np.pi / OMEGA
    sim.controls = sim.controls._replace(dt=seconds / n_steps)
    return sim, seconds


def orbit_error(integrator, n_steps):
    """Distance [m] from where the particles must be after most of an orbit."""
    sim, seconds = orbits(integrator, n_steps, 0.8)
    assert sim.advance(seconds).n_substeps == n_steps
    angle = OMEGA * seconds
    x, v = np.array(START["x"]), np.array(START["v"])
    return np.abs(sim.x - (np.cos(angle) * x + np.sin(angle) * v / OMEGA)).max()


@uncompiled
@pytest.mark.parametrize(("integrator", "order"), [*zip(INTEGRATORS, (1, 2, 2), strict=True)])
def test_order(integrator, order):
    errors = [orbit_error(integrator, n) for n in (100, 200, 400)]
    found = np.log2(np.divide(errors[:-1], errors[1:]))
    assert found == pytest.approx([order, order], abs=0.06)


@uncompiled
@pytest.mark.parametrize("integrator", ["symplectic_euler", "kick_drift_kick"])
def test_symplectic_ones_keep_the_energy_for_ever(integrator):
    sim, seconds = orbits(integrator, 40)
    energies = []
    for _ in range(12):
        for _ in range(8):
            sim.advance(seconds / 8)
            numbers = sim.diagnostics()
            energies.append(numbers["kinetic_energy"] + numbers["potential_energy"])
    early, late = np.array(energies[:40]), np.array(energies[-40:])
    assert np.ptp(late) <= 1.02 * np.ptp(early)
    allowed = {"symplectic_euler": 0.2, "kick_drift_kick": 0.02}[integrator]
    assert np.ptp(energies) < allowed * early[0]


@uncompiled
@pytest.mark.parametrize("integrator", INTEGRATORS[1:])
def test_free_fall_is_exact_in_second_order(integrator):
    effects = Effects(gravity=(1.5, -9.81))
    sim = Simulation(cloud(x=[(0.0, 0.0)], v=[(3.0, 4.0)], effects=effects,
                           integrator=integrator))  # fmt: skip
    sim.controls = sim.controls._replace(dt=0.01)
    sim.advance(0.5)
    assert sim.x[0] == pytest.approx([1.5 + 1.5 / 8, 2.0 - 9.81 / 8], rel=1e-13)
    assert sim.v[0] == pytest.approx([3.75, 4.0 - 9.81 / 2], rel=1e-13)


@uncompiled
def test_kick_drift_kick_finds_its_way_back():
    water = Fluid(c0=C0, kernel="wendland_c2", clamp=False)
    sim = Simulation(cloud(fluid=water, integrator="kick_drift_kick"))
    x, v = sim.x, sim.v
    n, dt = 12, sim.controls.dt
    sim.advance(n * dt)
    assert np.abs(sim.x - x).max() > 0.1 * DX
    back = Simulation(cloud(fluid=water, integrator="kick_drift_kick", x=sim.x, v=-sim.v))
    back.advance(n * dt)
    assert_close(back.x, x, 1e-10)
    assert_close(back.v, -v, 1e-9)


@uncompiled
@pytest.mark.parametrize("integrator", INTEGRATORS[1:])
def test_another_xsph_control_counts_from_the_next_step_on(integrator):
    start = cloud(effects=Effects(xsph=True), integrator=integrator)
    changed, from_the_start = Simulation(start), Simulation(start)
    changed.controls = changed.controls._replace(xsph=0.0)
    changed.advance(changed.controls.dt)
    none = Simulation(cloud(integrator=integrator))
    none.advance(none.controls.dt)
    assert_close(changed.x, none.x, 1e-13)
    from_the_start.advance(none.controls.dt)
    assert np.abs(from_the_start.x - none.x).max() > 0.01 * DX * 0.01


@uncompiled
@integrators
def test_the_rates_of_a_state_are_those_of_its_stiffness(integrator):
    start = cloud(integrator=integrator)
    soft = Simulation(start)
    soft.controls = soft.controls._replace(stiffness=0.1 * STIFFNESS)
    soft.advance(soft.controls.dt)
    controls = Controls(soft.controls.dt, 0.1 * STIFFNESS, 0.0)
    twin = Simulation(cloud(integrator=integrator, controls=controls))
    twin.advance(twin.controls.dt)
    assert_close(soft.v, twin.v, 1e-13)


@uncompiled
@integrators
@pytest.mark.parametrize("field", FIELDS)
def test_cuts_leave_no_trace(field, integrator):
    effects = Effects(gravity=FIELDS[field], xsph=True, artificial_viscosity=0.3, continuity=True)
    start = cloud(
        n=3, walls=WALLS["extrapolated, some moving"], effects=effects, integrator=integrator
    )
    whole, cut, restored = (Simulation(start) for _ in range(3))
    for sim in (whole, cut, restored):
        sim.controls = sim.controls._replace(dt=2.0**-13)
    whole.advance(6 * 2.0**-13)
    for n in (1, 3, 2):
        cut.advance(n * 2.0**-13)
        restored.advance(n * 2.0**-13)
        snapshot = restored.snapshot()
        restored = Simulation(start)
        restored.restore(snapshot)
        assert_same(restored, cut)
    assert_same(cut, whole)
    assert_same(restored, whole)


@uncompiled
@integrators
def test_a_snapshot_at_any_time_is_bit_exact(integrator):
    """Where times round differently: nothing that moves may notice."""
    effects = Effects(gravity=FIELDS["shaken"])
    start = cloud(n=2, walls=WALLS["extrapolated, moving"], effects=effects, integrator=integrator)
    sim, twin = Simulation(start), Simulation(start)
    snapshot = sim.snapshot()
    sim.restore(snapshot | {"time": 5.37, "clock": 5.37})
    for k in range(12):
        sim.advance((2.3 + k / 3) * sim.controls.dt)
        twin.restore(sim.snapshot())
        assert_same(twin, sim)


# --- Cuts, compiled -------------------------------------------------------------------------

DT = 2.0**-13  # sums of which are exact


@everything
def test_a_run_that_is_cut_is_the_same_bit_by_bit(configuration):
    whole, cut = (simulation(configuration, speed=1.0) for _ in range(2))
    for sim in (whole, cut):
        sim.controls = sim.controls._replace(dt=DT)
    assert whole.advance(9 * DT).n_substeps == 9
    for n in (1, 5, 3):
        assert not cut.advance(n * DT).diverged
    assert_same(cut, whole)
    numbers = [sim.diagnostics() for sim in (cut, whole)]
    for some in numbers:
        # the work of a gravity that changes is found out a call at a time
        some.pop("energy_excess")
    assert numbers[0] == numbers[1]


@everything
def test_several_steps_are_those_of_the_naive_solver(configuration):
    sim = simulation(configuration)
    sim.controls = sim.controls._replace(dt=1e-4)
    naive = Naive(sim.scene, sim.controls)
    state = naive.start(np.asarray(sim.scene.x), np.asarray(sim.scene.v))
    for _ in range(5):
        state = naive.go_on(state, 1e-4)
    assert sim.advance(5e-4).n_substeps == 5
    assert_close(fluid(sim, "x"), state.x, 1e-10)
    assert_close(fluid(sim, "v"), state.v, 1e-10)
    assert_close(fluid(sim, "rho"), state.rho, 1e-10)
    assert_close(fluid(sim, "a"), naive.acceleration(*state[:2], state.time, state.rho), 1e-9)


@everything
def test_every_step_of_a_chunk_may_find_its_lists_too_short(configuration, monkeypatch):
    """They are cut to what the neighbours at the start need and a little more; more will come."""
    x = np.asarray(scene(configuration).x)
    v = -20.0 * (x - x.mean(axis=0))
    usual, cut = (simulation(configuration, v=v) for _ in range(2))
    rewind, found = cut.engine._rewind, set()

    def watched():
        found.add(int(cut.engine.world.status[0, STEPS]))
        return rewind()

    monkeypatch.setattr(cut.engine, "_rewind", watched)
    start = usual.snapshot()
    for room in range(0, 400, 2):
        for sim in (usual, cut):
            sim.restore(start)
        lists = cut.engine.world.cells.lists
        used = int(lists.groups.max())
        set_entries(cut.engine, lists.entries[: used + room].copy())
        for sim in (usual, cut):
            assert not sim.advance(2 * usual.controls.dt).diverged
        assert_same(cut, usual)
    assert found == {1, 2}


# --- How long a step may be -----------------------------------------------------------------


@pytest.mark.slow
@integrators
def test_a_viscous_flow_is_stable_at_the_stable_step_of_its_integrator(integrator):
    # where friction and waves limit the step alike: the predictor-corrector blew up within 3.6 s
    sim = Simulation(replace(scenes.make("poiseuille", dx=1 / 14), integrator=integrator))
    steps = round(4.0 / sim.stable_dt())
    assert not sim.advance(steps * sim.stable_dt()).diverged
    assert sim.diagnostics()["max_speed"] < 1.0


def growth(friction, wave):
    """Of the predictor-corrector for x'' = -wave^2 x - friction x', by a step of 1."""
    columns = []
    for x, u, a in np.eye(3):
        halfway = u + a / 2
        rate = -(wave**2) * (x + halfway / 2) - friction * halfway
        columns.append((x + u + rate / 2, u + rate, rate))
    return np.abs(np.linalg.eigvals(np.transpose(columns))).max()


def test_the_predictor_corrector_leaves_three_tenths_of_the_viscous_limit():
    share = VISCOUS_SHARES["predictor_corrector"]
    # five sixths of Euler's 2 over the rate of friction; 0.4 h/c is 0.9 over that of the waves
    assert growth(share * 2 * 5 / 6, 1e-3) < 1.0
    assert growth(share * 2 * 5 / 6, 0.9) < 1.0
    assert growth(0.7, 0.9) > 1.0
    assert growth(1.01, 1e-3) > 1.0
    euler, corrected = (
        scenes.make("poiseuille").viscous_share,
        replace(scenes.make("poiseuille"), integrator="predictor_corrector").viscous_share,
    )
    assert corrected == pytest.approx(share * euler)
