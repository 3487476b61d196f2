"""Controllers by name, and trained networks as controllers of a run that is no environment."""

import math
from contextlib import suppress
from typing import Any

from sph_gym.controllers import RULES, Controller, Network
from sph_gym.controllers.shipped import fitting, load
from sph_gym.env import actions, contexts
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.observations import Features, Moment, measure
from sph_gym.env.reference import n_frames
from sph_gym.env.rules import Rules
from sph_gym.solver.checks import known
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls


class Pilot:
    """Sets the controls as a network does in the environment of a scene.

    network: takes features and returns an action of any mode. It has to be called once a frame.
    Raises ValueError for a network that takes or returns other numbers, or that was trained with
    other versions of them.
    """

    def __init__(self, network: Network) -> None:
        observation, action = (
            layout.partition(" ")[0] for layout in (network.observation, network.action)
        )
        known("network: its observations", observation, ("features", "features+context"))
        rules = Rules(action, observation=observation)
        network.check(observation_layout(rules), action_layout(action))
        features: Any = rules.observations
        self._network, self._features, self._actions = network, features, rules.actions
        self._discrete = network.squash == "none"
        _check_sizes(network, features, action == "discrete")
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
        present = actions.encode(scene, sim.controls)
        moment = Moment(
            sim,
            now,
            self._before,
            present,
            min(sim.time / (n_frames(scene) * scene.frame), 1.0),
            sim.last_report.n_substeps,
            0.0,
            contexts.of(scene),
        )
        self._sim, self._before, self._when = sim, now, sim.time
        values = self._network(self._features.observe(moment))
        action = int(values.argmax()) if self._discrete else values
        return actions.decode(scene, self._actions.act(action, present, scene))


def _check_sizes(network: Network, features: Features, is_discrete: bool) -> None:
    """Raise ValueError for a network that takes or returns numbers of other places."""
    sizes = network.weights[0].shape[1], network.weights[-1].shape[0]
    wanted = len(features.rows), len(actions.MOVES) if is_discrete else 3
    if sizes != wanted or (network.squash == "none") != is_discrete:
        raise ValueError(
            f"network: expected {wanted[0]} features in and {wanted[1]} "
            f"{'values of choices' if is_discrete else 'coordinates'} out, got {sizes[0]} and "
            f"{sizes[1]}, squashed by {network.squash!r}"
        )


def controllers(scene: Scene) -> dict[str, Controller]:
    """Return all controllers of a scene by name: the rules, then networks of the package.

    Networks of other versions are left out.
    """
    found = {name: make() for name, make in RULES.items()}
    for name, network in fitting(scene.name).items():
        with suppress(ValueError):
            found[name] = Pilot(load(network).network)
    return found


def controller(name: str, scene: Scene) -> Controller:
    """Return a controller by name: of a rule, an algorithm, "best", or FILE.npz of a network.

    Raises ValueError for unknown names, and for networks that don't fit.
    """
    if name.endswith(".npz"):
        return Pilot(Network.load(name))
    networks = fitting(scene.name)
    if known("controller", name, [*RULES, *networks, "FILE.npz"]) in RULES:
        return RULES[name]()
    return Pilot(load(networks[name]).network)
