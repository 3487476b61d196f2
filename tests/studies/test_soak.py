import numpy as np
import pytest

import sph_gym
from sph_gym.studies import contract, soak
from sph_gym.studies.contract import PROMISES, ContractChecker
from sph_gym.studies.policies import HOSTILE

TANK = {"scene": "hydrostatic_tank", "dx": 0.06}
RECKLESS = np.array([1.0, 1.0, -1.0], np.float32)


def test_chunks_try_everything():
    plan = soak.chunks(soak.FULL)
    assert sum(chunk.steps for chunk in plan) >= soak.FULL
    assert {chunk.id for chunk in plan} == set(soak.IDS)
    assert {"sph_gym/Mixed-v1", "sph_gym/Benchmark-v1"} < set(soak.IDS)
    shown = {chunk.arguments.get("instances", "nominal") for chunk in plan}
    assert shown == {"nominal", "train", "ood"}
    for id_ in soak.IDS:
        own = [chunk for chunk in plan if chunk.id == id_]
        tried = {tuple(chunk.arguments.values())[:3] for chunk in own}
        assert tried == set(soak.VARIANTS)
        assert {chunk.coarser for chunk in own} == set(soak.COARSER)
        assert {chunk.n_envs for chunk in own} == {1, 8}
        assert {chunk.arguments["reward"] for chunk in own} == {"scalar", "vector"}
        assert {chunk.arguments["rate_limit"] for chunk in own} == {None, 2.5}


@pytest.mark.parametrize("n_envs", [1, 2])
@pytest.mark.parametrize("mode", ["absolute", "discrete"])
def test_all_is_well(n_envs, mode):
    arguments = {"action_mode": mode, "on_blowup": "rollback"}
    chunk = soak.Chunk("sph_gym/HydrostaticTank-v1", arguments, 2.0, n_envs, 150, seed=1)
    found = soak.play(chunk)
    assert found["violations"] == {}
    assert sum(found["policies"].values()) >= 150
    assert found["refused"] > 0


@pytest.mark.parametrize("name", HOSTILE)
def test_policies_stay_in_the_box(name):
    pushes = HOSTILE[name](np.random.default_rng(0))
    taken = np.array([next(pushes).copy() for _ in range(50)])
    assert taken.shape == (50, 3)
    assert np.abs(taken).max() <= 1


def watched(**more):
    env = sph_gym.TuningEnv(**TANK, **more)
    one = ContractChecker(env)
    one.began(*env.reset(seed=0))
    one.before()
    return env, one


def spoil(result, **info):
    observation, reward, terminated, truncated, told = result
    return observation, reward, terminated, truncated, told | info


def test_blowups_and_rollbacks_are_counted():
    env, one = watched(on_blowup="rollback")
    while not env.episode.over:
        one.before()
        one.after(*env.step(RECKLESS))
    assert not one.violations
    assert one.rolled_back == 3
    assert one.blowups.total() >= 4


@pytest.mark.parametrize(
    ("promise", "wrong"),
    [
        (contract.INFOS, {"work": 1}),
        (contract.INFOS, {"luck": 1.0}),
        (contract.INFOS, {"work": np.nan}),
        (contract.REWARD, {"reward_work": 0.123}),
        (contract.BLOWUP, {"blowup": 1.0}),
        (contract.BLOWUP, {"blowup_cause": "cfl"}),
        (contract.BLOWUP, {"time_to_failure": 0.1}),
        (contract.ROLLBACK, {"rollbacks": 1.0}),
    ],
)
def test_a_lie_in_the_info_is_found(promise, wrong):
    env, one = watched()
    one.after(*spoil(env.step(np.zeros(3)), **wrong))
    assert one.violations[promise] >= 1
    assert promise in PROMISES
    assert one.examples


def test_what_else_is_wrong_is_found():
    env, one = watched()
    observation, reward, _, truncated, info = env.step(np.zeros(3))
    for wrong in (np.full_like(observation, np.nan), observation[:3], 2 + observation):
        one.after(wrong, reward, False, truncated, info)
    assert one.violations[contract.OBSERVATION] == 3
    one.after(observation, np.inf, False, truncated, info)
    assert one.violations[contract.REWARD] == 1
    one.after(observation, reward, True, truncated, info)
    assert one.violations[contract.BLOWUP] == 1
    env.sim.engine.fluid.u[3] = np.nan
    one.after(observation, reward, False, truncated, info)
    assert one.violations[contract.STATE] == 1


def test_a_rollback_that_goes_elsewhere_is_found():
    env, one = watched(on_blowup="rollback")
    blowup = False
    while not blowup:
        one.before()
        result = env.step(RECKLESS)
        blowup = result[-1]["blowup"] == 1.0
        if blowup:
            env.sim.engine.fluid.x[0] += 1e-6
        one.after(*result)
    assert set(one.violations) == {contract.ROLLBACK}


def test_an_action_that_is_taken_for_one_is_found(monkeypatch):
    _, one = watched()
    monkeypatch.setattr(contract, "NO_VECTORS", ([0.0, 0.0, 0.0],))
    one.try_nonsense(0)
    assert one.violations[contract.REFUSED] == 1
    assert one.refused == 0


def test_rows_and_finished_chunks(tmp_path, monkeypatch):
    few = soak.chunks(0)[-2:]
    few = [chunk._replace(steps=8) for chunk in few]
    monkeypatch.setattr(soak, "chunks", lambda wanted: few)
    monkeypatch.setattr(soak, "QUICK", 16)
    first = list(soak.measure(True, tmp_path))
    monkeypatch.setattr(soak, "play", lambda chunk: pytest.fail("played twice"))
    again = list(soak.measure(True, tmp_path))
    assert again == first
    assert all(row.holds for row in first)
    bounded = {row.case: row.bound for row in first if row.quantity == "violations"}
    assert bounded == dict.fromkeys(PROMISES, 0)
    found = {
        "seconds": 1.0, "violations": {PROMISES[0]: 1}, "blowups": {},
        "policies": {"uniform": 8}, "rollbacks": 0, "refused": 0, "examples": [],
    }  # fmt: skip
    failed = [row for row in soak.rows([(few[0], found)], 9) if not row.holds]
    assert [(row.quantity, row.value) for row in failed] == [("steps", 8), ("violations", 1)]
