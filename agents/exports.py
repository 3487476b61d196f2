"""Plain networks from torch modules, checked against what they were made of."""

from collections.abc import Callable, Iterable
from typing import Any

import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from sph_gym.controllers import Network
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.rules import Rules

# Largest change of an action that the exported network may show against the original.
TOLERANCE = 1e-5


def plain_network(layers: Iterable[torch.nn.Module], squash: str, action_mode: str) -> Network:
    """Return the layers of a perceptron with tanh or ReLU units as a plain network.

    squash: of `Network`; action_mode: the kind of actions that it was trained with.
    """
    layers = list(layers)
    linears = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    smooth = any(isinstance(layer, torch.nn.Tanh) for layer in layers)
    return Network(
        tuple(layer.weight.detach().numpy().copy() for layer in linears),
        tuple(layer.bias.detach().numpy().copy() for layer in linears),
        "tanh" if smooth else "relu",
        squash,
        observation_layout(Rules(action_mode=action_mode)),
        action_layout(action_mode),
    )


def checked_export(model: BaseAlgorithm, export: Callable[[Any], Network]) -> Network:
    """Return the exported network of a model; RuntimeError if it acts in another way."""
    network = export(model)
    model.observation_space.seed(0)
    for _ in range(20):
        observation = model.observation_space.sample()
        wanted, _ = model.predict(observation, deterministic=True)
        found: Any = network(observation)
        if network.squash == "none":
            found = found.argmax()
        difference = abs(wanted - found).max()
        if difference > TOLERANCE:
            raise RuntimeError(f"the exported network is off by {difference:g}")
    return network
