import gymnasium as gym
import numpy as np
import pytest

from sph_gym.controllers import TunedCfl
from sph_gym.env import env_id
from sph_gym.env.oracle import COARSE, SHORT, Oracle, Search, displaced, play

INSTANCE = {"instance": "patch_impact/val/3"}
# Three moves of 25 steps, and only the settings around the present one.
ROUGH = Search(width=1, hold=25, courant=(), sound=(), xsph=())


@pytest.fixture
def env():
    made = gym.make(env_id("patch_impact")).unwrapped
    made.reset(seed=0, options=INSTANCE)
    return made


def rewards(env, policy):
    env.reset(seed=0, options=INSTANCE)
    earned, over = [], False
    while not over:
        _, reward, terminated, truncated, _ = env.step(policy(env, None))
        earned.append(reward)
        over = terminated or truncated
    return earned


def rule(env, observation):
    return env.action_toward(TunedCfl()(env.sim))


def test_it_earns_more_than_the_tuned_rule(env):
    assert sum(rewards(env, Oracle(COARSE))) > 1.2 * sum(rewards(env, rule))


def test_planning_leaves_the_episode_as_it_was(env):
    twin = gym.make(env_id("patch_impact")).unwrapped
    twin.reset(seed=0, options=INSTANCE)
    Oracle(ROUGH).plan(env.episode)
    action = np.zeros(3, np.float32)
    ours, theirs = env.step(action), twin.step(action)
    assert np.array_equal(ours[0], theirs[0])
    assert ours[1:] == theirs[1:]


def test_a_step_without_observation_is_a_step(env):
    action = np.array([0.3, -0.2, 0.1], np.float32)
    moment = env.episode.state()
    for _ in range(3):
        step = play(env.episode, action)
    after = env.sim.x.copy()
    env.episode.restore(moment)
    for _ in range(3):
        _, reward, *_, info = env.step(action)
    assert np.array_equal(env.sim.x, after)
    assert (step.reward, step.n_substeps) == (reward, info["n_substeps"])


def test_what_is_fixed_stays(env):
    oracle = Oracle(ROUGH, {1: 0.25})
    actions = np.array(oracle.plan(env.episode))
    assert np.all(actions[:, 1] == np.float32(0.25))
    assert len(actions) == env.n_steps


@pytest.mark.parametrize("mode", ["delta", "discrete"])
def test_it_plays_in_every_action_mode(mode):
    env = gym.make(env_id("patch_impact"), action_mode=mode).unwrapped
    env.reset(seed=0, options=INSTANCE)
    oracle = Oracle(ROUGH)
    for _ in range(3):
        action = oracle(env)
        assert env.action_space.contains(action)
        env.step(action)


def test_a_short_plan_is_made_anew_every_two_steps(env):
    search = SHORT._replace(courant=(), sound=(0.3,), xsph=())
    before = env.sim.x.copy()
    plan = Oracle(search).plan(env.episode)
    assert len(plan) == 2
    assert np.array_equal(plan[0], plan[1])
    assert np.array_equal(env.sim.x, before)
    assert np.array_equal(plan, Oracle(search).plan(env.episode))


def test_displaced_particles_are_elsewhere_and_nothing_else_is(env):
    dx = env.episode.scene.dx
    state = env.episode.state()
    moved = displaced(state, 1e-3 * dx)
    assert displaced(state, 0.0) is state
    env.episode.restore(moved)
    away = env.sim.x[: env.sim.n_fluid]
    env.episode.restore(state)
    away = (away - env.sim.x[: env.sim.n_fluid]) / dx
    assert away.std(axis=0) == pytest.approx([1e-3, 1e-3], rel=0.2)
    assert all(moved[name] is state[name] for name in state if name != "simulation")
