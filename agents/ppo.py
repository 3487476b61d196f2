"""Proximal policy optimisation: `python -m agents.ppo --scene benchmark --steps 600000`."""

from dataclasses import replace
from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3 import PPO

from agents.arguments import launch
from agents.exports import plain_network
from agents.training import Training, TrainingArgs, Trial
from sph_gym.controllers import Network


def layers(model: PPO) -> list[torch.nn.Module]:
    """Return the layers from the observation to the mean of the action, or to the logits."""
    policy: Any = model.policy
    return [*policy.mlp_extractor.policy_net, policy.action_net]


def export(model: PPO, action_mode: str) -> Network:
    """Return the likeliest action as a plain network.

    It is the mean, clipped to the box, or the discrete action of the largest logit.
    """
    space: Any = model.action_space
    if isinstance(space, spaces.Discrete):
        return plain_network(layers(model), "none", action_mode)
    highest = tuple(space.high.astype(float).tolist())
    return replace(plain_network(layers(model), "clip", action_mode), highest=highest)


def train(args: TrainingArgs, trial: Trial | None = None) -> None:
    """Train on the training instances; keep the model that is best on the validation instances."""
    training = Training("ppo", args, export, trial)
    training.learn(training.model(PPO, training.make_envs()))


if __name__ == "__main__":
    launch(train, TrainingArgs, __doc__)
