"""Velocities of a particle solver at places where no particle is."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sph_gym.solver.checks import finite_array
from sph_gym.solver.periodic import make_period, nearest_image
from sph_gym.solver.simulation import Simulation

# Pairs of a point and a particle that are looked at together: some ten megabytes.
CHUNK = 1_000_000


def interpolate(sim: Simulation, points: ArrayLike, walls: bool = True) -> NDArray[np.float64]:
    """Return velocities (n, 2) [m/s] at points (n, 2) [m]: weighted means of those within h.

    walls: whether boundary particles count, with the velocity of the wall. NaN where no particle
    is within h. Weights: Wendland C2 with the scene's support radius, whatever the scene's kernel,
    since their sum is divided out. Source: Shepard 1968.
    """
    points = finite_array("points", points, ("n", 2))
    n = sim.n_particles if walls else sim.n_fluid
    x, v = sim.x[:n].astype(np.float64), sim.v[:n].astype(np.float64)
    means = np.full((len(points), 2), np.nan)
    step = max(CHUNK // n, 1)
    for first in range(0, len(points), step):
        some = slice(first, first + step)
        w = _weights(sim, points[some], x)
        total = w.sum(axis=1)
        near = total > 0
        means[some][near] = (w @ v)[near] / total[near, None]
    return means


def _weights(
    sim: Simulation, points: NDArray[np.float64], x: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return weights (n_points, n_particles), through the periodic ends where there are any."""
    walls = sim.scene.walls
    ends = (None, None) if walls is None else (walls.period_x, walls.period_y)
    d = [points[:, None, axis] - x[:, axis] for axis in (0, 1)]
    for axis in (0, 1):
        if ends[axis] is not None:
            period = make_period(ends[axis], np.float64)
            d[axis] = nearest_image(period, d[axis])
    q = np.minimum(np.hypot(*d) / sim.scene.h, 1.0)
    return (1 - q) ** 4 * (1 + 4 * q)
