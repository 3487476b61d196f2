"""Scenes with one of their effects left out, or with one more."""

import dataclasses
import math
from typing import Any

import numpy as np

from sph_gym.solver.scene import Effects, Scene
from sph_gym.solver.walls import PRESSURES, SLIPS, Walls

# Effects of the whole fluid and what is added where a scene doesn't name them; alpha, then nu in
# h c0 and sigma in rho0 c0^2 h, far inside what the time step allows.
ALPHA, NU, SIGMA = 0.02, 1e-3, 1e-4
UNIFORM = (
    "artificial_viscosity",
    "laminar_viscosity",
    "quadratic_viscosity",
    "tensile_correction",
    "surface_tension",
    "shifting",
    "xsph",
    "gravity",
)
EFFECTS = (*UNIFORM, "box", "walls")


def names(scene: Scene, effect: str) -> bool:
    """Whether the scene calls for an effect."""
    if effect == "box":
        return scene.walls is not None and scene.walls.box is not None
    if effect == "walls":
        return scene.walls is not None and scene.walls.particles is not None
    return bool(getattr(scene.effects, effect))


def left_out(scene: Scene, effect: str) -> Scene:
    """The scene without an effect; the same scene if it doesn't name it."""
    if not names(scene, effect):
        return scene
    if effect in UNIFORM:
        return _with_effect(scene, effect, False if effect == "xsph" else None)
    assert scene.walls is not None
    if effect == "box":
        return dataclasses.replace(scene, walls=dataclasses.replace(scene.walls, box=None))
    # with all that only particles have
    bare = dataclasses.replace(
        scene.walls, particles=None, velocity=None, pressure=PRESSURES[0], slip=SLIPS[0]
    )
    return dataclasses.replace(scene, walls=bare)


def added(scene: Scene, effect: str) -> Scene:
    """The scene with an effect; the same scene if it names it already.

    Raises ValueError for walls of particles, whose place only a scene can know, and for a box
    where space is periodic in both directions.
    """
    if names(scene, effect):
        return scene
    if effect == "walls":
        raise ValueError(f"{scene.name}: no boundary particles can be added")
    if effect == "box":
        return dataclasses.replace(scene, walls=_boxed(scene))
    values: dict[str, Any] = {
        "artificial_viscosity": ALPHA,
        "laminar_viscosity": NU * scene.h * scene.fluid.c0,
        "quadratic_viscosity": 2 * ALPHA,
        "tensile_correction": 0.2,
        "surface_tension": SIGMA * scene.fluid.rho0 * scene.fluid.c0**2 * scene.h,
        "shifting": 1.0,
        "xsph": True,
        "gravity": (0.0, -9.81),
    }
    return _with_effect(scene, effect, values[effect])


def _with_effect(scene: Scene, effect: str, value: Any) -> Scene:
    effects: Effects = dataclasses.replace(scene.effects, **{effect: value})
    return dataclasses.replace(scene, effects=effects)


def _boxed(scene: Scene) -> Walls:
    """The scene's walls, with a box around the fluid that it doesn't touch at first."""
    x, y = np.asarray(scene.x).T
    margin, walls = 10 * scene.h, scene.walls or Walls()
    if walls.period_x is not None and walls.period_y is not None:
        raise ValueError(f"{scene.name}: no box can be added")
    box = [x.min() - margin, x.max() + margin, y.min() - margin, math.inf]
    for axis, period in enumerate((walls.period_x, walls.period_y)):
        if period is not None:
            box[2 * axis : 2 * axis + 2] = -math.inf, math.inf
    return dataclasses.replace(walls, box=tuple(box))
