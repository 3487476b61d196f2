"""Policies without learning: those that follow a rule, and random actions."""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from sph_gym.controllers.rules import Controller

# (environment, observation) -> action
Policy = Callable[[gym.Env[Any, Any], Any], Any]


def follow(controller: Controller) -> Policy:
    """Return the policy that comes as near as the action space allows to a controller."""

    def act(env: gym.Env[Any, Any], observation: NDArray[Any]) -> Any:
        tuning: Any = env.unwrapped
        return tuning.action_toward(controller(tuning.sim))

    return act


def draw_at_random(seed: int) -> Policy:
    """Return a policy that draws every action evenly from the whole box."""
    rng = np.random.default_rng(seed)
    return lambda env, observation: rng.uniform(-1, 1, 3).astype(np.float32)
