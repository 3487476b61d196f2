"""Training in miniature: it runs, exports what it learned, and goes on from a checkpoint."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO, SAC

from agents import training
from sph_gym.controllers import Network


@pytest.fixture
def small(monkeypatch):
    settings = {
        "ppo": {"n_steps": 32, "batch_size": 32, "n_epochs": 1},
        "sac": {"learning_starts": 20, "batch_size": 16, "buffer_size": 200},
    }
    common = {"learning_rate": 1e-3, "policy_kwargs": {"net_arch": [8]}}

    def look_up(algorithm, scene):
        return settings[algorithm] | common

    monkeypatch.setattr(training, "hyperparameters", look_up)


@pytest.mark.parametrize(("algorithm", "kind"), [("ppo", PPO), ("sac", SAC)])
@pytest.mark.filterwarnings("ignore:Training and eval env are not of the same type")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore:rich is experimental")
def test_train_export_resume(tmp_path, small, algorithm, kind):
    arguments = training.Args(
        scene="relaxation", steps=64, n_envs=1, output=tmp_path, evaluate_every=64, n_evaluations=1
    )
    training.train(kind, algorithm, arguments)
    path = tmp_path / f"{algorithm}_relaxation"
    action = Network.load(path / "network.npz")(np.zeros(20, np.float32))
    assert np.abs(action).max() <= 1
    arguments.steps, arguments.resume = 96, True
    with pytest.raises(ValueError, match=r"trust_checkpoints: .* pickles"):
        training.train(kind, algorithm, arguments)
    arguments.trust_checkpoints = True
    # killed while it wrote the newest
    torn = training.newest_checkpoint(path).with_name(f"{algorithm}_999999_steps.zip")
    torn.write_bytes(b"PK half of it")
    training.train(kind, algorithm, arguments)
    assert training.newest_checkpoint(path).exists()
    assert list((path / "tensorboard").rglob("events*"))


def test_nothing_to_resume_is_said(tmp_path):
    with pytest.raises(FileNotFoundError, match="nothing to resume"):
        training.newest_checkpoint(tmp_path)


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_hyperparameters_fall_back_to_the_default(algorithm):
    named = training.hyperparameters(algorithm, "dam_break")
    assert set(training.hyperparameters(algorithm, "relaxation")) == set(named)
