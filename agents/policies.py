"""Every agent by name, as something that can be sent to a worker process and built there."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from sph_gym.controllers import ArticleCfl, Controller, Network, Static, TunedCfl, nominal
from sph_gym.controllers.network import shipped_network
from sph_gym.env.actions import Discrete
from sph_gym.env.oracle import Oracle

# (environment, observation) -> action
Policy = Callable[[gym.Env[Any, Any], NDArray[np.float32]], Any]

LEARNED = ("ppo", "sac", "dqn")
NAMES = ("random", "default", "cfl", "tuned_cfl", "grid_search", "lookahead", *LEARNED)


class Spec(NamedTuple):
    """An agent as plain data.

    name: one of NAMES; settings: Courant multiple, sound speed / c0 and xsph of "grid_search";
    network: file of a learned agent's exported network.
    """

    name: str
    settings: tuple[float, float, float] | None = None
    network: str | None = None


def trained_network(name: str, scene: str) -> Path:
    """Where the exported network of a learned agent for a scene is shipped."""
    return shipped_network(name, scene)


def build(spec: Spec, seed: int) -> Policy:
    """The policy of a spec; the seed is for the one agent that throws dice.

    Raises ValueError for unknown names and files that are no networks.
    """
    rules: dict[str, Controller] = {
        "default": nominal,
        "cfl": ArticleCfl(),
        "tuned_cfl": TunedCfl(),
    }
    if spec.name in rules:
        return _follow(rules[spec.name])
    if spec.name == "grid_search" and spec.settings is not None:
        return _follow(Static(*spec.settings))
    if spec.name == "lookahead":
        return Oracle()
    if spec.name in LEARNED and spec.network is not None:
        return _learned(Network.load(spec.network))
    if spec.name == "random":
        rng = np.random.default_rng(seed)
        return lambda env, observation: rng.uniform(-1, 1, 3).astype(np.float32)
    raise ValueError(f"agent: expected one of {', '.join(NAMES)} with its settings, got {spec}")


def _learned(network: Network) -> Policy:
    if network.squash != "none":
        return lambda env, observation: network(observation)

    def act(env: gym.Env[Any, Any], observation: NDArray[np.float32]) -> Any:
        # the values of the discrete actions, in an environment of absolute ones
        tuning: Any = env.unwrapped
        choice = int(network(observation).argmax())
        return Discrete().act(choice, tuning.episode.coordinates).astype(np.float32)

    return act


def _follow(controller: Controller) -> Policy:
    def act(env: gym.Env[Any, Any], observation: NDArray[np.float32]) -> Any:
        tuning: Any = env.unwrapped
        return tuning.action_toward(controller(tuning.sim))

    return act
