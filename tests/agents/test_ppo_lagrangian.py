from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch
from stable_baselines3.common.vec_env import DummyVecEnv

from agents.ppo_lagrangian import LagrangianPPO, Priced


class Greedy(gym.Env):
    """Earns the action, and is out of tolerance where it is positive; six steps."""

    observation_space = gym.spaces.Box(0.0, 1.0, (1,), np.float32)
    action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
    blowup, rules = 0.0, SimpleNamespace(weights={"blowup": 0.5})

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self._step = 0
        return np.ones(1, np.float32), {}

    def step(self, action):
        self._step += 1
        action = float(action[0])
        info = {"cost": float(action > 0), "reward_blowup": self.blowup}
        return np.ones(1, np.float32), action, False, self._step == 6, info


def model(**settings):
    torch.set_num_threads(1)
    envs = Priced(DummyVecEnv([Greedy]))
    return LagrangianPPO(
        "MlpPolicy", envs, n_steps=96, batch_size=48, n_epochs=10, seed=0, device="cpu",
        learning_rate=1e-2, policy_kwargs={"net_arch": [8], "log_std_init": -1.5}, **settings,
    )  # fmt: skip


def test_the_price_is_charged_for_steps_out_of_tolerance():
    envs = Priced(DummyVecEnv([Greedy]))
    envs.reset()
    envs.price = 3.0
    for action, reward in ((0.5, -2.5), (-0.5, -0.5)):
        assert envs.step(np.array([[action]]))[1][0] == pytest.approx(reward)
    assert envs.costs == [1.0, 0.0]


def test_a_blow_up_costs_all_steps_that_are_left(monkeypatch):
    monkeypatch.setattr(Greedy, "blowup", -4.0)
    envs = Priced(DummyVecEnv([Greedy]))
    envs.reset()
    envs.step(np.array([[0.5]]))
    assert envs.costs == [4.0]


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_the_multiplier_rises_above_the_limit_and_never_below_zero():
    dear = model(cost_limit=0.0, multiplier_rate=0.5).learn(96)
    share = np.mean(dear.get_env().costs)
    assert dear.multiplier == pytest.approx(0.5 * share)
    assert share > 0
    assert model(cost_limit=1.0, multiplier_rate=0.5).learn(96).multiplier == 0.0


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_it_learns_to_keep_the_limit_and_a_checkpoint_keeps_the_multiplier(tmp_path):
    bounded, free = model(cost_limit=0.1).learn(1500), model(cost_limit=1.0).learn(1500)
    ends = [np.mean(each.get_env().costs) for each in (bounded, free)]
    assert ends[1] > 0.9 > 0.5 > ends[0]
    bounded.save(tmp_path / "model")
    assert LagrangianPPO.load(tmp_path / "model").multiplier == bounded.multiplier > 0
