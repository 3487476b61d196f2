"""Smoothing kernels in two dimensions: a density kernel and the gradient that goes with it.

`h` is the SUPPORT radius: W = 0 from r = h on. Each kernel is a family member of three functions
that return *shapes*; the constant in front is a field (`weight_scale`, `gradient_scale`,
`viscosity_scale`) and is multiplied once a particle instead of once a pair:

    W(r)              = weight_scale * weight(kernel, r2, r)                            [1/m^2]
    -(dW/dr)/r        = gradient_scale * gradient(kernel, r2, r, inv_r)                 [1/m^4]
    Laplacian weight  = viscosity_scale * viscosity(kernel, r2, r)                      [1/m^4]

Shapes are in the precision of the particles, scales always in float64: alone, 1/h^8 leaves the
range of float32. Shapes are meant for r2 < `h2`; the pair loops mask what lies beyond.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.jit import dispatch


class Mueller(NamedTuple):
    """The article's trio: poly6 for densities, spiky for pressure, its own Laplacian for viscosity.

    Not a matched pair: without any dissipation it is linearly unstable for h/dx >= 2.2.
    Source: Mueller, Charypar, Gross 2003, renormalised in 2D (spiky gradient: -30 / (pi h^5)).
    """

    h: float
    h2: float
    two_h: float
    weight_scale: float
    gradient_scale: float
    viscosity_scale: float


class WendlandC2(NamedTuple):
    """A matched pair: the gradient is the derivative of the density kernel. For accuracy work.

    Source: Wendland 1995; Dehnen & Aly 2012, table 1. Laplacian: Morris, Fox, Zhu 1997, eq. 22.
    """

    h: float
    h2: float
    quarter_h: float
    weight_scale: float
    gradient_scale: float
    viscosity_scale: float


@dispatch
def weight(kernel: Any, r2: Any, r: Any) -> Any:
    """Shape of W at distance r (r2 = r^2)."""


@dispatch
def gradient(kernel: Any, r2: Any, r: Any, inv_r: Any) -> Any:
    """Shape of -(dW/dr)/r at distance r; positive, so that pressure pushes apart."""


@dispatch
def viscosity(kernel: Any, r2: Any, r: Any) -> Any:
    """Shape of the weight w in  laplacian(f)_i = sum_j V_j (f_j - f_i) w_ij."""


@weight.member(Mueller)
def _poly6(kernel, r2, r):
    t = kernel.h2 - r2
    return t * t * t


@gradient.member(Mueller)
def _spiky(kernel, r2, r, inv_r):
    # (h - r)^2 / r without a subtraction of r, which a lane would need a second root for
    return (kernel.h2 + r2) * inv_r - kernel.two_h


@viscosity.member(Mueller)
def _mueller_viscosity(kernel, r2, r):
    return kernel.h - r


@weight.member(WendlandC2)
def _wendland(kernel, r2, r):
    t = kernel.h - r
    return t * t * (t * t) * (kernel.quarter_h + r)


@gradient.member(WendlandC2)
def _wendland_gradient(kernel, r2, r, inv_r):
    t = kernel.h - r
    return t * t * t


@viscosity.member(WendlandC2)
def _wendland_viscosity(kernel, r2, r):
    t = kernel.h - r
    return t * t * t


def make_mueller(h: float, dtype: type = np.float64) -> Mueller:
    """The Mueller kernels with support radius h [m]."""
    scales = (4 / (math.pi * h**8), 30 / (math.pi * h**5), 40 / (math.pi * h**5))
    return Mueller(dtype(h), dtype(h * h), dtype(2 * h), *scales)


def make_wendland_c2(h: float, dtype: type = np.float64) -> WendlandC2:
    """The Wendland C2 kernel with support radius h [m]."""
    scales = (28 / (math.pi * h**7), 140 / (math.pi * h**7), 280 / (math.pi * h**7))
    return WendlandC2(dtype(h), dtype(h * h), dtype(h / 4), *scales)


KERNELS: dict[str, Callable[..., Any]] = {"mueller": make_mueller, "wendland_c2": make_wendland_c2}


def density_kernel(kernel: Any, r: np.ndarray) -> np.ndarray:
    """W(r) [1/m^2] with its constant and its cut at h, for any array of distances [m]."""
    r = np.asarray(r, dtype=np.float64)
    inside = r < kernel.h
    return np.where(inside, kernel.weight_scale * weight(kernel, r * r, r), 0.0)


def calibrated_mass(kernel: Any, rho0: float, dx: float) -> float:
    """Particle mass per metre of depth [kg/m] that gives rho0 on the square lattice of spacing dx.

    rho0 dx^2 misses the rest density by up to 1.5 %, which is a pressure of 0.016 rho0 c^2.
    """
    reach = np.arange(-math.ceil(kernel.h / dx), math.ceil(kernel.h / dx) + 1) * dx
    return float(rho0 / density_kernel(kernel, np.hypot(*np.meshgrid(reach, reach))).sum())
