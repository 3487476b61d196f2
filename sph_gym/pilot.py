"""Trained networks as controllers of a run that is no environment: they see what an agent sees."""

import math
from contextlib import suppress
from typing import Any

import numpy as np

from sph_gym.controllers import Controller, Network
from sph_gym.controllers.network import shipped_network
from sph_gym.env import actions, contexts
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.observations import Features, Moment, measure
from sph_gym.env.reference import n_frames
from sph_gym.env.rules import Rules
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls

ALGORITHMS = ("ppo", "sac")


class Pilot:
    """Sets the controls as a network with absolute actions does in the environment of a scene.

    network: takes the `Features` and returns 3 coordinates. It has to be called once a frame.
    Raises ValueError for a network that takes or returns other numbers, or that was trained with
    other versions of them.
    """

    def __init__(self, network: Network) -> None:
        self._network, self._features = network, Features()
        sizes = network.weights[0].shape[1], network.weights[-1].shape[0]
        wanted = len(self._features.rows), 3
        if sizes != wanted or network.squash == "none":
            raise ValueError(
                f"network: expected {wanted[0]} features in and {wanted[1]} coordinates out, got "
                f"{sizes[0]} and {sizes[1]}, squashed by {network.squash!r}"
            )
        network.check(observation_layout(Rules()), action_layout("absolute"))
        self._sim: Simulation | None = None
        self._before: dict[str, float] = {}
        self._when = math.nan

    def __call__(self, sim: Simulation) -> Controls:
        """Return the controls for the present state."""
        scene = sim.scene
        # of another run, or of a later time than this, it tells nothing about the last step
        known = self._sim is sim and self._when < sim.time
        now = measure(sim, self._before if known else None)
        if not known:
            self._before = now
        moment = Moment(
            sim,
            now,
            self._before,
            actions.encode(scene, sim.controls),
            min(sim.time / (n_frames(scene) * scene.frame), 1.0),
            sim.last_report.n_substeps,
            0.0,
            contexts.of(scene),
        )
        self._sim, self._before, self._when = sim, now, sim.time
        wanted: Any = self._network(self._features.observe(moment))
        return actions.decode(scene, np.clip(wanted.astype(np.float64), -1.0, 1.0))


def pilots(scene: Scene) -> dict[str, Controller]:
    """Return the networks that the package has for a scene, by names such as "ppo network".

    Those of environments with other observations are left out.
    """
    found: dict[str, Controller] = {}
    for algorithm in ALGORITHMS:
        path = shipped_network(algorithm, scene.name)
        if path.is_file():
            with suppress(ValueError):
                found[f"{algorithm} network"] = Pilot(Network.load(path))
    return found
