from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch
from stable_baselines3 import PPO

from agents import ppo_warm, training
from agents.exports import TOLERANCE, plain_network
from agents.imitation import ImitationArgs, perceptron
from agents.ppo import export
from agents.ppo_warm import Hold, WarmArgs, begin_with
from sph_gym.env.stable_baselines import TuningVecEnv


@pytest.fixture(scope="module")
def envs():
    return TuningVecEnv(1, scene="dam_break", dx=0.08, max_episode_steps=8)


def model(envs):
    return PPO(
        "MlpPolicy", envs, n_steps=16, batch_size=16, n_epochs=2, seed=0, device="cpu",
        policy_kwargs={"net_arch": [8, 8]},
    )  # fmt: skip


def network(envs, *widths):
    torch.manual_seed(1)
    return plain_network(perceptron(envs.observation_space.shape[0], widths, 3), "clip", "absolute")


@pytest.fixture
def table(monkeypatch):
    """Changes entries of the table of hyperparameters."""
    found = training.hyperparameters("ppo_warm", "dam_break")

    def change(others):
        changed = training.replaced(found, others)
        monkeypatch.setattr(training, "hyperparameters", lambda *_: changed)

    return change


def test_the_policy_begins_as_the_network(envs):
    learner, start = model(envs), network(envs, 8, 8)
    begin_with(learner, start, "absolute")
    envs.observation_space.seed(0)
    for _ in range(20):
        observation = envs.observation_space.sample()
        wanted = learner.predict(observation, deterministic=True)[0]
        # in single precision, an action near zero is off by as much as any other
        assert np.abs(wanted - start(observation)).max() < TOLERANCE


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"activation": "relu"}, "start: expected a network with layers .*got"),
        ({"squash": "tanh"}, "start: expected a network with layers .*got"),
        ({"observation": "features v1"}, "trained with observations 'features v1'"),
    ],
    ids=str,
)
def test_another_kind_of_network_is_refused(envs, change, text):
    with pytest.raises(ValueError, match=text):
        begin_with(model(envs), replace(network(envs, 8, 8), **change), "absolute")


def test_another_size_is_refused(envs):
    with pytest.raises(ValueError, match="start: expected a network with layers"):
        begin_with(model(envs), network(envs, 8, 9), "absolute")


@pytest.mark.parametrize("mode", ["absolute", "stable"])
def test_the_imitation_learns_the_same_kind_of_actions(monkeypatch, table, mode):
    class Enough(Exception):
        """The imitation has begun."""

    seeds = []

    def begin(args):
        assert args.settings["action_mode"] == mode
        seeds.append(args.seed)
        raise Enough

    table({"env.action_mode": mode})
    monkeypatch.setattr(ppo_warm.imitation, "train", begin)
    with pytest.raises(Enough):
        ppo_warm.train(WarmArgs(seed=3))
    assert seeds == [3]


def test_the_imitation_leaves_that_of_its_user_alone(monkeypatch):
    folders = []
    monkeypatch.setattr(ppo_warm.imitation, "train", lambda args: folders.append(args.folder))
    ppo_warm.imitate(WarmArgs(seed=3), "stable")
    assert folders != [ImitationArgs(teacher="adaptive", seed=3).folder]
    assert ImitationArgs().folder != ImitationArgs(teacher="adaptive").folder


def test_the_trainings_of_a_study_begin_with_one_network(monkeypatch, envs, tmp_path):
    made = []

    def imitate(args, action_mode):
        made.append(args.seed)
        path = args.output / "network.npz"
        network(envs, 8, 8).save(path)
        return path

    monkeypatch.setattr(ppo_warm, "imitate", imitate)
    starts = {
        ppo_warm.common_start(training.TrainingArgs(seed=k, output=tmp_path), "absolute")
        for k in (3, 4)
    }
    assert made == [0]
    assert [path.name for path in tmp_path.iterdir()] == ["start.npz"]
    assert starts == {tmp_path / "start.npz"}


@pytest.mark.parametrize("mode", ["delta", "discrete"])
def test_actions_that_say_no_length_of_a_step_are_refused_before_all_else(monkeypatch, table, mode):
    table({"env.action_mode": mode})
    monkeypatch.setattr(ppo_warm.imitation, "train", lambda args: pytest.fail("it plays"))
    with pytest.raises(ValueError, match="action_mode: expected one of absolute, stable, got"):
        ppo_warm.train(WarmArgs())


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("courant", 2.0, r"courant: expected a number in \[0.2, 1.25\], got 2.0"),
        ("spread", [0.1, 0.1], r"spread: expected shape \(3,\), got"),
        ("spread", [0.1, 0.1, 0.0], "spread: expected a number above 0, got"),
        ("held", 1.5, r"held: expected a number in \[0, 1\], got 1.5"),
    ],
)
def test_hyperparameters_out_of_range_are_refused_before_all_else(
    monkeypatch, table, name, value, text
):
    table({name: value})
    monkeypatch.setattr(ppo_warm.imitation, "train", lambda args: pytest.fail("it plays"))
    with pytest.raises(ValueError, match=text):
        ppo_warm.train(WarmArgs())


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_the_policy_is_held_while_its_value_is_learned(envs):
    learner = model(envs)
    before, values = (
        export(learner, "absolute").weights,
        learner.policy.value_net.weight.detach().clone(),
    )
    learner.learn(16, callback=Hold(17))
    for one, other in zip(before, export(learner, "absolute").weights, strict=True):
        assert np.array_equal(one, other)
    assert not torch.equal(values, learner.policy.value_net.weight)
    learner.learn(32, callback=Hold(17), reset_num_timesteps=False)
    assert not np.array_equal(before[0], export(learner, "absolute").weights[0])
