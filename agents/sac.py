"""Soft actor-critic: `python -m agents.sac --scene dam_break --steps 60000`."""

from typing import Any

from stable_baselines3 import SAC

from agents.arguments import launch
from agents.exports import plain_network
from agents.training import CONTINUOUS, Training, TrainingArgs, Trial
from sph_gym.controllers import Network
from sph_gym.solver.checks import known


def export(model: SAC, action_mode: str) -> Network:
    """Return the mean of the policy as a plain network; tanh brings actions into the box."""
    actor: Any = model.actor
    return plain_network([*actor.latent_pi, actor.mu], "tanh", action_mode)


def train(args: TrainingArgs, trial: Trial | None = None) -> None:
    """Train on the training instances; keep the model that is best on the validation instances."""
    training = Training("sac", args, export, trial)
    known("action_mode", training.action_mode, CONTINUOUS)
    training.learn(training.model(SAC, training.make_envs()))


if __name__ == "__main__":
    launch(train, TrainingArgs, __doc__)
