"""The stress in the outermost layer that makes a given surface tension.

n is the gradient of the share of space that is filled, n = sum V grad W: zero inside, and about
1 / h in a layer at the surface. The stress K (|n| - n n / |n|) pulls along the surface and not
across it. What is transmitted across a cut through a lattice below a surface, by the pair forces
V^2 (stress_i + stress_j) . grad W, adds up row by row to

    sigma = K dx sum of |n| C,      C = sum V x^2 / r |W'| (1 - share):

C is the share of a full neighbourhood that a row has along the surface, 1 inside and about a half
in the first row, less what is held back between near neighbours. (In a continuum that holds
nothing back, K / sigma is one over the integral of C dC from 1/2 to 1, for every kernel: 8/3, and
not the 2 of the whole step in C, since nothing outside pulls the outermost layer.)

A stress along a surface is not the gradient of an energy: the disorder of the layer that it acts in
takes energy out of it, and a drop without viscosity boils. So that layer has friction of its own,
between particles that part or approach, as strong as a viscosity of FRICTION sqrt(sigma h / rho0).
The layer is as thin as h, so that the drop as a whole hardly feels it, the less the finer it is.
"""

import math
from typing import Any

import numpy as np

from sph_gym.solver.kernels import density_kernel

# W = scale (h - r)^4 (h / 4 + r), Wendland's C2, whichever kernel the fluid has: of it
# - W' / r = SHAPE_SCALE / h^7 (h - r)^3.
SHAPE_SCALE = 140 / math.pi
# Share of 1 / h: an n that is smaller is disorder and counts with its square.
DISORDER = 0.3
# The share (W(r) / W(dx))^4 of the pull that is held back: without it, the particles of the
# surface pull themselves together to knots.
HELD_BACK = 0.45
# Viscosity of the layer in sqrt(sigma h / rho0). Measured on water drops (Ohnesorge number 0.004,
# radius 16 to 32 dx, h / dx from 2.3 to 4): at 3 drops boil under Wendland's kernel, at 5 under
# cubic splines, at 8 fine ones of Wendland's kernel, at 12 none.
FRICTION = 12.0
# Longest stable step as a share of h^2 / viscosity of the layer, five sixths of the measured 0.25.
FRICTION_SHARE = 0.2
# Drops of h / dx = 3.2 ring in Rayleigh's period; one more of it makes them this share stiffer.
STIFFER, RIGHT_SUPPORT = 0.115, 3.2


def calibrated_stress(sigma: float, kernel: Any, volume: float, dx: float) -> float:
    """K [N/m] for a surface tension sigma [N/m], the fluid's kernel, a particle's volume at rest
    [m^2] and a spacing [m].
    """
    h, depths = kernel.h, math.ceil(kernel.h / dx)
    reach = np.arange(-depths, depths + 1) * dx
    x, z = np.meshgrid(reach, reach)
    r = np.hypot(x, z)
    slope = volume * SHAPE_SCALE / h**7 * np.maximum(h - r, 0.0) ** 3
    near = density_kernel(kernel, r) * inverse_weight(kernel, dx)
    across = (slope * z).sum(axis=1)
    along = (slope * x**2 * (1 - HELD_BACK * near**4)).sum(axis=1)
    # all rows below, and those above that there are: none for the first, one for the second ...
    rows = range(depths + 1, 2 * depths + 2)
    n = np.array([across[:k].sum() for k in rows])
    completeness = np.array([along[:k].sum() for k in rows])
    softened = n**2 / np.hypot(n, DISORDER / h)
    measured = 1 - STIFFER * (h / dx - RIGHT_SUPPORT)
    return float(measured * sigma / (dx * (softened * completeness).sum()))


def layer_viscosity(sigma: float, h: float, rho0: float) -> float:
    """Return the viscosity [m^2/s] of the layer in which a surface tension sigma [N/m] pulls."""
    return FRICTION * math.sqrt(sigma * h / rho0)


def inverse_weight(kernel: Any, dx: float) -> float:
    """1 / W(dx) [m^2]; 0 where h = dx and no particle at rest is near."""
    at_dx = float(density_kernel(kernel, np.array([dx]))[0])
    return 1 / at_dx if at_dx > 0 else 0.0
