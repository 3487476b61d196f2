"""How strong a pairwise cohesion makes a given surface tension.

The force between two particles is s q (1 - q)^2 (zero - q) along their line, q = r/h, repulsive
where positive. Summed over the rest lattice it has no virial, if `zero` is chosen so, and thus no
pressure of its own; the work of cutting the lattice in two is twice the surface tension.
Source: Tartakovsky & Panchenko 2016, sections 3 and 4, with sums over the lattice in place of
integrals.
"""

import math

import numpy as np
from numpy.polynomial import Polynomial


def calibrated_cohesion(sigma: float, h: float, dx: float) -> tuple[float, float]:
    """(s [N/m], zero) for a surface tension sigma [N/m] at support radius h and spacing dx [m]."""
    q, rows = _lattice(h, dx)
    rest2 = q**2 * (1 - q) ** 2
    # rows above and below are the whole lattice but for the particle's own row
    shares = np.where(rows > 0, 2, 1)
    zero = float((shares * q * rest2).sum() / (shares * rest2).sum())
    force = Polynomial([0, 1]) * Polynomial([1, -1]) ** 2 * Polynomial([zero, -1])
    energy = force.integ()
    # both halves of the lattice hold on to each other across a line, dx of it per column
    work = -float((rows * h * (energy(1.0) - energy(q))).sum()) / dx
    return 2 * sigma / work, zero


def _lattice(h: float, dx: float) -> tuple[np.ndarray, np.ndarray]:
    """q of the neighbours within h of a lattice point, but for those below; rows above it."""
    reach = math.ceil(h / dx)
    i, j = np.meshgrid(np.arange(-reach, reach + 1), np.arange(reach + 1))
    q = np.hypot(i, j) * dx / h
    near = (q < 1) & (q > 0)
    return q[near], j[near]
