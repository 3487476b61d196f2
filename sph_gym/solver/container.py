"""The container of a fluid: how low its centre of mass can be without a loss of volume."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.gravity import Gravity
from sph_gym.solver.state import Floats
from sph_gym.solver.walls import Walls

# Cells of the map at most, so that it is made in milliseconds.
MOST_CELLS = 1e6

Mask = NDArray[np.bool_]


class Fill(NamedTuple):
    """A container, filled as low as its fluid can lie.

    lowest: height of the centre of mass then; floor: height of the lowest place; left, right: its
    sides; all in [m].
    """

    lowest: float
    floor: float
    left: float
    right: float


def lowest_fill(scene: Any) -> Fill | None:
    """Return how low the fluid can lie in its container.

    The fluid fills the lowest places that it can get to. None where walls don't hold it from all
    sides and from below, where they move, and where the domain is periodic in y.
    """
    walls, dx = scene.walls, scene.dx
    if walls is None or walls.motion is not None or walls.period_y is not None:
        return None
    x = np.asarray(scene.x)
    low, shape = _frame(x, walls, dx)
    if low is None or np.prod(shape) > MOST_CELLS:
        return None
    free = _free(low, shape, walls, dx)
    rim = min(_rim(low, shape, walls, dx), _highest(low, shape, scene))
    columns, rows = np.floor((x - low) / dx).astype(int).T
    seed = np.zeros(shape, bool)
    seed[columns, np.minimum(rows, rim)] = True
    free[:, rim + 1 :] = False
    free &= seed | ~_beside_plates(low, shape, walls, dx)
    region = _fill(free, seed)
    open_sides = walls.period_x is None and (region[0].any() or region[-1].any())
    if open_sides or region[:, 0].any() or region.sum() < len(x):
        return None
    number = region.sum(axis=0)
    filled = np.diff(np.minimum(np.cumsum(number), len(x)), prepend=0)
    y = low[1] + (np.arange(len(number)) + 0.5) * dx
    wide = np.flatnonzero(region.any(axis=1))
    floor = float(y[np.argmax(number > 0)]) - dx / 2
    sides = (float(low[0] + dx * place) for place in (wide[0], wide[-1] + 1))
    return Fill(float(filled @ y / len(x)), floor, *sides)


def _rim(low: Floats, shape: tuple[int, int], walls: Walls, dx: float) -> int:
    """Return the highest row of a map that walls hold from the sides: over a rim, fluid leaves."""
    boxed = walls.box is not None and math.isfinite(walls.box[0]) and math.isfinite(walls.box[1])
    if boxed or walls.period_x is not None:
        return shape[1] - 1
    tops = [float(low[1])]
    if walls.particles is not None:
        tops.append(float(np.asarray(walls.particles)[:, 1].max()) + dx / 2)
    if walls.plates is not None:
        tops.append(float(np.asarray(walls.plates)[:, 1::2].max()))
    return max(math.floor((max(tops) - low[1]) / dx + 1e-6) - 1, 0)


def _highest(low: Floats, shape: tuple[int, int], scene: Any) -> int:
    """Return the highest row of a map that uniform gravity lets the fluid rise to."""
    field = scene.effects.field
    if not isinstance(field, Gravity) or not field.y < 0:
        return shape[1] - 1
    speed2 = float((np.asarray(scene.v) ** 2).sum(axis=1).max())
    rise = np.asarray(scene.x)[:, 1].max() - low[1] + speed2 / (2 * abs(field.y))
    return int(min(rise / scene.dx + 1, shape[1] - 1))


def _frame(x: Floats, walls: Walls, dx: float) -> tuple[Any, tuple[int, int]]:
    """Return the lower corner [m] of a map in step with the fluid, and its shape, in cells of dx.

    It has a margin of two cells on all sides.
    """
    points = [x]
    if walls.particles is not None:
        points.append(np.asarray(walls.particles))
    if walls.plates is not None:
        points.append(np.asarray(walls.plates).reshape(-1, 2))
    if walls.box is not None:
        ends = np.array(walls.box).reshape(2, 2).T
        points.append(np.where(np.isfinite(ends), ends, x.min(axis=0)))
    together = np.concatenate(points)
    first = x.min(axis=0) - dx / 2
    low = first - (np.ceil((first - together.min(axis=0)) / dx - 1e-6) + 2) * dx
    extent = (together.max(axis=0) - low) / dx
    if not (extent < MOST_CELLS).all():
        return None, (0, 0)
    columns, rows = (np.ceil(extent).astype(int) + 3).tolist()
    return low, (columns, rows)


def _free(low: Floats, shape: tuple[int, int], walls: Walls, dx: float) -> Mask:
    """Return the cells of a map that boundary particles, box and periodic domain leave free."""
    free = np.ones(shape, bool)
    if walls.particles is not None:
        free[tuple(np.floor((np.asarray(walls.particles) - low) / dx).astype(int).T)] = False
    for ends in _sides(walls):
        inside = [
            (place > end[0]) & (place < end[1])
            for n, corner, end in zip(shape, low, ends, strict=True)
            for place in [corner + (np.arange(n) + 0.5) * dx]
        ]
        free &= inside[0][:, None] & inside[1]
    return free


def _beside_plates(low: Floats, shape: tuple[int, int], walls: Walls, dx: float) -> Mask:
    """Return the cells of a map along plates, on both sides of them."""
    beside = np.zeros(shape, bool)
    for plate in () if walls.plates is None else np.asarray(walls.plates):
        along = plate[2:] - plate[:2]
        length = float(np.hypot(*along))
        share = np.linspace(0.0, 1.0, min(math.ceil(4 * length / dx), 4 * sum(shape)) + 1)
        normal = np.array([-along[1], along[0]]) * (dx / 2 / length)
        for side in (-1, 0, 1):
            cells = np.floor((plate[:2] + share[:, None] * along + side * normal - low) / dx)
            within = cells[((cells >= 0) & (cells < shape)).all(axis=1)].astype(int)
            beside[tuple(within.T)] = True
    return beside


def _sides(walls: Walls) -> Iterator[tuple[Any, Any]]:
    """Yield the ends along x and y [m] of what bounds the fluid: the box, a periodic domain."""
    if walls.box is not None:
        yield walls.box[:2], walls.box[2:]
    if walls.period_x is not None:
        yield walls.period_x, (-math.inf, math.inf)


def _fill(free: Mask, seed: Mask) -> Mask:
    """Return all free cells that are connected with the free ones of `seed` along the axes."""
    region, before = seed & free, -1
    while (size := int(region.sum())) > before:
        before = size
        region = _flood(free.T, _flood(free, region).T).T
    return region


def _flood(free: Mask, region: Mask) -> Mask:
    """Return the runs of free cells along the last axis that the region is part of."""
    ends = np.ones((len(free), 1), bool)
    runs = np.cumsum(np.concatenate([ends, ~free], axis=1).ravel()).reshape(len(free), -1)[:, 1:]
    reached = np.zeros(int(runs[-1, -1]) + 1, bool)
    reached[runs[region]] = True
    return free & reached[runs]
