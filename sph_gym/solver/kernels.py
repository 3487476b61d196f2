"""Smoothing kernels in two dimensions: a density kernel and the gradient that goes with it.

`h` is the SUPPORT radius: W = 0 from r = h on, also for the splines, whose authors call a half or
a third of it h. Each kernel is a family member of two functions that return *shapes*; the
constant in front is a field (`weight_scale`, `gradient_scale`) and is multiplied once a particle
instead of once a pair:

    W(r)        = weight_scale * weight(kernel, r2, r)                                  [1/m^2]
    -(dW/dr)/r  = gradient_scale * gradient(kernel, r2, r, inv_r)                       [1/m^4]

Laminar viscosity has one weight, `friction`, whichever kernel the fluid has.

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

from sph_gym.solver.jit import dispatch, jitable
from sph_gym.solver.lanes import like, maximum, select


class Mueller(NamedTuple):
    """The article's pair: poly6 for densities, spiky for pressure.

    Not a matched pair: without any dissipation it is linearly unstable for h/dx >= 2.2.
    Source: Mueller, Charypar, Gross 2003, renormalised in 2D (spiky gradient: -30 / (pi h^5)).
    """

    h: float
    h2: float
    two_h: float
    weight_scale: float
    gradient_scale: float


class WendlandC2(NamedTuple):
    """A matched pair: the gradient is the derivative of the density kernel. For accuracy work.

    Source: Wendland 1995; Dehnen & Aly 2012, table 1.
    """

    h: float
    h2: float
    quarter_h: float
    weight_scale: float
    gradient_scale: float


class Spiky(NamedTuple):
    """A matched pair that pushes hardest where particles touch: the gradient doesn't vanish there.

    Its density is as pointed: uncalibrated it reads 1.27 rho0 on a lattice at h/dx = 2.
    Source: Desbrun & Gascuel 1996, in 2D.
    """

    h: float
    h2: float
    two_h: float
    weight_scale: float
    gradient_scale: float


class CubicSpline(NamedTuple):
    """A matched pair, M4: the most widespread kernel. The support is two smoothing lengths.

    W = 10 / (7 pi s^2) [(2 - R)^3 - 4 (1 - R)^3] / 4, R = r/s, s = h/2, no bracket below zero.
    Source: Monaghan & Lattanzio 1985.
    """

    h: float
    h2: float
    half_h: float
    two_h: float
    weight_scale: float
    gradient_scale: float


class QuinticSpline(NamedTuple):
    """A matched pair, M6: closest to a Gaussian. The support is three smoothing lengths.

    W = 7 / (478 pi s^2) [(3 - R)^5 - 6 (2 - R)^5 + 15 (1 - R)^5], R = r/s, s = h/3, no bracket
    below zero. Source: Schoenberg 1946.
    """

    h: float
    h2: float
    third_h: float
    two_thirds_h: float
    weight_scale: float
    gradient_scale: float


class Poly6Pair(NamedTuple):
    """WRONG ON PURPOSE: poly6 for pressure too, the first thing that one would think of.

    A matched pair with right moments, but its force vanishes as r -> 0 and weakens already below
    r = 0.45 h, where the nearest neighbours are from h/dx = 2.2 on. What one sees: at rest and
    without pressure nothing; under pressure particles clump, in pairs or more at one place, while
    densities look right. A compressed lattice falls apart 2 to 3 times as fast as with the others.
    Source: Mueller, Charypar, Gross 2003, section 3.5, who warn of it.
    """

    h: float
    h2: float
    weight_scale: float
    gradient_scale: float


@dispatch
def weight(kernel: Any, r2: Any, r: Any) -> Any:
    """Shape of W at distance r (r2 = r^2)."""


@dispatch
def primitive(kernel: Any, r2: Any, r: Any) -> Any:
    """Shape whose derivative is `gradient`: that of W, where the pair is matched."""


@dispatch
def gradient(kernel: Any, r2: Any, r: Any, inv_r: Any) -> Any:
    """Shape of -(dW/dr)/r at distance r; positive, so that pressure pushes apart."""


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


@weight.member(WendlandC2)
@primitive.member(WendlandC2)
def _wendland(kernel, r2, r):
    t = kernel.h - r
    return t * t * (t * t) * (kernel.quarter_h + r)


@gradient.member(WendlandC2)
def _wendland_gradient(kernel, r2, r, inv_r):
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


@gradient.member(Poly6Pair)
def _poly6_gradient(kernel, r2, r, inv_r):
    t = kernel.h2 - r2
    return t * t


def make_mueller(h: float, dtype: type = np.float64) -> Mueller:
    """The Mueller kernels with support radius h [m]."""
    scales = (4 / (math.pi * h**8), 30 / (math.pi * h**5))
    return Mueller(dtype(h), dtype(h * h), dtype(2 * h), *scales)


def make_wendland_c2(h: float, dtype: type = np.float64) -> WendlandC2:
    """The Wendland C2 kernel with support radius h [m]."""
    scales = (28 / (math.pi * h**7), 140 / (math.pi * h**7))
    return WendlandC2(dtype(h), dtype(h * h), dtype(h / 4), *scales)


def make_spiky(h: float, dtype: type = np.float64) -> Spiky:
    """The spiky kernel with support radius h [m]."""
    scales = (10 / (math.pi * h**5), 30 / (math.pi * h**5))
    return Spiky(dtype(h), dtype(h * h), dtype(2 * h), *scales)


def make_cubic_spline(h: float, dtype: type = np.float64) -> CubicSpline:
    """The cubic spline with support radius h [m]: the smoothing length is h/2."""
    scales = (80 / (7 * math.pi * h**5), 240 / (7 * math.pi * h**5))
    return CubicSpline(dtype(h), dtype(h * h), dtype(h / 2), dtype(2 * h), *scales)


def make_quintic_spline(h: float, dtype: type = np.float64) -> QuinticSpline:
    """The quintic spline with support radius h [m]: the smoothing length is h/3."""
    scale = 7 * 3**7 / (478 * math.pi * h**7)
    scales = (scale, 5 * scale)
    return QuinticSpline(dtype(h), dtype(h * h), dtype(h / 3), dtype(2 * h / 3), *scales)


# --- Wrong on purpose -----------------------------------------------------------------------


def make_wrong_3d_constants(h: float, dtype: type = np.float64) -> Mueller:
    """WRONG ON PURPOSE: `Mueller` with the constants of three dimensions, which are per metre more.

    W has 1.23/h [1/m] and the gradient 1.5/h times the right integral. What one sees: with the mass
    rho0 dx^2, densities that are off by a factor and follow the resolution. With a calibrated mass,
    which becomes 0.81 h [m] times the right one, densities and XSPH are right, but pressure is
    128/105 as strong as it should be, and a particle's mass and all energies are absurd.
    """
    scales = (315 / (64 * math.pi * h**9), 45 / (math.pi * h**6))
    return Mueller(dtype(h), dtype(h * h), dtype(2 * h), *scales)


def make_wrong_spiky_gradient(h: float, dtype: type = np.float64) -> Mueller:
    """WRONG ON PURPOSE: `Mueller` with the often copied spiky gradient -10 / (pi h^5) (h - r)^2.

    That is the constant of W, which the derivative should have multiplied by 3. What one sees:
    pressure a third as strong, sound at 0.58 c, three times the compression under a column.
    """
    return make_mueller(h, dtype)._replace(gradient_scale=10 / (math.pi * h**5))


def make_wrong_poly6_gradient(h: float, dtype: type = np.float64) -> Poly6Pair:
    """WRONG ON PURPOSE: see `Poly6Pair`."""
    scales = (4 / (math.pi * h**8), 24 / (math.pi * h**8))
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


def calibrated_mass(kernel: Any, rho0: float, dx: float) -> float:
    """Particle mass per metre of depth [kg/m] that gives rho0 on the square lattice of spacing dx.

    rho0 dx^2 misses the rest density by up to 1.5 %, which is a pressure of 0.016 rho0 c^2.
    """
    x, y = rest_lattice(kernel.h, dx)
    return float(rho0 / density_kernel(kernel, np.hypot(x, y)).sum())


def surface_densities(
    kernel: Any, mass: float, dx: float, shape: Callable[..., Any]
) -> tuple[float, float]:
    """Return the densities [kg/m^3] of the first and the second row below a free surface, at rest.

    shape: the one that densities are sums of, `weight` or `primitive`.
    """
    r = np.hypot(*rest_lattice(kernel.h, dx))
    scale = kernel.weight_scale if shape is weight else primitive_scale(kernel)
    rows = mass * scale * np.where(r < kernel.h, shape(kernel, r * r, r), 0.0).sum(axis=1)
    own = len(rows) // 2
    return float(rows[own:].sum()), float(rows[own - 1 :].sum())


def rest_lattice(h: float, dx: float) -> Any:
    """Return the offsets x, y [m], 2D arrays, of all within h on the square lattice, and beyond."""
    reach = np.arange(-math.ceil(h / dx), math.ceil(h / dx) + 1) * dx
    return np.meshgrid(reach, reach)


# --- Friction -------------------------------------------------------------------------------

# The largest ratio of the calibrated scale to that of a continuum: it is reached where h is below
# 1.4 dx, and so few particles of the lattice are near that they say nothing about others.
MOST_FRICTION = 2.0


@jitable
def friction(h, r):
    """Return the weight (h - r)^3 of laminar viscosity, 0 beyond h [m^3].

    Of the usual weights it depends least on how the particles lie: a lattice and rows that slide
    past each other have the same viscosity within 0.5 % at h/dx = 2 and 0.1 % from 2.5 on, where
    Mueller's h - r differs by 3 %. It is the Laplacian weight of Wendland's C2 after Morris.
    Source: Morris, Fox, Zhu 1997, eq. 22.
    """
    rest = maximum(h - r, like(r, 0.0))
    return rest * rest * rest


@lru_cache
def friction_scale(h: float, dx: float) -> float:
    """Return K [1/m^5] for which sum K (h - r)^3 (u_j - u_i) is the Laplacian on the rest lattice.

    It is exact for parabolas u.
    """
    x, y = rest_lattice(h, dx)
    moment = float((np.maximum(h - np.hypot(x, y), 0.0) ** 3 * y**2).sum())
    most = MOST_FRICTION * 280 / (math.pi * h**7) * dx**2
    return 2 / moment if moment * most > 2 else most


@lru_cache
def viscous_share(h: float, dx: float) -> float:
    """Return the step that a kinematic viscosity nu allows, as a share of h^2 / nu.

    The shortest waves decay at about the rate nu times the integral of K (h - r)^3 over all
    neighbours, and Euler diverges beyond two over that. Five sixths of it are 0.057 to 0.06 from
    h/dx = 2 on.
    """
    total = math.pi * h**5 / 10 / dx**2
    return 2 * (5 / 6) / (friction_scale(h, dx) * total * h**2)
