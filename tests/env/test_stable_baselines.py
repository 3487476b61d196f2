"""The vector environment for Stable-Baselines3 against its own vector of single environments."""

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.preprocessing import (
    is_image_space,
    is_image_space_channels_first,
)
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    VecTransposeImage,
    is_vecenv_wrapped,
)

from sph_gym.env.stable_baselines import TuningVecEnv

ARGUMENTS = {"scene": "drop_impact", "dx": 0.08, "instances": "train"}
SHORT = 9


def pair(**more):
    def make():
        return gym.make(
            "sph_gym/DropImpact-v1", dx=0.08, instances="train", max_episode_steps=SHORT, **more
        )

    return TuningVecEnv(3, max_episode_steps=SHORT, **ARGUMENTS, **more), DummyVecEnv([make] * 3)


@pytest.mark.parametrize("more", [{}, {"action_mode": "discrete"}], ids=str)
def test_it_is_the_vector_of_single_environments(more):
    ours, theirs = pair(**more)
    for envs in (ours, theirs):
        envs.seed(4)
    assert np.array_equal(ours.reset(), theirs.reset())
    assert ours.reset_infos == theirs.reset_infos
    rng = np.random.default_rng(0)
    for _ in range(2 * SHORT + 2):
        actions = (
            rng.integers(27, size=3) if more else rng.uniform(-1, 1, (3, 3)).astype(np.float32)
        )
        one, other = ours.step(actions), theirs.step(actions)
        for a, b in zip(one[:3], other[:3], strict=True):
            assert a.dtype == b.dtype
            assert np.array_equal(a, b)
        for info, expected in zip(one[3], other[3], strict=True):
            info.pop("episode", None)
            last = info.pop("terminal_observation", None)
            assert np.array_equal(last, expected.pop("terminal_observation", None))
            assert info == expected
        assert ours.reset_infos == theirs.reset_infos


def test_single_environments_are_reached():
    ours, theirs = pair()
    for envs in (ours, theirs):
        envs.seed(0)
        envs.reset()
    assert ours.get_attr("n_steps") == theirs.get_attr("n_steps")
    assert (
        ours.env_method("get_state", indices=[1])[0]["instance"]
        == ours.get_attr("instance_id", 1)[0]
    )
    ours.set_attr("label", "x", indices=[0, 2])
    assert [hasattr(env, "label") for env in ours.envs.envs] == [True, False, True]
    assert ours.env_is_wrapped(Monitor) == [True] * 3
    ours.set_options({"instance": "drop_impact/val/2/dx=0.08"})
    ours.reset()
    assert ours.get_attr("instance_id") == ["drop_impact/val/2/dx=0.08"] * 3


def test_ppo_learns_on_it():
    envs = TuningVecEnv(2, max_episode_steps=SHORT, **ARGUMENTS)
    model = PPO("MlpPolicy", envs, n_steps=16, batch_size=16, n_epochs=1, seed=0, device="cpu")
    model.learn(64)
    assert len(model.ep_info_buffer) >= 2
    assert model.ep_info_buffer[0]["l"] <= SHORT


def test_vector_rewards_are_refused():
    with pytest.raises(ValueError, match="reward: expected 'scalar'"):
        TuningVecEnv(2, **ARGUMENTS, reward="vector")
    with pytest.raises(ValueError, match="reward: expected one of scalar, vector, got 'tensor'"):
        TuningVecEnv(2, **ARGUMENTS, reward="tensor")


def test_the_number_of_environments_may_be_written_as_a_float():
    envs = TuningVecEnv(2.0, **ARGUMENTS)
    assert envs.num_envs == len(envs.reset()) == 2


def test_a_network_with_convolutions_takes_the_field_as_it_is():
    envs = TuningVecEnv(2, max_episode_steps=SHORT, observation="field", **ARGUMENTS)
    assert is_image_space(envs.observation_space)
    assert is_image_space_channels_first(envs.observation_space)
    model = PPO("CnnPolicy", envs, n_steps=4, batch_size=8, n_epochs=1, device="cpu")
    assert not is_vecenv_wrapped(model.get_env(), VecTransposeImage)
    model.learn(8)


def test_roundings_are_cut_off_and_lists_of_flows_shown():
    chosen = [f"drop_impact/val/{k}/dx=0.08" for k in range(3)]
    envs = TuningVecEnv(2, scene="drop_impact", instances=chosen, max_episode_steps=2)
    envs.reset()
    assert envs.get_attr("instance_id") == chosen[:2]
    for _ in range(2):
        *_, infos = envs.step(np.full((2, 3), 1.000001, np.float32))
    assert [info["instance_id"] for info in infos] == chosen[:2]
    assert envs.get_attr("instance_id") == chosen[1:]
