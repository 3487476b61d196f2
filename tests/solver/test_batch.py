"""Many simulations at once do what each would have done alone, to the last bit."""

import copy
import itertools
import pickle

import numpy as np
import pytest
from numba.core import config

from sph_gym import Controls, advance_all
from sph_gym.solver.batch import _bounds
from tests.cases import STIFFNESS, scene, set_entries, simulation, square
from tests.solver.test_simulation import assert_same


def some(dtype="float64", n=5):
    """Clouds that differ in everything but their effects."""
    return [
        simulation("everything", "jittered", dtype, speed=0.3 + 0.1 * seed, seed=seed)
        for seed in range(n)
    ]


def assert_all_same(together, alone):
    for one, other in zip(together, alone, strict=True):
        assert_same(one, other)
        assert one.time == other.time
        assert one.last_report == other.last_report
        assert one.diagnostics() == other.diagnostics()


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("threads", [1, 2, 3])
def test_together_as_alone(dtype, threads):
    together, alone = some(dtype), some(dtype)
    for seconds in (7e-3, 1e-4, 2.5e-2):
        reports = advance_all(together, seconds, threads=threads)
        assert reports == [sim.advance(seconds) for sim in alone]
        for k, (one, other) in enumerate(zip(together, alone, strict=True)):
            one.controls = other.controls = one.controls._replace(
                stiffness=(0.5 + 0.2 * k) * STIFFNESS, xsph=0.1 * k
            )
    assert_all_same(together, alone)


def test_every_thread_gets_its_share():
    assert _bounds(np.full(8, 20), 1).tolist() == [0, 8]
    assert _bounds(np.full(8, 20), 2).tolist() == [0, 4, 8]
    assert _bounds(np.full(9, 20), 3).tolist() == [0, 3, 6, 9]
    assert _bounds(np.array([1, 1, 1, 100]), 2).tolist() == [0, 3, 4]
    rng = np.random.default_rng(0)
    for n_threads in (2, 3, 4):
        work = rng.integers(1, 100, 20)
        bounds = _bounds(work, n_threads)
        shares = [work[a:b].sum() for a, b in itertools.pairwise(bounds)]
        assert np.abs(np.array(shares) - work.sum() / n_threads).max() <= work.max()


def mixed():
    return [
        simulation("none", speed=0.3),
        simulation("everything", speed=0.3),
        simulation("none", dtype="float32", speed=0.3),
        simulation("everything", neighbors="brute", x=square()[:40], v=None),
        simulation("none", "lattice 3", speed=0.2),
        # uncompiled it would only take its time
        *([] if config.DISABLE_JIT else [simulation("all, predictor", speed=0.3)]),
    ]


@pytest.mark.without_jit
def test_simulations_of_all_kinds():
    together, alone = mixed(), mixed()
    # few steps: uncompiled, this is a loop over pairs
    seconds = 2 * alone[0].controls.dt
    assert advance_all(together, seconds) == [sim.advance(seconds) for sim in alone]
    assert_all_same(together, alone)


def test_one_that_blows_up_leaves_the_others_alone():
    together, alone = some(), some()
    for sims in (together, alone):
        sims[2].controls = Controls(1.0, 1e4 * STIFFNESS, 0.0)
    reports = advance_all(together, 2e-2)
    assert reports == [sim.advance(2e-2) for sim in alone]
    assert [report.diverged for report in reports] == [k == 2 for k in range(5)]
    assert_all_same(together, alone)


def test_lists_grow():
    alone, together = some(), some()
    for sim in together:
        set_entries(sim.engine, np.zeros(64, np.int32))
        sim.engine.renew(sim.time)
    advance_all(together, 1e-2)
    for sim in alone:
        sim.advance(1e-2)
    assert_all_same(together, alone)


@pytest.mark.without_jit
def test_nothing_to_do():
    assert advance_all([], 1.0) == []


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda sims: pickle.loads(pickle.dumps(sims))])
def test_copies_go_on_with_arrays_of_their_own(copied):
    together, alone = some(n=2), some(n=2)
    advance_all(together, 1e-3)
    twins = copied(together)
    assert_all_same(twins, together)
    advance_all(twins, 1e-3)
    for sim in alone:
        sim.advance(1e-3)
    assert_all_same(together, alone)
    del together
    advance_all(twins, 1e-3)
    for sim in alone:
        sim.advance(1e-3)
        sim.advance(1e-3)
    assert_all_same(twins, alone)


@pytest.mark.without_jit
def test_wrong_input_is_named():
    sim = simulation("none")
    with pytest.raises(ValueError, match="twice"):
        advance_all([sim, sim], 1e-3)
    with pytest.raises(ValueError, match="Simulation"):
        advance_all([scene()], 1e-3)
    with pytest.raises(ValueError, match="threads"):
        advance_all([sim], 1e-3, threads=0)
    with pytest.raises(ValueError, match="seconds"):
        advance_all([sim], -1.0)
    assert sim.time == 0.0


def test_ctrl_c_leaves_all_in_a_state_to_go_on_from(monkeypatch):
    from sph_gym.solver import batch

    together, alone = some(), some()
    run = batch.teams.run

    def interrupted(*arguments):
        monkeypatch.undo()  # it is pressed once
        run(*arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr(batch.teams, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        advance_all(together, 1e-4)
    for sim in alone:
        sim.advance(1e-4)
    for one, other in zip(together, alone, strict=True):
        assert one.time == pytest.approx(other.time)
        assert (one.x == other.x).all()
