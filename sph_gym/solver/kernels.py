"""Smoothing kernels in two dimensions: a density kernel and the gradient that goes with it.

`h` is the SUPPORT radius: W = 0 from r = h on, also for the splines, whose authors call a half or
a third of it h. Each kernel is a family member of three functions that return *shapes*; the
constant in front is a field (`weight_scale`, `gradient_scale`, `viscosity_scale`) and is
multiplied once a particle instead of once a pair:

    W(r)              = weight_scale * weight(kernel, r2, r)                            [1/m^2]
    -(dW/dr)/r        = gradient_scale * gradient(kernel, r2, r, inv_r)                 [1/m^4]
    Laplacian weight  = viscosity_scale * viscosity(kernel, r2, r)                      [1/m^4]

Shapes are in the precision of the particles, scales always in float64: alone, 1/h^8 leaves the
range of float32. Shapes are meant for r2 < `h2`; the pair loops mask what lies beyond. They are
finite for coincident particles too, given the r2 > 0 that the pair loops make of r = 0.

`WRONG_KERNELS` are wrong on purpose: what a tool that looks for mistakes has to find.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.jit import dispatch
from sph_gym.solver.lanes import like, maximum, reciprocal, select


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


class Spiky(NamedTuple):
    """A matched pair that pushes hardest where particles touch: the gradient doesn't vanish there.

    Its density is as pointed: uncalibrated it reads 1.27 rho0 on a lattice at h/dx = 2. Its own
    Laplacian is singular at r = 0, hence Mueller's. Source: Desbrun & Gascuel 1996, in 2D.
    """

    h: float
    h2: float
    two_h: float
    weight_scale: float
    gradient_scale: float
    viscosity_scale: float


class CubicSpline(NamedTuple):
    """A matched pair, M4: the most widespread kernel. The support is two smoothing lengths.

    W = 10 / (7 pi s^2) [(2 - R)^3 - 4 (1 - R)^3] / 4, R = r/s, s = h/2, no bracket below zero.
    Source: Monaghan & Lattanzio 1985. Laplacian: Morris, Fox, Zhu 1997, eq. 22.
    """

    h: float
    h2: float
    half_h: float
    two_h: float
    weight_scale: float
    gradient_scale: float
    viscosity_scale: float


class QuinticSpline(NamedTuple):
    """A matched pair, M6: closest to a Gaussian. The support is three smoothing lengths.

    W = 7 / (478 pi s^2) [(3 - R)^5 - 6 (2 - R)^5 + 15 (1 - R)^5], R = r/s, s = h/3, no bracket
    below zero. Source: Schoenberg 1946. Laplacian: Morris, Fox, Zhu 1997, eq. 22.
    """

    h: float
    h2: float
    third_h: float
    two_thirds_h: float
    weight_scale: float
    gradient_scale: float
    viscosity_scale: float


class Poly6Pair(NamedTuple):
    """WRONG ON PURPOSE: poly6 for pressure too, the first thing that one would think of.

    A matched pair with right moments, but its force vanishes as r -> 0 and weakens already below
    r = 0.45 h, where the nearest neighbours are from h/dx = 2.2 on. What one sees: at rest and
    without pressure nothing; under pressure particles clump, in pairs or more at one place, while
    densities look right. A compressed lattice falls apart 2 to 3 times as fast as with the others.
    Viscosity as in `Mueller`. Source: Mueller, Charypar, Gross 2003, section 3.5, who warn of it.
    """

    h: float
    h2: float
    weight_scale: float
    gradient_scale: float
    viscosity_scale: float


@dispatch
def weight(kernel: Any, r2: Any, r: Any) -> Any:
    """Shape of W at distance r (r2 = r^2)."""


@dispatch
def primitive(kernel: Any, r2: Any, r: Any) -> Any:
    """Shape whose derivative is `gradient`: that of W, where the pair is matched."""


@dispatch
def gradient(kernel: Any, r2: Any, r: Any, inv_r: Any) -> Any:
    """Shape of -(dW/dr)/r at distance r; positive, so that pressure pushes apart."""


@dispatch
def viscosity(kernel: Any, r2: Any, r: Any) -> Any:
    """Shape of the weight w in  laplacian(f)_i = sum_j V_j (f_j - f_i) w_ij."""


@weight.member(Mueller)
@weight.member(Poly6Pair)
@primitive.member(Poly6Pair)
def _poly6(kernel, r2, r):
    t = kernel.h2 - r2
    return t * t * t


@gradient.member(Mueller)
@gradient.member(Spiky)
def _spiky(kernel, r2, r, inv_r):
    # (h - r)^2 / r without a subtraction of r, which a lane would need a second root for
    return (kernel.h2 + r2) * inv_r - kernel.two_h


@viscosity.member(Mueller)
@viscosity.member(Spiky)
@viscosity.member(Poly6Pair)
def _mueller_viscosity(kernel, r2, r):
    return kernel.h - r


@weight.member(WendlandC2)
@primitive.member(WendlandC2)
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


@weight.member(Spiky)
@primitive.member(Spiky)
@primitive.member(Mueller)
def _spiky_weight(kernel, r2, r):
    t = kernel.h - r
    return t * t * t


@weight.member(CubicSpline)
@primitive.member(CubicSpline)
def _cubic(kernel, r2, r):
    t, u = kernel.h - r, maximum(kernel.half_h - r, like(r, 0.0))
    return t * t * t - like(r, 4.0) * (u * u * u)


@gradient.member(CubicSpline)
def _cubic_gradient(kernel, r2, r, inv_r):
    # inside the knot r is divided out by hand: a difference over r is noise when particles coincide
    t = kernel.h - r
    return select(r < kernel.half_h, kernel.two_h - like(r, 3.0) * r, t * t * inv_r)


@weight.member(QuinticSpline)
@primitive.member(QuinticSpline)
def _quintic(kernel, r2, r):
    t, zero = kernel.h - r, like(r, 0.0)
    u, v = maximum(kernel.two_thirds_h - r, zero), maximum(kernel.third_h - r, zero)
    t2, u2, v2 = t * t, u * u, v * v
    return t2 * t2 * t - like(r, 6.0) * (u2 * u2 * u) + like(r, 15.0) * (v2 * v2 * v)


@gradient.member(QuinticSpline)
def _quintic_gradient(kernel, r2, r, inv_r):
    # as in the cubic spline
    s = kernel.third_h
    inner = like(r, 24.0) * s * (s * s - r2) + like(r, 10.0) * r * r2
    t, u = kernel.h - r, maximum(kernel.two_thirds_h - r, like(r, 0.0))
    t2, u2 = t * t, u * u
    return select(r < s, inner, (t2 * t2 - like(r, 6.0) * (u2 * u2)) * inv_r)


@viscosity.member(CubicSpline)
def _cubic_viscosity(kernel, r2, r):
    # 1/r counts from the knot on only; any finite number will do inside
    return gradient(kernel, r2, r, reciprocal(maximum(r, kernel.half_h)))


@viscosity.member(QuinticSpline)
def _quintic_viscosity(kernel, r2, r):
    return gradient(kernel, r2, r, reciprocal(maximum(r, kernel.third_h)))


@gradient.member(Poly6Pair)
def _poly6_gradient(kernel, r2, r, inv_r):
    t = kernel.h2 - r2
    return t * t


def make_mueller(h: float, dtype: type = np.float64) -> Mueller:
    """The Mueller kernels with support radius h [m]."""
    scales = (4 / (math.pi * h**8), 30 / (math.pi * h**5), 40 / (math.pi * h**5))
    return Mueller(dtype(h), dtype(h * h), dtype(2 * h), *scales)


def make_wendland_c2(h: float, dtype: type = np.float64) -> WendlandC2:
    """The Wendland C2 kernel with support radius h [m]."""
    scales = (28 / (math.pi * h**7), 140 / (math.pi * h**7), 280 / (math.pi * h**7))
    return WendlandC2(dtype(h), dtype(h * h), dtype(h / 4), *scales)


def make_spiky(h: float, dtype: type = np.float64) -> Spiky:
    """The spiky kernel with support radius h [m]."""
    scales = (10 / (math.pi * h**5), 30 / (math.pi * h**5), 40 / (math.pi * h**5))
    return Spiky(dtype(h), dtype(h * h), dtype(2 * h), *scales)


def make_cubic_spline(h: float, dtype: type = np.float64) -> CubicSpline:
    """The cubic spline with support radius h [m]: the smoothing length is h/2."""
    scales = (80 / (7 * math.pi * h**5), 240 / (7 * math.pi * h**5), 480 / (7 * math.pi * h**5))
    return CubicSpline(dtype(h), dtype(h * h), dtype(h / 2), dtype(2 * h), *scales)


def make_quintic_spline(h: float, dtype: type = np.float64) -> QuinticSpline:
    """The quintic spline with support radius h [m]: the smoothing length is h/3."""
    scale = 7 * 3**7 / (478 * math.pi * h**7)
    scales = (scale, 5 * scale, 10 * scale)
    return QuinticSpline(dtype(h), dtype(h * h), dtype(h / 3), dtype(2 * h / 3), *scales)


# --- Wrong on purpose -----------------------------------------------------------------------


def make_wrong_3d_constants(h: float, dtype: type = np.float64) -> Mueller:
    """WRONG ON PURPOSE: `Mueller` with the constants of three dimensions, which are per metre more.

    W has 1.23/h [1/m], the gradient 1.5/h and the Laplacian 1.125/h times the right integral.
    What one sees: with the mass rho0 dx^2, densities that are off by a factor and follow the
    resolution. With a calibrated mass, which becomes 0.81 h [m] times the right one, densities
    and XSPH are right, but pressure is 128/105 and laminar viscosity 32/35 as strong as it should
    be, and a particle's mass and all energies are absurd.
    """
    scales = (315 / (64 * math.pi * h**9), 45 / (math.pi * h**6), 45 / (math.pi * h**6))
    return Mueller(dtype(h), dtype(h * h), dtype(2 * h), *scales)


def make_wrong_spiky_gradient(h: float, dtype: type = np.float64) -> Mueller:
    """WRONG ON PURPOSE: `Mueller` with the often copied spiky gradient -10 / (pi h^5) (h - r)^2.

    That is the constant of W, which the derivative should have multiplied by 3. What one sees:
    pressure a third as strong, sound at 0.58 c, three times the compression under a column.
    """
    return make_mueller(h, dtype)._replace(gradient_scale=10 / (math.pi * h**5))


def make_wrong_poly6_gradient(h: float, dtype: type = np.float64) -> Poly6Pair:
    """WRONG ON PURPOSE: see `Poly6Pair`."""
    scales = (4 / (math.pi * h**8), 24 / (math.pi * h**8), 40 / (math.pi * h**5))
    return Poly6Pair(dtype(h), dtype(h * h), *scales)


# --- By name --------------------------------------------------------------------------------

KERNELS: dict[str, Callable[..., Any]] = {
    "mueller": make_mueller,
    "wendland_c2": make_wendland_c2,
    "spiky": make_spiky,
    "cubic_spline": make_cubic_spline,
    "quintic_spline": make_quintic_spline,
}
WRONG_KERNELS: dict[str, Callable[..., Any]] = {
    "wrong_3d_constants": make_wrong_3d_constants,
    "wrong_spiky_gradient": make_wrong_spiky_gradient,
    "wrong_poly6_gradient": make_wrong_poly6_gradient,
}
ALL_KERNELS = KERNELS | WRONG_KERNELS
# Where the gradient is the derivative of the density kernel, constants included. Not the same as
# right: poly6 for everything conserves energy while it clumps.
MATCHED: frozenset[str] = frozenset(
    {"wendland_c2", "spiky", "cubic_spline", "quintic_spline", "wrong_poly6_gradient"}
)


def density_kernel(kernel: Any, r: np.ndarray) -> np.ndarray:
    """W(r) [1/m^2] with its constant and its cut at h, for any array of distances [m]."""
    r = np.asarray(r, dtype=np.float64)
    return np.where(r < kernel.h, kernel.weight_scale * weight(kernel, r * r, r), 0.0)


def primitive_scale(kernel: Any) -> float:
    """The constant in front of `primitive`, that belongs to `gradient_scale`."""
    if isinstance(kernel, Mueller):
        return float(kernel.gradient_scale / 3)
    return float(kernel.weight_scale)


# a rule of agents asks for it in every frame
@lru_cache
def viscous_share(kernel: Any, form: str) -> float:
    """The step that a kinematic viscosity nu allows, as a share of h^2 / nu; form: of viscosity.

    The shortest waves decay at the rate nu times the integral of the Laplacian weight, and Euler
    diverges beyond two over that. Five sixths of it, which for Mueller's is Morris' 0.125; from
    0.047 (quintic spline) to 0.125.
    """
    points, parts = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for part, r in zip(parts, (points + 1) * kernel.h / 2, strict=True):
        if form == "morris":
            softened = r * r / (r * r + 0.01 * kernel.h2)
            w = 2 * kernel.gradient_scale * gradient(kernel, r * r, r, 1 / r) * softened
        else:
            w = kernel.viscosity_scale * viscosity(kernel, r * r, r)
        total += part * w * math.pi * r * kernel.h
    return float(2 * (5 / 6) / (total * kernel.h2))


def calibrated_mass(kernel: Any, rho0: float, dx: float) -> float:
    """Particle mass per metre of depth [kg/m] that gives rho0 on the square lattice of spacing dx.

    rho0 dx^2 misses the rest density by up to 1.5 %, which is a pressure of 0.016 rho0 c^2.
    """
    reach = np.arange(-math.ceil(kernel.h / dx), math.ceil(kernel.h / dx) + 1) * dx
    return float(rho0 / density_kernel(kernel, np.hypot(*np.meshgrid(reach, reach))).sum())
