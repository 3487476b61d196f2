"""Viscous fluids: friction limits their time step, and actions choose it in multiples of h / c."""

from sph_gym.controllers.rules import TunedCfl
from sph_gym.env import actions
from sph_gym.solver.scene import Scene
from sph_gym.solver.state import Controls


def within_reach(scene: Scene, courant: float, wanted: Controls) -> Controls:
    """Return controls of a `TunedCfl`, or stiffer ones if no action asks for a step that short.

    Where friction asks for less than the lowest multiple of h / c, a larger c makes it shorter.
    courant: of the rule.
    """
    h, c = scene.h, scene.fluid.sound_speed(wanted.stiffness)
    lowest = actions.COURANT[0]
    if wanted.dt * c / h >= lowest:
        return wanted
    friction = 1 / wanted.dt - c / (courant * h)
    c = friction * h / (1 / lowest - 1 / courant)
    return Controls(lowest * h / c, scene.fluid.stiffness(c), wanted.xsph)


def check(name: str, scene: Scene) -> None:
    """Raise ValueError if the fluid is so viscous that it takes steps below the action space.

    name: of the argument to blame. Even in the stiffest fluid, the lowest multiple of h / c must
    be a step that the tuned rule could take.
    """
    nu, h = scene.effects.laminar_viscosity or 0.0, scene.h
    c, courant = actions.SOUND[1] * scene.fluid.c0, TunedCfl().courant
    shortest = actions.COURANT[0] * h / c
    limit = 1 / (c / (courant * h) + nu / (scene.viscous_share * h * h))
    limit = min(limit, scene.surface_dt)
    if limit < shortest:
        raise ValueError(
            f"{name}: expected a fluid that takes steps within the action space, but with "
            f"nu = {nu:g} m^2/s and h = {h:g} m viscosity limits the step to {limit:.3g} s, and "
            f"the shortest that an action asks for is {shortest:.3g} s; a larger dx or a smaller "
            "viscosity makes them meet"
        )
