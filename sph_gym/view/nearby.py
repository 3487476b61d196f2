"""Neighbours in plain arrays, for states that no running solver is behind."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.thickness import close_pairs

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

    x: (n, 2) positions [m], fluid first; h: support radius [m]; periods: at least 2 h each.
    """
    counts, nearest = np.zeros(n_fluid, np.int32), np.full(n_fluid, np.inf)
    place, owner = _with_images(np.asarray(x, dtype=float), h, periods)
    fluid = place[: np.isfinite(x[:n_fluid]).all(axis=1).sum()]
    for k, image, distance in close_pairs(fluid, place, h) if len(fluid) else ():
        i, j = owner[k], owner[image]
        counts += np.bincount(i[i != j], minlength=n_fluid).astype(np.int32)
        of_fluid = (i != j) & (j < n_fluid)
        np.minimum.at(nearest, i[of_fluid], distance[of_fluid])
    return Surroundings(counts, nearest)


def _with_images(x: Array, h: float, periods: Periods) -> tuple[Array, Array]:
    """Return (k, 2) places of all particles that have one, and (k,) whose place each is.

    After the particles come the images of those that are nearer than h to a periodic side.
    """
    owner = np.flatnonzero(np.isfinite(x).all(axis=1))
    place = x[owner]
    for axis, period in enumerate(periods):
        if not np.isfinite(period) or not len(place):
            continue
        along, low = place[:, axis], place[:, axis].min()
        along[:] = low + (along - low) % period
        at_low, at_high = along < low + h, along > low + period - h
        step = np.where(np.arange(2) == axis, period, 0.0)
        place = np.concatenate([place, place[at_low] + step, place[at_high] - step])
        owner = np.concatenate([owner, owner[at_low], owner[at_high]])
    return place, owner
