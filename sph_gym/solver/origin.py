"""The origin of positions: near the particles, where float32 has its digits.

A step moves a particle by a small part of dx. In single precision, far from the origin, that is
less than the distance between two numbers, and the fluid silently stands still.
"""

import dataclasses
from typing import Any

import numpy as np

from sph_gym.solver.gravity import CentralGravity, RollingTank
from sph_gym.solver.scene import Scene
from sph_gym.solver.state import Floats
from sph_gym.solver.walls import Walls

# Share of dx: places that are no farther apart are as good as continuous. In a slow flow, at a
# thousandth of the sound speed, a step is a few 1e-4 dx.
FINE = 1e-5


def origin(scene: Scene, dtype: Any) -> Floats:
    """(2,) the point [m] from which positions are counted: a multiple of dx, mostly zero.

    Zero wherever `dtype` tells places in the middle of the fluid apart well enough, so that numbers
    stay what the user gave.
    """
    # the median: a stray may be anywhere
    middle = np.median(np.asarray(scene.x), axis=0)
    if float(np.finfo(dtype).eps) * float(np.abs(middle).max()) <= FINE * scene.dx:
        return np.zeros(2)
    return np.asarray(np.rint(middle / scene.dx) * scene.dx)


def moved(scene: Scene, by: Floats) -> Scene:
    """Return the scene with everything that has a place displaced by (2,) [m]."""
    if not by.any():
        return scene
    effects = dataclasses.replace(scene.effects, gravity=_moved_field(scene.effects.field, by))
    return dataclasses.replace(
        scene, x=np.asarray(scene.x) + by, walls=_moved_walls(scene.walls, by), effects=effects
    )


def _moved_field(field: Any, by: Floats) -> Any:
    if isinstance(field, CentralGravity):
        return dataclasses.replace(field, x=field.x + by[0], y=field.y + by[1])
    if isinstance(field, RollingTank):
        return dataclasses.replace(field, pivot=tuple(np.add(field.pivot, by)))
    return field


def _moved_walls(walls: Walls | None, by: Floats) -> Walls | None:
    if walls is None:
        return None
    present = {
        "particles": (walls.particles, by),
        "box": (walls.box, np.repeat(by, 2)),
        "plates": (walls.plates, np.tile(by, 2)),
        "period_x": (walls.period_x, by[0]),
        "period_y": (walls.period_y, by[1]),
    }
    changes: dict[str, Any] = {
        name: np.add(place, shift) for name, (place, shift) in present.items() if place is not None
    }
    for name in ("box", "period_x", "period_y"):
        if name in changes:
            changes[name] = tuple(changes[name].tolist())
    return dataclasses.replace(walls, **changes)
