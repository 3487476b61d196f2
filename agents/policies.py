"""Every agent by name, as plain data that a worker process can turn into a policy."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from sph_gym.controllers import (
    AdaptiveRule,
    ArticleCfl,
    Network,
    PiController,
    Static,
    TunedCfl,
    nominal,
)
from sph_gym.env import actions
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.oracle import SHORT, Oracle
from sph_gym.env.policies import Policy, draw_at_random, follow
from sph_gym.provenance import content_hash
from sph_gym.solver.checks import known


class Settings(NamedTuple):
    """A static setting: dt c / h, sound speed / nominal c0, XSPH epsilon."""

    courant: float
    sound: float
    xsph: float


class Spec(NamedTuple):
    """An agent as plain data.

    name: one of AGENTS; settings: of a static agent; network: file of a learned agent's exported
    network; table: JSON file with settings by scene or by instance, which a static agent plays
    instead: the best per scene, or the best per instance in hindsight, as `agents.static_search`
    writes them.
    """

    name: str
    settings: tuple[float, float, float] | None = None
    network: str | None = None
    table: str | None = None


def load_unchanged(path: str, weights: str | None) -> Network:
    """Return a network. Raises RuntimeError if its file has another content than the hash tells.

    What it plays would be kept as what the former network has played.
    """
    if content_hash(Path(path)) != weights:
        raise RuntimeError(f"{path} has changed: does another training write into its folder?")
    return Network.load(path)


def play_network(network: Network) -> Policy:
    """Return the policy of an exported network; one of other actions plays absolute ones, too.

    It raises ValueError in an environment whose observations or actions it wasn't trained with.
    """
    own = network.action.partition(" ")[0]
    kind = actions.MODES.get(own, actions.Absolute)()
    discrete = network.squash == "none"
    fitting: Any = None

    def act(env: gym.Env[Any, Any], observation: NDArray[np.float32]) -> Any:
        nonlocal fitting
        tuning: Any = env.unwrapped
        rules = tuning.rules
        if rules is not fitting:
            # in absolute actions, what it chooses becomes the action that leads to the same place
            mode = own if rules.action_mode == "absolute" else rules.action_mode
            network.check(observation_layout(rules), action_layout(mode))
            fitting = rules
        values = network(observation)
        chosen: Any = int(values.argmax()) if discrete else values
        if rules.action_mode == own:
            return chosen
        episode = tuning.episode
        return kind.act(chosen, episode.coordinates, episode.scene).astype(np.float32)

    return act


def _play_static(spec: Spec) -> Policy:
    if (spec.settings is None) == (spec.table is None):
        raise ValueError(f"agent: {spec.name} needs its settings, or a table of settings")
    if spec.table is not None:
        return play_table(read_table(Path(spec.table)))
    return follow(Static(*Settings._make(spec.settings or ())))


def read_table(path: Path) -> dict[str, tuple[float, float, float]]:
    """Return the settings of a file by instance or scene. Raises ValueError if it holds none."""
    try:
        rows = dict(json.loads(path.read_text()))
        return {name: Settings(*map(float, settings)) for name, settings in rows.items()}
    except (ValueError, TypeError) as error:
        raise ValueError(f"table: {path} is no table of settings ({error})") from None


def play_table(table: Mapping[str, tuple[float, float, float]]) -> Policy:
    """Return the policy that keeps the settings of the instance, or else of its scene.

    It raises ValueError in an episode for which the table has neither.
    """

    def act(env: gym.Env[Any, Any], observation: NDArray[np.float32]) -> Any:
        id_ = env.unwrapped.instance_id  # type: ignore[attr-defined]
        settings = table.get(id_, table.get(id_.split("/")[0]))
        if settings is None:
            raise ValueError(f"table: expected settings of {id_} or its scene, got {list(table)}")
        return follow(Static(*settings))(env, observation)

    return act


def _play_trained(spec: Spec) -> Policy:
    if spec.network is None:
        raise ValueError(f"agent: {spec.name} needs its network")
    return play_network(Network.load(spec.network))


LEARNED = ("ppo", "ppo_lagrangian", "ppo_warm", "imitation", "rollout", "sac", "dqn")
# Agents that see the reference and what is to come: bounds, no competitors.
ORACLES = ("lookahead", "short_lookahead")
# Ways to find static settings, and the best ones of each instance in hindsight.
STATIC = ("grid_search", "random_search", "tpe", "cma_es", "hindsight")
# The one list of agents: what makes a policy of a spec and the seed of the episode.
AGENTS: dict[str, Callable[[Spec, int], Policy]] = {
    "random": lambda spec, seed: draw_at_random(seed),
    "default": lambda spec, seed: follow(nominal),
    "cfl": lambda spec, seed: follow(ArticleCfl()),
    "tuned_cfl": lambda spec, seed: follow(TunedCfl()),
    "adaptive": lambda spec, seed: follow(AdaptiveRule()),
    "pi": lambda spec, seed: follow(PiController()),
    **dict.fromkeys(STATIC, lambda spec, seed: _play_static(spec)),
    "lookahead": lambda spec, seed: Oracle(),
    "short_lookahead": lambda spec, seed: Oracle(SHORT),
    **dict.fromkeys(LEARNED, lambda spec, seed: _play_trained(spec)),
}
NAMES = tuple(AGENTS)


def build(spec: Spec, seed: int) -> Policy:
    """Return the policy of an agent; the seed is that of the episode.

    Raises ValueError for unknown names, missing settings, and files that are no networks.
    """
    return AGENTS[known("agent", spec.name, NAMES)](spec, seed)
