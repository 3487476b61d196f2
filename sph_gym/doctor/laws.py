"""The kernels that a solver may have, and which of them explains what was measured.

Lengths are in support radii: q = r / h, and W = 0 beyond q = 1. Splines and the Gaussian, which
their authors write in smoothing lengths, are told in the same way.
"""

from collections.abc import Callable, Collection
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from sph_gym.doctor.case import Array

Radial = Callable[[Array], Array]
# A measured curve is that of a kernel if it is nowhere further from it than this share of its
# largest value. No two of those below are nearer to each other than 0.9 %.
ALIKE = 0.005


class Kernel(NamedTuple):
    """A smoothing kernel of two dimensions.

    weight: W h^2 as a function of q; slope: -dW/dr h^3, positive where the kernel falls;
    solid: by how much the constant of three dimensions is larger than that of two, times h;
    pairing: whether the slope vanishes towards r = 0 so early that particles under pressure merge.
    """

    name: str
    weight: Radial
    slope: Radial
    solid: float
    pairing: bool = False


def _above(a: float, q: Array, power: int) -> Array:
    return np.asarray(np.maximum(a - q, 0.0) ** power, dtype=np.float64)


def _polynomial(factor: float, power: int, *coefficients: float) -> Radial:
    """Return q -> factor (1 - q)^power (c0 + c1 q + c2 q^2 + ...)."""
    return lambda q: np.asarray(
        factor / np.pi * _above(1, q, power) * np.polyval(coefficients[::-1], q)
    )


def _spline(factor: float, power: int, knots: tuple[float, ...], *shares: float) -> Radial:
    """Return q -> factor * sum of share (knot - q)^power."""
    return lambda q: np.asarray(
        factor / np.pi * sum(s * _above(k, q, power) for k, s in zip(knots, shares, strict=True))
    )


def _gaussian(cut: float, slope: bool) -> Radial:
    """Return a Gaussian that ends at `cut` smoothing lengths, or its falling slope."""

    def shape(q: Array) -> Array:
        values = cut**2 / np.pi * np.exp(-((cut * q) ** 2)) * (q < 1)
        return 2 * cut**2 * q * values if slope else values

    return shape


_M4, _M5, _M6 = (1.0, 0.5), (1.0, 0.6, 0.2), (1.0, 2 / 3, 1 / 3)
_QUARTIC = 96 * 2.5**6 / 1199
_QUINTIC = 7 * 3.0**7 / 478

KERNELS: dict[str, Kernel] = {
    kernel.name: kernel
    for kernel in (
        Kernel(
            "poly6",
            lambda q: 4 / np.pi * np.maximum(1 - q**2, 0.0) ** 3,
            lambda q: 24 / np.pi * q * np.maximum(1 - q**2, 0.0) ** 2,
            315 / 256,
            pairing=True,
        ),
        Kernel("spiky", _polynomial(10, 3, 1), _polynomial(30, 2, 1), 1.5),
        Kernel("Wendland C2", _polynomial(7, 4, 1, 4), _polynomial(140, 3, 0, 1), 1.5),
        Kernel(
            "Wendland C4", _polynomial(9, 6, 1, 6, 35 / 3), _polynomial(168, 5, 0, 1, 5), 495 / 288
        ),
        Kernel(
            "Wendland C6",
            _polynomial(78 / 7, 8, 1, 8, 25, 32),
            _polynomial(22 * 78 / 7, 7, 0, 1, 7, 16),
            1365 * 7 / (64 * 78),
        ),
        Kernel(
            "cubic spline", _spline(80 / 7, 3, _M4, 1, -4), _spline(240 / 7, 2, _M4, 1, -4), 1.4
        ),
        Kernel(
            "quartic spline",
            _spline(_QUARTIC, 4, _M5, 1, -5, 10),
            _spline(4 * _QUARTIC, 3, _M5, 1, -5, 10),
            2.5 * 1199 / (96 * 20),
        ),
        Kernel(
            "quintic spline",
            _spline(_QUINTIC, 5, _M6, 1, -6, 15),
            _spline(5 * _QUINTIC, 4, _M6, 1, -6, 15),
            478 / 280,
        ),
        Kernel("Gaussian", _gaussian(3, False), _gaussian(3, True), 3 / np.pi**0.5),
        Kernel(
            "Gaussian cut at 2 smoothing lengths",
            _gaussian(2, False),
            _gaussian(2, True),
            2 / np.pi**0.5,
        ),
        Kernel("Lucy", _polynomial(5, 3, 1, 3), _polynomial(60, 2, 0, 1), 105 / 80),
    )
}


class Match(NamedTuple):
    """A kernel of a measured curve.

    name: "" if none of `KERNELS` is alike; factor: what to multiply its curve by; error: the
    largest distance, as a share of the largest value.
    """

    name: str
    factor: float
    error: float

    @property
    def kernel(self) -> Kernel | None:
        """Return the kernel, None if it is none of those known."""
        return KERNELS.get(self.name)


def match(
    q: Array, values: Array, which: str, alike: float = ALIKE, names: Collection[str] = ()
) -> Match:
    """Return the kernel whose `which`, "weight" or "slope", is proportional to measured values.

    q: (k,) distances in support radii; values: (k,); alike: the largest error of a match; names:
    of the kernels that come into question, by default all.
    """
    best = Match("", 0.0, np.inf)
    size = float(np.abs(values).max(initial=0.0))
    for kernel in (KERNELS[name] for name in names or KERNELS):
        shape = getattr(kernel, which)(q)
        square = float(shape @ shape)
        if not size or not square:
            continue
        factor = float(values @ shape) / square
        error = float(np.abs(values - factor * shape).max()) / size
        if error < best.error:
            best = Match(kernel.name, factor, error)
    return best if best.error <= alike else best._replace(name="")


@lru_cache
def lattice_sum(weight: Callable[[Array], Any], ratio: float) -> float:
    """Return the sum of W h^2 over the square lattice of spacing dx = h / ratio.

    weight: W h^2 as a function of q.
    """
    reach = np.arange(-np.ceil(ratio), np.ceil(ratio) + 1)
    return float(np.sum(weight(np.hypot(*np.meshgrid(reach, reach)).ravel() / ratio)))


def integral(q: Array, values: Array) -> float:
    """Return 2 pi times the integral of values q dq from 0 to 1, by the trapezoid rule.

    The first value also stands for all nearer distances; beyond the last one there is nothing.
    """
    inner = np.pi * q[0] ** 2 * values[0]
    places, heights = np.array([*q, 1.0]), np.array([*(values * q), 0.0])
    outer = np.sum(np.diff(places) * (heights[1:] + heights[:-1]) / 2)
    return float(inner + 2 * np.pi * outer)


class MeasuredWeights(NamedTuple):
    """The measured m W(r).

    settings: of the case, see `fluid`; q: (k,) distances in support radii; values: (k,) m W
    [kg/m^2 per metre of depth, as rho]; own: m W(0), the density of a lone particle; found: the
    kernel.
    """

    settings: dict[str, float]
    q: Array
    values: Array
    own: float
    found: Match

    def __call__(self, r: Array) -> Array:
        """Return m W(r) for distances r > 0 [m] in a case with these settings."""
        q = np.minimum(np.asarray(r) / self.settings["h"], 2.0)
        if self.found.kernel:
            return self.found.factor * self.found.kernel.weight(q)
        return np.interp(q, [*self.q, 1.0], [*self.values, 0.0], right=0.0)

    @property
    def mass(self) -> float:
        """Return the mass [kg/m] of a particle if the kernel's integral is 1."""
        h = self.settings["h"]
        if self.found.kernel:
            return self.found.factor * h**2
        return integral(self.q, self.values) * h**2
