"""Every agent by name, as plain data that a worker process can turn into a policy."""

from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from sph_gym.controllers import (
    AdaptiveRule,
    ArticleCfl,
    Network,
    Static,
    TunedCfl,
    nominal,
)
from sph_gym.env.actions import Discrete
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.oracle import Oracle
from sph_gym.env.policies import Policy, draw_at_random, follow
from sph_gym.solver.checks import known


class Spec(NamedTuple):
    """An agent as plain data.

    name: one of AGENTS; settings: Courant multiple, sound speed / c0 and xsph of "grid_search";
    network: file of a learned agent's exported network.
    """

    name: str
    settings: tuple[float, float, float] | None = None
    network: str | None = None


def play_network(network: Network) -> Policy:
    """Return the policy of an exported network; one of discrete actions plays absolute ones, too.

    It raises ValueError in an environment whose observations or actions it wasn't trained with.
    """
    discrete = network.squash == "none"

    def act(env: gym.Env[Any, Any], observation: NDArray[np.float32]) -> Any:
        tuning: Any = env.unwrapped
        rules = tuning.rules
        # a choice among the 27 moves becomes the absolute action that leads to the same place
        mode = "discrete" if discrete and rules.action_mode == "absolute" else rules.action_mode
        network.check(observation_layout(rules), action_layout(mode))
        values = network(observation)
        if not discrete:
            return values
        choice = int(values.argmax())
        if rules.action_mode == "discrete":
            return choice
        return Discrete().act(choice, tuning.episode.coordinates).astype(np.float32)

    return act


def _play_static(spec: Spec) -> Policy:
    if spec.settings is None:
        raise ValueError("agent: grid_search needs its settings")
    return follow(Static(*spec.settings))


def _play_trained(spec: Spec) -> Policy:
    if spec.network is None:
        raise ValueError(f"agent: {spec.name} needs its network")
    return play_network(Network.load(spec.network))


LEARNED = ("ppo", "sac", "dqn")
# The one list of agents: what makes a policy of a spec and the seed of the episode.
AGENTS: dict[str, Callable[[Spec, int], Policy]] = {
    "random": lambda spec, seed: draw_at_random(seed),
    "default": lambda spec, seed: follow(nominal),
    "cfl": lambda spec, seed: follow(ArticleCfl()),
    "tuned_cfl": lambda spec, seed: follow(TunedCfl()),
    "adaptive": lambda spec, seed: follow(AdaptiveRule()),
    "grid_search": lambda spec, seed: _play_static(spec),
    "lookahead": lambda spec, seed: Oracle(),
    **dict.fromkeys(LEARNED, lambda spec, seed: _play_trained(spec)),
}
NAMES = tuple(AGENTS)


def build(spec: Spec, seed: int) -> Policy:
    """Return the policy of an agent; the seed is that of the episode.

    Raises ValueError for unknown names, missing settings, and files that are no networks.
    """
    return AGENTS[known("agent", spec.name, NAMES)](spec, seed)
