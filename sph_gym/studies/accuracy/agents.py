"""Agents of the environments in the study: their controls are written down first, then played.

So the time that an agent itself takes, which is another matter, counts for nothing.
"""

from collections.abc import Callable
from typing import Any

from sph_gym.controllers import Network
from sph_gym.controllers.network import shipped_network
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.oracle import COARSE, Oracle
from sph_gym.env.rules import Rules
from sph_gym.env.tuning import TuningEnv
from sph_gym.recommend.runs import Schedule
from sph_gym.recommend.settings import is_agent
from sph_gym.solver.scene import Scene

# Scenes of the study that are environments as they stand; a search takes a minute.
SEARCHED = ("dam_break",)
LEARNED = ("ppo", "sac")


def available(name: str, scene: str) -> bool:
    """Return whether there is such a controller for a scene."""
    if name in LEARNED:
        return shipped_network(name, scene).is_file()
    return not is_agent(name) or (name == "lookahead" and scene in SEARCHED)


def play(name: str, scene: Scene) -> Schedule:
    """Return the controls of every frame as an agent sets them.

    Raises RuntimeError if the scene blows up.
    """
    env = TuningEnv(scene)
    observation, _ = env.reset(seed=0)
    policy = _policy(name, scene)
    played: Schedule = []
    while not env.episode.over:
        observation, _, terminated, _, _ = env.step(policy(env, observation))
        played.append([float(value) for value in env.sim.controls])
        if terminated:
            raise RuntimeError(f"{name}: blew up at t = {env.sim.time:g} s")
    return played


def _policy(name: str, scene: Scene) -> Callable[[Any, Any], Any]:
    if name == "lookahead":
        return Oracle(COARSE)
    trained = Network.load(shipped_network(name, scene.name))
    trained.check(observation_layout(Rules()), action_layout("absolute"))
    return lambda env, observation: trained(observation)
