"""Particles for the walls of solvers that know no planes."""

import numpy as np

from sph_gym.doctor.case import Array, Case

# A side without an end is drawn so many spacings farther than the fluid at the start.
BEYOND = 30


def boundary(case: Case) -> Array:
    """Return (m, 2) positions [m] of particles in layers outside the sides of case.box.

    The first layer is half a spacing behind its side, and the layers together are as thick as the
    support. Empty for open space.
    """
    if case.box is None:
        return np.empty((0, 2))
    low, high = np.array(case.box[::2]), np.array(case.box[1::2])
    start = np.where(np.isfinite(low), low, case.x.min(axis=0) - BEYOND * case.dx)
    end = np.where(np.isfinite(high), high, case.x.max(axis=0) + BEYOND * case.dx)
    n = np.maximum(np.rint((end - start) / case.dx), 1)
    layers = np.ceil(case.h / case.dx)
    columns, rows = (
        start[k] + (np.arange(-layers, n[k] + layers) + 0.5) * (end - start)[k] / n[k]
        for k in (0, 1)
    )
    grid = np.stack(np.meshgrid(columns, rows, indexing="ij"), axis=-1).reshape(-1, 2)
    return grid[np.any((grid < low) | (grid > high), axis=1)]
