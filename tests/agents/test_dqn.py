from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch

from agents.dqn import DoubleDQN

GAMMA = 0.9


class Chain(gym.Env):
    """Two actions in one state; 1 earns 1 and goes on, 0 earns 2 and ends the episode."""

    observation_space = gym.spaces.Box(0.0, 1.0, (1,), np.float32)
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.ones(1, np.float32), {}

    def step(self, action):
        return np.ones(1, np.float32), (2.0, 1.0)[action], action == 0, False, {}


def model(**settings):
    torch.set_num_threads(1)
    return DoubleDQN(
        "MlpPolicy", Chain(), gamma=GAMMA, seed=0, device="cpu", learning_rate=3e-3,
        learning_starts=50, train_freq=2, target_update_interval=40, buffer_size=1000,
        exploration_fraction=1.0, exploration_final_eps=0.5,
        policy_kwargs={"net_arch": [16]}, **settings,
    )  # fmt: skip


def batch(reward, done):
    return SimpleNamespace(
        next_observations=torch.ones(1, 1),
        rewards=torch.tensor([[reward]]),
        dones=torch.tensor([[done]]),
    )


def test_one_network_chooses_the_next_action_and_the_other_values_it():
    learner = model()
    learner.q_net.forward = lambda observations: torch.tensor([[1.0, 2.0]])
    learner.q_net_target.forward = lambda observations: torch.tensor([[7.0, 5.0]])
    assert learner._target(batch(0.5, 0.0)).item() == pytest.approx(0.5 + GAMMA * 5.0)
    assert learner._target(batch(0.5, 1.0)).item() == pytest.approx(0.5)


@pytest.mark.parametrize("done", [0.0, 1.0])
def test_a_shift_adds_the_same_to_every_value(done):
    plain, shifted = model(), model(reward_shift=-0.5)
    offset = -0.5 / (1 - GAMMA)
    for learner, more in ((plain, 0.0), (shifted, offset)):
        learner.q_net.forward = lambda observations: torch.tensor([[1.0, 2.0]])
        learner.q_net_target.forward = lambda o, more=more: torch.tensor([[7.0, 5.0]]) + more
    difference = shifted._target(batch(0.3, done)) - plain._target(batch(0.3, done))
    assert difference.item() == pytest.approx(offset)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_it_learns_that_going_on_is_better_than_a_large_reward_and_the_end():
    shift = -1.0
    learner = model(reward_shift=shift).learn(800)
    values = learner.q_net(torch.ones(1, 1)).detach()[0] - shift / (1 - GAMMA)
    assert values[1] > values[0] + 1
