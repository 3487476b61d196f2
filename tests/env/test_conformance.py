"""Every id and every kind of argument keeps the contracts of Gymnasium and Stable-Baselines3."""

import copy
import itertools
import os
import pickle
import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils import performance
from gymnasium.utils.env_checker import check_env
from gymnasium.utils.env_match import check_environments_match
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from sph_gym import scenes
from sph_gym.env import SCENES, env_id
from sph_gym.env.vector import TuningVectorEnv
from tests.pairwise import pairwise

CUSTOM = env_id("custom")
FACTORS = {
    "id": [*map(env_id, (*SCENES, "mixed", "benchmark")), CUSTOM],
    "action_mode": ["absolute", "stable", "delta", "discrete"],
    "render_mode": [None, "rgb_array", "human"],
    "on_blowup": ["terminate", "rollback"],
    "observation": ["features", "field", "features+context"],
    "reward": ["scalar", "vector"],
    "rate_limit": [None, 2.0],
    "instances": ["nominal", "val"],
    "reward_weights": [None, {"work": 2.0, "blowup": 0.1}],
    "tolerances": [None, {"com_drift": 2.0}],
    "dx": [0.06, 0.08],
}


ROWS = pairwise(FACTORS)


def make(row):
    row = dict(row)
    id_ = row.pop("id")
    if id_ == CUSTOM:
        dx = row.pop("dx")
        row = {"scene": scenes.make("drop_impact", dx=dx), **row, "instances": "nominal"}
    return gym.make(id_, **row).unwrapped


def test_all_pairs_are_there():
    assert len(ROWS) < 60
    for one, other in itertools.combinations(FACTORS, 2):
        found = {(str(row[one]), str(row[other])) for row in ROWS}
        assert len(found) == len(FACTORS[one]) * len(FACTORS[other])


@pytest.mark.every(3)
@pytest.mark.parametrize("row", ROWS, ids=lambda row: "-".join(map(str, row.values())))
def test_gymnasium_and_sb3_have_no_complaints(row, monkeypatch):
    sb3 = pytest.importorskip("stable_baselines3.common.env_checker")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = make(row)
    if row["reward"] == "vector":
        # neither knows vectors: as somebody would who weighs the terms
        step = env.step
        monkeypatch.setattr(env, "step", lambda action: summed(*step(action)), raising=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # what is rendered doesn't depend on the rest, and opening windows takes time
        check_env(env, skip_render_check=row["render_mode"] is None)
        sb3.check_env(env, skip_render_check=True)
    env.close()


def summed(observation, reward, *rest):
    assert reward.dtype == np.float32
    return observation, float(reward.sum()), *rest


# --- Gymnasium's own comparisons and benchmarks ---------------------------------------------

WRAPPERS = [
    lambda env: env.unwrapped,
    lambda env: gym.wrappers.TimeLimit(env, 1000),
    lambda env: gym.wrappers.RecordEpisodeStatistics(gym.wrappers.Autoreset(env)),
    lambda env: pickle.loads(pickle.dumps(env)),
]


@pytest.mark.parametrize("wrap", WRAPPERS, ids=["bare", "limit", "statistics", "pickled"])
@pytest.mark.parametrize("mode", ["absolute", "discrete"])
def test_an_environment_matches_itself_under_wrappers(wrap, mode):
    one, other = (
        gym.make(env_id("drop_impact"), dx=0.08, instances="val", action_mode=mode)
        for _ in range(2)
    )
    # statistics add entries to the info of the last step
    check_environments_match(one, wrap(other), 60, seed=4, info_comparison="superset")


@pytest.mark.parametrize("name", [*SCENES, "mixed", "benchmark"])
def test_every_id_matches_itself(name):
    one, other = (gym.make(env_id(name), dx=0.08) for _ in range(2))
    check_environments_match(one, other, 10, seed=1)


def test_environments_with_other_flows_do_not_match():
    one, other = (gym.make(env_id("drop_impact"), dx=dx) for dx in (0.08, 0.09))
    with pytest.raises(AssertionError, match="is not equivalent"):
        check_environments_match(one, other, 3)


class FirstOf(gym.Env):
    """The first environment of a vector, as if it were a single one."""

    def __init__(self, envs):
        self.envs, self.render_mode = envs, envs.render_mode
        self.action_space = envs.single_action_space
        self.observation_space = envs.single_observation_space

    def reset(self, *, seed=None, options=None):
        observations, infos = self.envs.reset(seed=seed, options=options)
        return observations[0], self.first(infos)

    def step(self, action):
        actions = np.stack([action] * self.envs.num_envs)
        observations, rewards, terminated, truncated, infos = self.envs.step(actions)
        ends = bool(terminated[0]), bool(truncated[0])
        return observations[0], float(rewards[0]), *ends, self.first(infos)

    def render(self):
        return self.envs.render()[0]

    @staticmethod
    def first(infos):
        """The entries of a single environment, without the masks."""
        found = {key: value[0] for key, value in infos.items() if f"_{key}" in infos}
        return {key: one if isinstance(one, str) else float(one) for key, one in found.items()}


@pytest.mark.parametrize("render_mode", [None, "rgb_array"])
@pytest.mark.parametrize("num_envs", [1, 2])
def test_the_vector_entry_matches_the_single_one(num_envs, render_mode):
    arguments = {"dx": 0.08, "instances": "val", "render_mode": render_mode}
    single = gym.make(env_id("drop_impact"), **arguments)
    envs = gym.make_vec(env_id("drop_impact"), num_envs, **arguments)
    # over the end of an episode
    n_steps = 120 if render_mode is None else 4
    check_environments_match(single, FirstOf(envs), n_steps, seed=2)


@pytest.mark.skipif(
    not hasattr(performance, "benchmark_vector_step"), reason="came with Gymnasium 1.3"
)
@pytest.mark.parametrize("autoreset_mode", gym.vector.AutoresetMode)
def test_the_vector_runs_in_gymnasiums_benchmark(autoreset_mode, monkeypatch):
    """It counts steps of single environments per second, here of a clock that ticks by itself."""
    seconds = itertools.count()
    monkeypatch.setattr(performance.time, "time", lambda: float(next(seconds)))
    envs = gym.make_vec(
        env_id("drop_impact"), 3, dx=0.08, instances="val", max_episode_steps=5,
        autoreset_mode=autoreset_mode,
    )  # fmt: skip
    n_calls = 20
    rate = performance.benchmark_vector_step(envs, target_duration=n_calls - 1, seed=0)
    # every sixth call resets all three in the mode that takes a step for it
    waits = n_calls // 6 if autoreset_mode == gym.vector.AutoresetMode.NEXT_STEP else 0
    assert rate * n_calls == pytest.approx(envs.num_envs * (n_calls - waits))


# --- Copies ---------------------------------------------------------------------------------

COPIED = [
    {"on_blowup": "rollback"},
    {"action_mode": "delta", "observation": "field", "reward": "vector"},
    {"action_mode": "discrete", "rate_limit": 2.0, "render_mode": "human"},
]


def play(env, n_steps):
    """Everything that is returned, across resets."""
    trace = []
    for _ in range(n_steps):
        result = env.step(env.action_space.sample())
        trace.append(result)
        if isinstance(env, gym.Env) and (result[2] or result[3]):
            trace.append(env.reset())
    return trace


def assert_same(one, other):
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert set(one) == set(other)
        for key in one:
            assert_same(one[key], other[key])
    elif isinstance(one, (list, tuple)):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            assert_same(a, b)
    elif isinstance(one, np.ndarray) and one.dtype == object:
        assert_same(one.tolist(), other.tolist())
    else:
        assert np.array_equal(one, other)


@pytest.mark.every(3)
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
@pytest.mark.parametrize("arguments", COPIED, ids=str)
def test_a_copy_in_mid_episode_goes_on_alike(arguments, copied, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = make({"id": "sph_gym/Mixed-v1", "dx": 0.08, **arguments})
    env.reset(seed=2)
    env.action_space.seed(3)
    play(env, 7)
    twin = copied(env)
    # a window keeps to real time; without one, far enough to draw another scene
    n_steps = 5 if env.render_mode == "human" else 150
    assert_same(play(env, n_steps), play(twin, n_steps))
    for one in (env, twin):
        one.close()


def test_a_copy_of_an_environment_with_a_picture_paints_the_same(monkeypatch):
    env = gym.make("sph_gym/DropImpact-v1", dx=0.08, render_mode="rgb_array").unwrapped
    env.reset(seed=0)
    picture = env.render()
    for twin in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        assert np.array_equal(twin.render(), picture)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_of_a_vector_goes_on_alike(copied):
    envs = TuningVectorEnv(2, scene="drop_impact", dx=0.08, max_episode_steps=9)
    envs.reset(seed=2)
    envs.action_space.seed(3)
    play(envs, 4)
    twin = copied(envs)
    assert_same(play(envs, 12), play(twin, 12))


# --- Processes ------------------------------------------------------------------------------


def one_of_many():
    return gym.make("sph_gym/Mixed-v1", dx=0.08, action_mode="delta", max_episode_steps=12)


@pytest.mark.parametrize("context", ["spawn", "forkserver"])
def test_processes_of_their_own_change_nothing(context):
    ours = SyncVectorEnv([one_of_many] * 2)
    theirs = AsyncVectorEnv([one_of_many] * 2, context=context)
    try:
        assert_same(ours.reset(seed=5), theirs.reset(seed=5))
        ours.action_space.seed(1)
        for _ in range(30):
            actions = ours.action_space.sample()
            assert_same(ours.step(actions), theirs.step(actions))
    finally:
        theirs.close()


@pytest.mark.slow
@pytest.mark.skipif(os.cpu_count() == 1, reason="needs a second processor")
def test_long_rollouts_are_equal_to_the_last_bit_in_other_processes_with_other_threads():
    hashes = []
    for threads in ("1", "2"):
        run = subprocess.run(
            [sys.executable, "-m", "tests.env.rollouts", threads],
            env=os.environ | {"NUMBA_NUM_THREADS": threads}, check=True,
            capture_output=True, text=True,
        )  # fmt: skip
        hashes.append(run.stdout.split())
    assert hashes[0] == hashes[1]
    assert len(set(hashes[0])) == 3
