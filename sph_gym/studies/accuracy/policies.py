"""Who sets dt, stiffness and epsilon in every frame: rules, the look-ahead oracle, a network.

What an agent of the environments does is written down once, as the controls of every frame, and
then played: its own time, which is another matter, counts for nothing.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from sph_gym.controllers import ArticleCfl, Controller, Network, TunedCfl
from sph_gym.controllers.network import shipped_network
from sph_gym.env.oracle import COARSE, Oracle
from sph_gym.env.tuning import TuningEnv
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls
from sph_gym.studies.accuracy.settings import FIXED

RULES: dict[str, Callable[[], Controller]] = {"cfl": ArticleCfl, "tuned_cfl": TunedCfl}
# Scenes of the study that are environments as they stand; a search takes a minute.
SEARCHED = ("dam_break",)
LEARNED = ("ppo", "sac")
Schedule = list[list[float]]


def available(name: str, scene: str) -> bool:
    """Whether there is such a controller for a scene."""
    if name in LEARNED:
        return network(name, scene).is_file()
    return name in RULES or name == FIXED or (name == "lookahead" and scene in SEARCHED)


def network(name: str, scene: str) -> Path:
    """Where the package has the trained network of an agent."""
    return shipped_network(name, scene)


def needs_schedule(name: str) -> bool:
    """Whether it is an agent whose controls are written down first."""
    return name != FIXED and name not in RULES


def schedule(name: str, scene: Scene) -> Schedule:
    """Controls of every frame as an agent sets them: [dt, stiffness, xsph].

    Raises RuntimeError if it blows up.
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
    trained = Network.load(network(name, scene.name))
    return lambda env, observation: trained(observation)


def controller(name: str, played: Schedule | None = None) -> Controller | None:
    """What is asked for controls before every frame; None where they stay as they are."""
    if name == FIXED:
        return None
    if name in RULES:
        return RULES[name]()
    assert played
    frames = iter(played)
    last = played[-1]

    def follow(sim: Simulation) -> Controls:
        return Controls(*next(frames, last))

    return follow
