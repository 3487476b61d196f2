"""Pressure from density: Tait's equation and, as its case gamma = 1, the linear law.

    p = max(B ((rho / rho0)^gamma - 1), floor)        [Pa], B = rho0 c^2 / gamma

`floor` is 0 for a clamped fluid and -inf for one that may be under tension, so that the clamp
needs no branch. Source: Becker & Teschner 2007; Monaghan 1994.
"""

from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.jit import dispatch, jitable
from sph_gym.solver.lanes import like, maximum, select


class Tait7(NamedTuple):
    """gamma = 7, as water: a polynomial, no power function."""

    stiffness: float
    inv_rho0: float
    floor: float


class Tait(NamedTuple):
    """Any gamma >= 1."""

    stiffness: float
    inv_rho0: float
    floor: float
    gamma: float


@dispatch
def pressure(eos: Any, rho: Any) -> Any:
    """Pressure [Pa] at density rho [kg/m^3]."""


@pressure.member(Tait7)
def _tait7(eos, rho):
    # (1 + d)^7 - 1 by Horner's rule in the deviation d: q^7 - 1 loses all digits in float32
    d = rho * eos.inv_rho0 - like(rho, 1.0)
    s = d + like(rho, 7.0)
    s = d * s + like(rho, 21.0)
    s = d * s + like(rho, 35.0)
    s = d * s + like(rho, 35.0)
    s = d * s + like(rho, 21.0)
    s = d * s + like(rho, 7.0)
    return maximum(eos.stiffness * (d * s), eos.floor)


@pressure.member(Tait)
def _tait(eos, rho):
    q = rho * eos.inv_rho0
    return maximum(eos.stiffness * (q**eos.gamma - like(rho, 1.0)), eos.floor)


@dispatch
def density_at(eos: Any, p: Any) -> Any:
    """Density [kg/m^3] at which the pressure is p [Pa]; at least half the rest density."""


@density_at.member(Tait7)
def _tait7_density(eos, p):
    q = maximum(p / like(p, eos.stiffness) + like(p, 1.0), like(p, 1 / 128))
    return q ** like(p, 1 / 7) / like(p, eos.inv_rho0)


@density_at.member(Tait)
def _tait_density(eos, p):
    q = p / like(p, eos.stiffness) + like(p, 1.0)
    q = maximum(q, like(p, 0.5**eos.gamma))
    return q ** like(p, 1 / eos.gamma) / like(p, eos.inv_rho0)


def make_eos(
    stiffness: float, rho0: float, gamma: float, clamp: bool, dtype: type = np.float64
) -> Tait7 | Tait:
    """The equation of state for Tait's B [Pa], rest density [kg/m^3] and exponent."""
    common = dtype(stiffness), dtype(1 / rho0), dtype(0.0 if clamp else -np.inf)
    return Tait7(*common) if gamma == 7.0 else Tait(*common, dtype(gamma))


@dispatch
def internal_energy(eos: Any, rho: Any) -> Any:
    """Elastic energy per mass [J/kg] stored at density rho: the integral of p / rho^2 from rho0."""


@internal_energy.member(Tait7)
def _tait7_energy(eos, rho):
    # q^6 / 6 + 1 / q - 7 / 6 by Horner's rule in the deviation d, for the same reason
    d = rho * eos.inv_rho0 - like(rho, 1.0)
    s = d + like(rho, 7.0)
    s = d * s + like(rho, 21.0)
    s = d * s + like(rho, 35.0)
    s = d * s + like(rho, 35.0)
    s = d * s + like(rho, 21.0)
    energy = d * d * s / (like(rho, 6.0) * (d + like(rho, 1.0)))
    return _held(eos, d, energy)


@internal_energy.member(Tait)
def _tait_energy(eos, rho):
    q, one = rho * eos.inv_rho0, like(rho, 1.0)
    d = q - one
    if eos.gamma == 1.0:
        energy = np.log(q) - d / q
    else:
        rest = eos.gamma - one
        energy = (q**rest - one) / rest - d / q
    return _held(eos, d, energy)


@jitable
def _held(eos, d, energy):
    """A clamped fluid pushes, and so stores energy, only above rest density."""
    clamped = select(d > like(d, 0.0), energy, like(d, 0.0))
    return eos.stiffness * eos.inv_rho0 * select(eos.floor < 0.0, energy, clamped)
