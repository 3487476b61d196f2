"""Scenes with one of their effects left out, or with one more."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from sph_gym.solver import registry
from sph_gym.solver.scene import Scene
from sph_gym.solver.walls import PRESSURES, SLIPS, Walls

# Effects of the whole fluid, and values for scenes that don't name them: far inside of what the
# time step allows. Densities by continuity keep columns of their own in the state, so that they
# can't be compared from the same start.
TYPICAL: dict[str, Callable[[Scene], Any]] = {
    each.name: each.typical
    for each in registry.EFFECTS
    if "continuity" not in (each.name, *(each.needs or ()))
}
TYPICAL["gravity"] = lambda scene: (0.0, -9.81)
UNIFORM = tuple(TYPICAL)
EFFECTS = (*UNIFORM, "box", "walls")


def names(scene: Scene, effect: str) -> bool:
    """Return whether the scene calls for an effect."""
    if effect == "box":
        return scene.walls is not None and scene.walls.box is not None
    if effect == "walls":
        return scene.walls is not None and scene.walls.particles is not None
    return bool(getattr(scene.effects, effect))


def left_out(scene: Scene, effect: str) -> Scene:
    """Return the scene without an effect; the same scene if it doesn't name it."""
    if not names(scene, effect):
        return scene
    if effect in UNIFORM:
        flag = isinstance(getattr(scene.effects, effect), bool)
        return _with_effect(scene, effect, False if flag else None)
    assert scene.walls is not None
    if effect == "box":
        return replace(scene, walls=replace(scene.walls, box=None))
    # with everything that only particles have
    usual: dict[str, Any] = {"pressure": PRESSURES[0], "slip": SLIPS[0]}
    return replace(scene, walls=replace(scene.walls, particles=None, velocity=None, **usual))


def added(scene: Scene, effect: str) -> Scene:
    """Return the scene with an effect; the same scene if it names it already.

    Raises ValueError for walls of particles, whose place only a scene can know, and for a box
    where space is periodic in both directions.
    """
    if names(scene, effect):
        return scene
    if effect == "walls":
        raise ValueError(f"{scene.name}: no boundary particles can be added")
    if effect == "box":
        return replace(scene, walls=_boxed(scene))
    return _with_effect(scene, effect, TYPICAL[effect](scene))


def _with_effect(scene: Scene, effect: str, value: Any) -> Scene:
    return replace(scene, effects=replace(scene.effects, **{effect: value}))


def _boxed(scene: Scene) -> Walls:
    """Return the scene's walls with a box around the fluid that it doesn't touch at first."""
    x, y = np.asarray(scene.x).T
    margin, walls = 10 * scene.h, scene.walls or Walls()
    if walls.period_x is not None and walls.period_y is not None:
        raise ValueError(f"{scene.name}: no box can be added")
    box = [x.min() - margin, x.max() + margin, y.min() - margin, math.inf]
    for axis, period in enumerate((walls.period_x, walls.period_y)):
        if period is not None:
            box[2 * axis : 2 * axis + 2] = -math.inf, math.inf
    return replace(walls, box=tuple(box))
