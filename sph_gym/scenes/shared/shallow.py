"""Shallow water: a dam that breaks over a wet bed, and the depths in a simulation."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.simulation import Simulation


class Stoker(NamedTuple):
    """Plateau behind the bore over a wet bed: depth [m] and speed [m/s]; and the bore's speed.

    The plateau's water has come through a rarefaction (u + 2 c is kept) and through the bore,
    which moves at `bore` [m/s] (mass and momentum are kept). Source: Stoker 1957, section 10.8.
    """

    depth: float
    speed: float
    bore: float


def stoker(behind: float, ahead: float, gravity: float) -> Stoker:
    """Return the plateau between still water of depths [m], behind > ahead > 0."""

    def through_bore(depth: float) -> float:
        return (depth - ahead) * math.sqrt(gravity / 2 * (depth + ahead) / (depth * ahead))

    def through_rarefaction(depth: float) -> float:
        return 2 * (math.sqrt(gravity * behind) - math.sqrt(gravity * depth))

    low, high = ahead, behind
    for _ in range(100):
        middle = (low + high) / 2
        if through_bore(middle) < through_rarefaction(middle):
            low = middle
        else:
            high = middle
    speed = through_bore(high)
    return Stoker(high, speed, speed * high / (high - ahead))


def depths(sim: Simulation) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return middles (n,) of columns as wide as h [m], and the depths (n,) of the water there [m].

    By the volume of its particles, so that spray counts for no more than it is.
    """
    scene, x = sim.scene, sim.x[: sim.n_fluid, 0].astype(float)
    n = max(math.ceil((x.max() - x.min()) / scene.h), 1)
    count, ends = np.histogram(x, bins=x.min() + scene.h * np.arange(n + 1))
    return (ends[1:] + ends[:-1]) / 2, count * scene.dx**2 / scene.h


def bore(sim: Simulation, depth: float) -> float:
    """Return the rightmost place [m] where the water is deeper than `depth`, interpolated."""
    x, found = depths(sim)
    deep = np.flatnonzero(found > depth)
    if len(deep) == 0:
        return 0.0
    last = int(deep[-1])
    if last == len(x) - 1:
        return float(x[-1])
    share = (found[last] - depth) / (found[last] - found[last + 1])
    return float(x[last] + share * (x[last + 1] - x[last]))


def bore_speed(
    times: NDArray[np.float64], places: NDArray[np.float64], dam: float, wall: float
) -> float:
    """Return the speed of a bore [m/s] between a tenth and half of the way from dam to wall.

    times, places: (n,) [s] and [m]; dam, wall: [m]. Before, water still falls; later, the
    friction of the floor tells. nan if the bore was hardly seen there.
    """
    way = (places - dam) / (wall - dam)
    there = (way > 0.1) & (way < 0.5)
    if there.sum() < 3:
        return math.nan
    return float(np.polyfit(times[there], places[there], 1)[0])
