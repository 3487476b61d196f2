"""Hard cases for every integrator, with summed densities and with those by continuity."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from sph_gym import scenes
from sph_gym.solver.scene import Scene
from sph_gym.studies.stability.bodies import DX as BODY_DX
from sph_gym.studies.stability.bodies import patches
from sph_gym.studies.stability.case import Case
from sph_gym.studies.stability.events import flowed, ran, turned
from sph_gym.studies.stability.tanks import DX as TANK_DX
from sph_gym.studies.stability.tanks import PEAK, TOGETHER, dam

EULER, KICK, CORRECTOR = "symplectic_euler", "kick_drift_kick", "predictor_corrector"
# Of a density by continuity, which drifts without it.
DIFFUSION = 0.1
# Particles across a channel.
ACROSS = 14


def schemed(dx: float, build: Callable[[float], Scene], integrator: str, continuity: bool) -> Scene:
    """A scene by another integrator, with densities that are summed or by continuity."""
    scene = build(dx)
    diffusion = DIFFUSION if continuity else None
    effects = replace(scene.effects, continuity=continuity, density_diffusion=diffusion)
    walls = scene.walls
    if continuity and walls is not None and walls.particles is not None:
        # those that are like fluid sum their densities
        walls = replace(walls, pressure="extrapolated")
    return replace(scene, effects=effects, walls=walls, integrator=integrator)


def poiseuille(dx: float) -> Scene:
    """A viscous flow between walls, with so few particles across that viscosity is the limit."""
    return scenes.make("poiseuille", dx=dx)


def outside_channel(x: Any, dx: float) -> Any:
    """Behind the first layer of either wall, 1 m apart."""
    return (x[:, 1] < -dx) | (x[:, 1] > 1 + dx)


def cases() -> Iterator[Case]:
    """All of them; rotating squares are by kick_drift_kick and continuity, the rest by neither."""
    for integrator, continuity in ((KICK, False), (CORRECTOR, False), (EULER, True)):
        name, falls = _scheme("dam break", dam, integrator, continuity)
        yield Case(
            name, falls, ran(0.7, 0.7), TANK_DX, density=0.01, typical=TOGETHER, quick=50, peak=PEAK
        )
    for continuity in (False, True):
        name, collide = _scheme("colliding patches", patches, CORRECTOR, continuity)
        yield Case(name, collide, turned(0.7, 0.7), BODY_DX, conserves=True, gain=0.1, quick=40)
    for integrator in (KICK, CORRECTOR):
        name, flows = _scheme("Poiseuille flow", poiseuille, integrator, False)
        # two thirds of the 1 m/s on the centre line, in the end
        yield Case(
            name, flows, flowed(0.6, 0.1), 1 / ACROSS, frames=200, quick=10,
            behind=outside_channel, typical=0.98, peak=1.05,
        )  # fmt: skip


def _scheme(
    name: str, build: Callable[[float], Scene], integrator: str, continuity: bool
) -> tuple[str, Callable[[float], Scene]]:
    density = "by continuity" if continuity else "summed"
    built = partial(schemed, build=build, integrator=integrator, continuity=continuity)
    return f"{name}, {integrator}, {density}", built
