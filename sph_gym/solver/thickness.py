"""The thickness of walls of boundary particles, measured from the particles themselves.

The measure is the kernel sum of boundary particles over each other, as a share of that of a full
lattice: 1 deep inside of a wall, and the less, the fewer layers a wall has.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.kernels import ALL_KERNELS, density_kernel
from sph_gym.solver.state import Floats

# Places along an axis that are told apart by cells.
MOST_CELLS = 2.0**30
# Points whose pairs are held at one time.
BLOCK = 20_000
# Multiple of dx: nearer boundary particles are neighbours in one wall.
LINK = 1.5


class Thickness(NamedTuple):
    """A measure of each of n boundary particles.

    share: (n,) largest kernel sum within h, as a share of a full lattice; gap: (n,) distance to
    the nearest other [m], infinite if none is within h.
    """

    share: Floats
    gap: Floats


def close_pairs(x: Floats, others: Floats, reach: float) -> Iterator[tuple[NDArray[Any], ...]]:
    """Yield i, j and the distance [m] of all pairs nearer than `reach` [m], some at a time.

    x, others: (n, 2), (m, 2) [m]; all pairs of one i come together.
    """
    low, high = others.min(axis=0) - reach, others.max(axis=0) + reach
    near = np.flatnonzero(((x >= low) & (x <= high)).all(axis=1))
    side = max(reach, float((high - low).max()) / MOST_CELLS)
    rows = 2 * MOST_CELLS
    keys = np.floor((others - low) / side) @ (rows, 1.0)
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    for block in range(0, len(near), BLOCK):
        chosen = near[block : block + BLOCK]
        mine = np.floor((x[chosen] - low) / side) @ (rows, 1.0)
        columns = mine[:, None] + rows * np.arange(-1, 2)
        first = np.searchsorted(keys, columns - 1, "left").ravel()
        number = np.searchsorted(keys, columns + 1, "right").ravel() - first
        starts = np.repeat(first - (np.cumsum(number) - number), number)
        i = np.repeat(np.repeat(chosen, 3), number)
        j = order[starts + np.arange(len(starts))]
        distance = np.hypot(*(x[i] - others[j]).T)
        within = distance < reach
        yield i[within], j[within], distance[within]


def measure(particles: Floats, kernel: str, h: float, dx: float) -> Thickness:
    """Return the thickness of walls of boundary particles at (n, 2) [m]."""
    n, shape = len(particles), ALL_KERNELS[kernel](h)
    sums, gap = np.zeros(n), np.full(n, math.inf)
    for i, j, distance in close_pairs(particles, particles, h):
        sums += np.bincount(i, density_kernel(shape, distance), n)
        other = i != j
        np.minimum.at(gap, i[other], distance[other])
    share, full = sums.copy(), layer_share(math.inf, kernel, h, dx)
    for i, j, _ in close_pairs(particles, particles, h):
        np.maximum.at(share, i, sums[j])
    return Thickness(share / full, gap)


def needed_layers(h: float, dx: float) -> int:
    """Return how many layers fill the support of a particle at the face of a wall."""
    return math.ceil(h / dx - 1e-9)


def layer_share(layers: float, kernel: str, h: float, dx: float) -> float:
    """Return the `Thickness.share` of a wall of so many layers; of infinitely many, the sum."""
    places = np.arange(-needed_layers(h, dx), needed_layers(h, dx) + 1) * dx
    x, y = np.meshgrid(places, places)
    rows = density_kernel(ALL_KERNELS[kernel](h), np.hypot(x, y)).sum(axis=1)
    if math.isinf(layers):
        return float(rows.sum())
    depth = np.arange(len(rows)) - len(rows) // 2
    inside = (depth >= -((layers - 1) // 2)) & (depth <= layers // 2)
    return float(rows[inside].sum() / rows.sum())


def count_layers(share: float, kernel: str, h: float, dx: float) -> int:
    """Return the number of layers whose share is nearest to a measured one."""
    n = range(1, 2 * needed_layers(h, dx))
    shares = np.array([layer_share(each, kernel, h, dx) for each in n])
    return n[int(np.argmin(np.abs(shares - share)))]


def is_linked(thickness: Thickness, dx: float) -> NDArray[np.bool_]:
    """Return (n,) which boundary particles have a neighbour in one wall with them."""
    linked: NDArray[np.bool_] = thickness.gap < LINK * dx
    return linked
