"""Neighbours in plain arrays, for states that no running solver is behind."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
# Lengths after which space closes upon itself [m], infinite where it doesn't.
Periods = tuple[float, float]
OPEN: Periods = (np.inf, np.inf)


class Surroundings(NamedTuple):
    """The neighbourhood of every fluid particle.

    counts: (n_fluid,) others within the support, walls included; nearest: (n_fluid,) distance to
    the nearest other fluid particle [m], infinite if none is within the support.
    """

    counts: Array
    nearest: Array


def nearest_images(way: Array, periods: Periods) -> Array:
    """Return (n, 2) differences of positions [m] to the nearest image in a periodic domain."""
    way = np.array(way, dtype=float)
    for axis, period in enumerate(periods):
        if np.isfinite(period):
            way[:, axis] -= period * np.round(way[:, axis] / period)
    return way


def neighbors_of(x: Array, i: int, h: float, periods: Periods = OPEN) -> tuple[Array, Array]:
    """Return the indices of all others within h [m] of particle i, nearest first, and distances.

    x: (n, 2) [m]; particles whose position isn't a number have no neighbours and are none.
    """
    distance = np.hypot(*nearest_images(x - x[i], periods).T)
    distance[i] = np.nan
    with np.errstate(invalid="ignore"):
        near = np.flatnonzero(distance < h)
    near = near[np.argsort(distance[near], kind="stable")]
    return near, distance[near]


def surroundings(x: Array, n_fluid: int, h: float, periods: Periods = OPEN) -> Surroundings:
    """Return how many neighbours each fluid particle has, and how far the nearest one is.

    x: (n, 2) positions [m], fluid first; h: support radius [m]. A cell list in numpy: 5,000
    particles take a hundredth of a second or two.
    """
    counts, nearest2 = np.zeros(n_fluid, np.int32), np.full(n_fluid, np.inf)
    for i, j, r2 in _pairs(np.asarray(x, dtype=float), n_fluid, h, periods):
        counts += np.bincount(i, minlength=n_fluid).astype(np.int32)
        of_fluid = j < n_fluid
        np.minimum.at(nearest2, i[of_fluid], r2[of_fluid])
    return Surroundings(counts, np.sqrt(nearest2))


def _pairs(x: Array, n_fluid: int, h: float, periods: Periods) -> Any:
    """Yield fluid particles i, others j within h, and squared distances, a part at a time."""
    wrapped = x.copy()
    finite: Array = np.asarray(np.isfinite(x).all(axis=1))
    low = x[finite].min(axis=0) if finite.any() else np.zeros(2)
    n_cells = np.zeros(2, np.int64)
    for axis, period in enumerate(periods):
        if np.isfinite(period):
            wrapped[:, axis] = low[axis] + (x[:, axis] - low[axis]) % period
            # cells of a periodic axis fill it exactly; fewer than three would be visited twice
            n_cells[axis] = max(int(period / h), 1)
    width = np.where(n_cells > 0, np.array(periods) / np.maximum(n_cells, 1), h)
    with np.errstate(invalid="ignore"):
        # far strays share the last cell of the numbering, which costs time and nothing else
        cell = np.clip(np.floor((wrapped - low) / width), 0, 2**30)
    cell = np.where(finite[:, None], cell, 2**30).astype(np.int64)
    key = cell[:, 0] * 2**31 + cell[:, 1]
    order = np.argsort(key, kind="stable")
    sorted_key = key[order]
    fluid = np.flatnonzero(finite[:n_fluid])
    for step in _steps(n_cells):
        other = cell[fluid] + step
        for axis in (0, 1):
            if n_cells[axis] > 0:
                other[:, axis] %= n_cells[axis]
        wanted = other[:, 0] * 2**31 + other[:, 1]
        first = np.searchsorted(sorted_key, wanted, "left")
        number = np.searchsorted(sorted_key, wanted, "right") - first
        number[(other < 0).any(axis=1)] = 0
        i = np.repeat(fluid, number)
        within = np.arange(len(i)) - np.repeat(np.cumsum(number) - number, number)
        j = order[np.repeat(first, number) + within]
        r2 = (nearest_images(x[i] - x[j], periods) ** 2).sum(axis=1)
        near = (r2 < h * h) & (i != j)
        yield i[near], j[near], r2[near]


def _steps(n_cells: Array) -> Array:
    """Return the (k, 2) steps to neighbouring cells: on a short periodic axis each cell once."""
    along = [np.array([-1, 0, 1]) if n == 0 or n >= 3 else np.arange(n) for n in n_cells]
    return np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 2)
