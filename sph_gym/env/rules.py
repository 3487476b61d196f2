"""Rules: the arguments of an environment that all of its episodes share, checked once."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sph_gym.env import actions, observations, rewards
from sph_gym.solver.checks import in_range, known
from sph_gym.solver.scene import Scene

# Blow-ups in a row that are taken back.
ROLLBACKS = {"terminate": 0, "rollback": 3}
REWARDS = ("scalar", "vector")


@dataclass
class Rules:
    """Kinds of actions, observations and rewards; for the arguments see `TuningEnv`.

    actions, observations: objects of the chosen kinds; weights: one a term; limits: all
    tolerances; rollbacks: blow-ups in a row that are taken back.
    Raises ValueError that names the argument.
    """

    action_mode: str = "absolute"
    on_blowup: str = "terminate"
    reward_weights: Mapping[str, float] | None = None
    tolerances: Mapping[str, float] | None = None
    reward: str = "scalar"
    rate_limit: float | None = None
    observation: str = "features"

    def __post_init__(self) -> None:
        self.rollbacks = ROLLBACKS[known("on_blowup", self.on_blowup, ROLLBACKS)]
        known("reward", self.reward, REWARDS)
        if self.rate_limit is not None:
            in_range("rate_limit", self.rate_limit, 1.0)
        self.actions = actions.make(self.action_mode)
        kind = observations.TYPES[known("observation", self.observation, observations.TYPES)]
        self.observations = kind(rollback=self.rollbacks > 0)
        self.weights = rewards.check_weights(self.reward_weights)
        self.limits = rewards.check_tolerances(self.tolerances)

    def plain(self) -> dict[str, Any]:
        """Return all rules that the course of an episode depends on, as numbers and texts."""
        return {
            "action_mode": self.action_mode,
            "observation": self.observation,
            "on_blowup": self.on_blowup,
            "reward_weights": dict(self.weights),
            "tolerances": self.limits._asdict(),
            "rate_limit": self.rate_limit,
            "versions": (actions.VERSION, observations.VERSION),
        }

    def reward_of(self, terms: list[float]) -> Any:
        """Return the reward of a step for its weighted terms: their sum, or all of them."""
        return np.array(terms, np.float32) if self.reward == "vector" else sum(terms)

    def reward_space(self) -> spaces.Box:
        """Return bounds of the weighted terms; a blow-up is charged for every step that is left."""
        low = np.full(len(rewards.TERMS), -rewards.WORST)
        high = np.zeros(len(rewards.TERMS))
        work = rewards.TERMS.index("work")
        low[work], high[work] = 1.0 - rewards.MOST_WORK / 2, 1.0
        low[rewards.TERMS.index("blowup")] = -np.inf
        weights = np.array([self.weights[term] for term in rewards.TERMS])
        ends = np.stack([low * weights, high * weights])
        ends[np.isnan(ends)] = 0.0
        return spaces.Box(*np.sort(ends, axis=0).astype(np.float32), dtype=np.float32)

    def masks(self, scene: Scene, coordinates: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return (27,) True for the discrete actions that do something of their own.

        Raises AttributeError unless action_mode="discrete".
        """
        if not isinstance(self.actions, actions.Discrete):
            raise AttributeError('action_masks: only with action_mode="discrete"')
        return self.actions.masks(coordinates, actions.useful(scene, self.rate_limit))


# Names of the arguments.
ARGUMENTS = tuple(field.name for field in fields(Rules))
