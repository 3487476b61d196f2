"""Threads: the same result bit by bit for any number of them, nobody hangs, nobody waits busily."""

import os
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest

from sph_gym import Simulation, scenes
from sph_gym.solver import engine, simulation, stepping, teams
from sph_gym.solver.jit import jit
from tests.cases import (
    STIFFNESS,
    WATER,
    assert_close,
    configurations,
    fluid,
    scene,
    set_entries,
)
from tests.naive import Naive
from tests.solver.test_simulation import FIELDS, assert_same

ROOT = Path(__file__).parents[2]
CHOOSE = teams.Pace.choose
NUMBERS = (1, 2, 3, 4)
several_numbers = pytest.mark.parametrize("n_threads", NUMBERS[1:])
kinds = pytest.mark.parametrize(
    ("dtype", "neighbors"), [("float64", "grid"), ("float32", "grid"), ("float64", "brute")]
)
compiled = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")


@pytest.fixture(autouse=True)
def _eager(monkeypatch):
    """Even the smallest cloud and the shortest call are worth several threads."""
    monkeypatch.setattr(engine, "PARTICLES_PER_THREAD", 16)
    monkeypatch.setattr(engine, "WORTH_WAKING", 1)
    monkeypatch.setattr(simulation, "DEFAULT_PER_THREAD", 16)
    monkeypatch.setattr(teams.Pace, "choose", lambda pace, most: most)


def simulate(n_threads, dtype="float64", neighbors="grid", configuration="everything", **changes):
    return Simulation(
        scene(configuration, dtype=dtype, **changes), dtype, neighbors, threads=n_threads
    )


def go_on(sim):
    """Several calls with other controls in between; their reports."""
    reports = [sim.advance(3 * sim.controls.dt)]
    sim.controls = sim.controls._replace(stiffness=0.6 * STIFFNESS, xsph=0.1)
    reports.append(sim.advance(5 * sim.controls.dt))
    sim.controls = sim.controls._replace(dt=0.3 * sim.controls.dt)
    reports.append(sim.advance(4 * sim.controls.dt))
    return reports


def threads_of(sim):
    """The most that a simulation uses."""
    return len(sim.engine.world.status)


# --- The same result ------------------------------------------------------------------------


@kinds
@pytest.mark.parametrize("configuration", ["everything", "none"])
def test_any_number_of_threads_gives_the_same_bit_by_bit(configuration, dtype, neighbors):
    single, *others = (simulate(n, dtype, neighbors, configuration, speed=0.5) for n in NUMBERS)
    reports = go_on(single)
    assert not any(report.diverged for report in reports)
    for n, sim in zip(NUMBERS[1:], others, strict=True):
        assert go_on(sim) == reports
        assert threads_of(sim) == n
        assert_same(sim, single)
        assert sim.diagnostics() == single.diagnostics()
        assert (sim.neighbor_counts == single.neighbor_counts).all()


@compiled
@configurations
def test_so_it_does_where_walls_move_or_space_closes(configuration, dtype):
    """Neighbours twice in a step, walls that wait for the fluid, and lists that grow."""
    single, several, cut = (
        simulate(n, dtype, configuration=configuration, speed=0.5) for n in (1, 3, 3)
    )
    cut_lists(cut)
    reports = go_on(single)
    assert not any(report.diverged for report in reports)
    for sim in (several, cut):
        assert go_on(sim) == reports
        assert_same(sim, single)
        assert sim.diagnostics() == single.diagnostics()


@compiled
@pytest.mark.parametrize("configuration", ["all, euler", "all, kick", "all, predictor"])
def test_changing_numbers_of_threads_do_not_matter_there_either(configuration, monkeypatch):
    single, changing = (simulate(n, configuration=configuration, speed=0.5) for n in (1, 3))
    for k in range(6):
        monkeypatch.setattr(engine, "WORTH_WAKING", 1 if k % 2 else 10**9)
        for sim in (single, changing):
            sim.advance(2.2 * sim.controls.dt)
        assert_same(changing, single)


@several_numbers
@pytest.mark.parametrize("cloud", ["coincident", "overlapping", "disordered"])
def test_on_nasty_clouds_too(cloud, n_threads):
    single, several = (simulate(n, cloud=cloud) for n in (1, n_threads))
    for sim in (single, several):
        sim.controls = sim.controls._replace(dt=1e-6)
        sim.advance(5e-6)
    assert_same(several, single)


def test_a_scene_of_usual_size_is_the_same_too(monkeypatch):
    monkeypatch.undo()
    single, double = (Simulation(scenes.make("dam_break", dx=0.03), threads=n) for n in (1, 2))
    assert (threads_of(single), threads_of(double)) == (1, 2)
    assert single.advance(0.1) == double.advance(0.1)
    assert_same(double, single)


@several_numbers
@kinds
@pytest.mark.parametrize("too", ["long", "stiff"])
def test_reports_of_a_blow_up_are_the_same(too, dtype, neighbors, n_threads):
    single, several = (simulate(n, dtype, neighbors) for n in (1, n_threads))
    for sim in (single, several):
        if too == "long":
            sim.controls = sim.controls._replace(dt=20 * sim.controls.dt)
        else:
            sim.controls = sim.controls._replace(stiffness=1e4 * STIFFNESS)
        sim.advance(50 * sim.controls.dt)
    assert single.last_report.diverged
    assert several.last_report == single.last_report
    assert_same(several, single)


def test_changing_numbers_of_threads_make_no_difference(monkeypatch):
    single, changing = simulate(1), simulate(3)
    for k in range(6):
        # between two calls that wake them the others sleep
        monkeypatch.setattr(engine, "WORTH_WAKING", 1 if k % 2 else 10**9)
        for sim in (single, changing):
            sim.advance(2 * sim.controls.dt)
        assert_same(changing, single)


@kinds
def test_going_on_from_a_snapshot_is_bit_exact(dtype, neighbors):
    sim, twin = (simulate(2, dtype, neighbors) for _ in range(2))
    sim.advance(4 * sim.controls.dt)
    snapshot = sim.snapshot()
    go_on(sim)
    twin.restore(snapshot)
    go_on(twin)
    assert_same(twin, sim)
    sim.restore(snapshot)
    go_on(sim)
    assert_same(sim, twin)


def test_two_simulations_at_once_are_two_one_after_the_other():
    alone, together = ([simulate(2, seed=seed, speed=0.5) for seed in range(3)] for _ in range(2))
    for sim in alone:
        for _ in range(30):
            sim.advance(2 * sim.controls.dt)
    begin, failed = threading.Barrier(len(together)), []

    def run(sim):
        try:
            begin.wait()
            for _ in range(30):
                sim.advance(2 * sim.controls.dt)
        except BaseException as error:
            failed.append(error)

    workers = [threading.Thread(target=run, args=(sim,)) for sim in together]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert not failed
    for sim, same in zip(together, alone, strict=True):
        assert_same(sim, same)


# --- How many -------------------------------------------------------------------------------


@pytest.mark.without_jit
@pytest.mark.parametrize("threads", [0, -1, 1.5, "2", float("nan"), float("inf"), True])
def test_an_impossible_number_of_threads_is_named(threads):
    with pytest.raises(ValueError, match="threads"):
        Simulation(scene(), threads=threads)


@compiled
@pytest.mark.parametrize(
    ("cpus", "limit", "expected"), [({0}, 8, 1), ({1, 5}, 8, 2), (set(range(7)), 3, 3)]
)
def test_the_default_is_what_the_process_may_use(cpus, limit, expected, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: cpus, raising=False)
    monkeypatch.setattr(numba.config, "NUMBA_NUM_THREADS", limit)
    assert teams.most_threads() == expected
    assert threads_of(simulate(None)) == expected


@compiled
@pytest.mark.parametrize(("cpus", "expected"), [(5, 5), (None, 1)])
def test_without_affinities_it_is_the_number_of_cpus(cpus, expected, monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: cpus)
    monkeypatch.setattr(numba.config, "NUMBA_NUM_THREADS", 64)
    assert teams.most_threads() == expected


def paced(pace, seconds_of):
    """The numbers of threads of ten calls, each taking as long as its number of threads says."""
    numbers = []
    for _ in range(10):
        numbers.append(CHOOSE(pace, 2))
        pace.note(numbers[-1], 1000, seconds_of[numbers[-1]])
    return numbers


@pytest.mark.without_jit
def test_a_team_that_pays_is_kept():
    assert paced(teams.Pace(), {1: 1.0, 2: 0.6}) == [1] + 9 * [2]


@pytest.mark.without_jit
def test_a_team_that_is_slower_is_tried_ever_more_rarely():
    pace = teams.Pace()
    assert paced(pace, {1: 1.0, 2: 3.0}) == [1, 2, 1, 2, 1, 1, 2, 1, 1, 1]
    assert paced(pace, {1: 1.0, 2: 0.5}) == [1] + 9 * [2]


@pytest.mark.without_jit
def test_a_call_without_steps_says_nothing_about_the_pace():
    pace = teams.Pace()
    pace.note(1, 0, 5.0)
    assert CHOOSE(pace, 2) == 1


@pytest.mark.without_jit
def test_a_small_cloud_has_one_thread(monkeypatch):
    monkeypatch.undo()
    assert len(scene().x) < engine.PARTICLES_PER_THREAD
    assert threads_of(simulate(4)) == 1


# --- Failures -------------------------------------------------------------------------------


@jit
def wait_for_all(team, n_threads):
    return teams.meet(team, n_threads)


@compiled
@several_numbers
def test_all_meet(n_threads):
    team, met = teams.make_team(), []

    def meet_often(rank, n):
        met.append(all(wait_for_all(team, n) for _ in range(50)))

    teams.run(meet_often, n_threads, team)
    assert met == [True] * n_threads


@compiled
@several_numbers
@pytest.mark.parametrize("failing", [0, 1])
def test_when_one_fails_nobody_waits_for_it(failing, n_threads):
    team, met = teams.make_team(), []

    def fail(rank, n):
        if rank == failing:
            raise ArithmeticError(f"rank {rank}")
        met.append(wait_for_all(team, n))

    with pytest.raises(ArithmeticError, match=f"rank {failing}"):
        teams.run(fail, n_threads, team)
    assert met == [False] * (n_threads - 1)
    # and the pool is as good as new
    single, several = simulate(1), simulate(n_threads)
    assert go_on(several) == go_on(single)
    assert_same(several, single)


def test_one_that_fails_while_the_first_has_already_finished():
    def fail(rank, n):
        if rank == 1:
            time.sleep(0.05)
            raise ArithmeticError("late")

    with pytest.raises(ArithmeticError, match="late"):
        teams.run(fail, 2, teams.make_team())


def interrupt(monkeypatch, after, late=False):
    """Ctrl-C in the first thread at its call number `after`, when that is over if it is `late`."""
    advance, calls = stepping.advance, iter([*[False] * after, True])

    def interrupted(rank, *arguments):
        now = rank == 0 and next(calls, False)
        if late or not now:
            advance(rank, *arguments)
        if now:
            raise KeyboardInterrupt

    monkeypatch.setattr(stepping, "advance", interrupted)


def assert_consistent(sim):
    """Fields belong to the positions."""
    naive = Naive(sim.scene, sim.controls)
    x, v = fluid(sim, "x"), fluid(sim, "v")
    assert_close(sim.rho, naive.density(x), 1e-10)
    assert_close(fluid(sim, "a"), naive.acceleration(x, v, sim.time), 1e-10)


@compiled
@pytest.mark.parametrize("late", [False, True])
@several_numbers
def test_an_interrupted_team_leaves_a_state_to_go_on_from(n_threads, late):
    single, broken = simulate(1), simulate(n_threads)
    dt = single.controls.dt / 10
    for sim in (single, broken):
        sim.controls = sim.controls._replace(dt=dt)
        sim.advance(3 * dt)
    with pytest.MonkeyPatch.context() as patch:
        interrupt(patch, after=0, late=late)
        with pytest.raises(KeyboardInterrupt):
            broken.advance(5 * dt)
    assert broken.time == pytest.approx(8 * dt if late else 3 * dt)
    assert broken.last_report.n_substeps == (5 if late else 0)
    assert_consistent(broken)
    broken.advance(10 * dt - broken.time)
    single.advance(7 * dt)
    assert_close(fluid(broken, "x"), fluid(single, "x"), 1e-10)
    assert_close(fluid(broken, "v"), fluid(single, "v"), 1e-10)


FORK = """
import os, signal
from sph_gym import Simulation
from sph_gym.solver import engine
from tests.cases import scene

engine.PARTICLES_PER_THREAD, engine.WORTH_WAKING = 16, 1
sim, twin = (Simulation(scene("everything"), threads=2) for _ in range(2))
for each in (sim, twin):
    each.advance(3 * each.controls.dt)
twin.advance(4 * twin.controls.dt)
child = os.fork()
if child == 0:
    signal.alarm(60)
    sim.advance(4 * sim.controls.dt)
    os._exit(0 if (sim.x == twin.x).all() and sim.time == twin.time else 1)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
sim.advance(4 * sim.controls.dt)
assert (sim.x == twin.x).all()
"""


@compiled
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this platform")
def test_a_forked_process_has_threads_of_its_own():
    done = subprocess.run(
        [sys.executable, "-c", FORK], cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr[-2000:]


@compiled
def test_nobody_waits_busily_between_two_calls():
    sim = simulate(2)
    sim.advance(5 * sim.controls.dt)
    before = time.process_time()
    time.sleep(0.5)
    assert time.process_time() - before < 0.1


# --- Lists that grow ------------------------------------------------------------------------


def cut_lists(sim):
    """Leave no more of the lists than the present neighbours need."""
    lists = sim.engine.world.cells.lists
    set_entries(sim.engine, lists.entries[: int(lists.groups.max())].copy())


@compiled
@pytest.mark.parametrize("n_threads", NUMBERS)
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_lists_that_are_too_short_grow_and_nobody_notices(dtype, n_threads, monkeypatch):
    usual = simulate(1, dtype)
    reports = go_on(usual)
    make_lists = engine.make_lists

    def make_tiny_lists(*arguments):
        return make_lists(*arguments)._replace(entries=np.zeros(64, np.int32))

    monkeypatch.setattr(engine, "make_lists", make_tiny_lists)
    sim = simulate(n_threads, dtype)
    assert sim.engine.world.cells.lists.entries.size > 64
    assert go_on(sim) == reports
    assert_same(sim, usual)


@compiled
def test_a_first_guess_of_nothing_is_enough(monkeypatch):
    usual = simulate(1)
    monkeypatch.setattr(engine, "ENTRIES_PER_GROUP", 0)
    sim = simulate(2)
    assert go_on(sim) == go_on(usual)
    assert_same(sim, usual)


@compiled
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_lists_grow_in_the_middle_of_a_call(dtype):
    usual, cut = simulate(1, dtype), simulate(1, dtype)
    cut_lists(cut)
    before = cut.engine.world.cells.lists.entries.size
    assert go_on(cut) == go_on(usual)
    assert cut.engine.world.cells.lists.entries.size > before
    assert_same(cut, usual)


@compiled
@pytest.mark.parametrize("late", [False, True])
def test_an_interrupt_after_lists_have_grown_leaves_the_clock_right(late):
    usual, broken = simulate(1), simulate(1)
    dt = usual.controls.dt / 10
    for sim in (usual, broken):
        sim.controls = sim.controls._replace(dt=dt)
    cut_lists(broken)
    with pytest.MonkeyPatch.context() as patch:
        # the first call finds the lists too short
        interrupt(patch, after=1, late=late)
        with pytest.raises(KeyboardInterrupt):
            broken.advance(4 * dt)
    # a chunk whose lists were too short is as if it had not begun
    if late:
        usual.advance(4 * dt)
    assert_close(fluid(broken, "x"), fluid(usual, "x"), 1e-12)
    assert broken.time == pytest.approx(usual.time)
    assert_consistent(broken)


# --- Extreme clouds -------------------------------------------------------------------------


def assert_like_brute_force(**changes):
    """Grid on one and on three threads, before and after two steps."""
    brute = simulate(1, neighbors="brute", **changes)
    grids = [simulate(n, **changes) for n in (1, 3)]
    for _ in range(2):
        for grid in grids:
            assert_same(grid, grids[0])
            assert (grid.neighbor_counts == brute.neighbor_counts).all()
            for field in FIELDS:
                expected = getattr(brute, field)
                assert_close(getattr(grid, field), expected, 1e-12, at_least=9.81)
        for sim in (brute, *grids):
            assert not sim.advance(2 * sim.controls.dt).diverged


@compiled
@pytest.mark.parametrize("far", [1e4, 1e15, 3e15, 1e18, 1e25, 1e100])
@pytest.mark.parametrize("where", [(1, 0), (0, -1), (-1, -1), (1, 1)])
def test_particles_far_outside_are_handled(where, far):
    start = scene("none", speed=0.5)
    strays = np.array([far, far, 1.5 * far])[:, None] * where
    x = np.concatenate([np.asarray(start.x), strays])
    v = np.concatenate([np.asarray(start.v), np.zeros((3, 2))])
    assert_like_brute_force(configuration="none", x=x, v=v)


@compiled
@pytest.mark.slow
def test_a_crowd_in_one_point():
    n = 300
    v = np.random.default_rng(0).normal(0.0, 0.1, (n, 2))
    # Tait's pressure at so many times the rest density would tear it apart at any step
    water = replace(WATER, gamma=1.0)
    changes = {"x": np.full((n, 2), 0.1), "v": v, "fluid": water}
    sim = simulate(2, **changes)
    assert (sim.neighbor_counts >= n - 1).all()
    naive = Naive(sim.scene, sim.controls)
    rho = naive.density(np.asarray(sim.scene.x))
    assert_close(sim.rho, rho, 1e-10)
    expected = naive.acceleration(np.asarray(sim.scene.x), v, 0.0)
    assert_close(fluid(sim, "a"), expected, 1e-10, at_least=9.81)
    single = simulate(1, **changes)
    for each in (sim, single):
        each.controls = each.controls._replace(dt=1e-9)
        assert not each.advance(5e-9).diverged
    assert_same(sim, single)
