"""Walls: boundary particles that push back before a particle arrives, and a box that clamps."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sph_gym.solver.checks import finite_array, in_range, positive
from sph_gym.solver.jit import jitable
from sph_gym.solver.lanes import maximum, minimum, select
from sph_gym.solver.state import Floats


class Box(NamedTuple):
    """Clamping walls in the precision of the arrays: sides [m], restitution in [0, 1]."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float
    restitution: float


@jitable
def reflect(low, high, restitution, x, u):
    """Put a particle back onto the side that it passed and turn its normal velocity round.

    Position and velocity both: with the position alone it would press into the wall for ever.
    A position that is not a number stays one.
    """
    bounced = -restitution * u
    u = select(x < low, maximum(bounced, u), u)
    u = select(x > high, minimum(bounced, u), u)
    return minimum(high, maximum(low, x)), u


@jitable
def confine(box, x, y, u, v):
    """`reflect` at the four sides of the box, where there is one."""
    if box is None:
        return x, y, u, v
    x, u = reflect(box.x_min, box.x_max, box.restitution, x, u)
    y, v = reflect(box.y_min, box.y_max, box.restitution, y, v)
    return x, y, u, v


@dataclass(frozen=True, eq=False)
class Walls:
    """The walls of a scene; what is left out costs nothing.

    particles: (n, 2) positions of boundary particles at rest [m]; they take part in density,
    pressure and viscosity exactly like fluid, but not in XSPH.
    box: (x_min, x_max, y_min, y_max) [m], infinite where a side is open: a particle that passes
    a side is clamped to it, and the normal part of its velocity is reflected.
    restitution: share of the normal speed that is left after such a reflection, 0 to 1.

    Raises ValueError for positions that are not finite and of shape (n, 2), n >= 1, for a box
    that isn't four numbers in order, and for a restitution outside [0, 1].
    """

    particles: ArrayLike | None = None
    box: tuple[float, float, float, float] | None = None
    restitution: float = 0.0

    def __post_init__(self) -> None:
        if self.particles is not None:
            positions = finite_array("walls.particles", self.particles, ("n", 2))
            if len(positions) == 0:
                raise ValueError("walls.particles: expected at least one position, got none")
            positions.flags.writeable = False
            object.__setattr__(self, "particles", positions)
        restitution = in_range("walls.restitution", self.restitution, 0.0, 1.0)
        object.__setattr__(self, "restitution", restitution)
        if self.box is not None:
            try:
                sides = tuple(float(side) for side in self.box)
            except (TypeError, ValueError):
                sides = ()
            if len(sides) != 4 or not (sides[0] < sides[1] and sides[2] < sides[3]):
                raise ValueError(
                    "walls.box: expected (x_min, x_max, y_min, y_max) with x_min < x_max and "
                    f"y_min < y_max, got {self.box!r}"
                )
            object.__setattr__(self, "box", sides)


def snap(length: float, dx: float) -> float:
    """The multiple of dx nearest to a length, at least dx: where a lattice of spacing dx fits."""
    return max(round(length / dx), 1) * dx


def lattice(x_min: float, x_max: float, y_min: float, y_max: float, dx: float) -> Floats:
    """Square lattice of spacing dx that fills a rectangle, half a spacing from its lower sides.

    Returns (n, 2) [m]. The upper sides are moved to the nearest multiple of dx: a lattice that
    was stretched to fit would not be at rest density.
    """
    positive("dx", dx)
    nx, ny = (max(round(side / dx), 1) for side in (x_max - x_min, y_max - y_min))
    x, y = x_min + (np.arange(nx) + 0.5) * dx, y_min + (np.arange(ny) + 0.5) * dx
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def tank_particles(width: float, height: float, dx: float, layers: int = 3) -> Floats:
    """Floor and side walls of an open tank, `layers` deep, in step with a lattice of spacing dx.

    The inner faces are x = 0, x = width (to the nearest multiple of dx) and y = 0, the walls at
    least `height` high. Returns (n, 2) [m].
    """
    positive("dx", dx)
    nx, ny = max(round(width / dx), 1), math.ceil(height / dx - 1e-9)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(-layers, nx + layers), np.arange(-layers, ny)))
    outside = (i < 0) | (i >= nx) | (j < 0)
    return (np.stack([i[outside], j[outside]], axis=-1) + 0.5) * dx
