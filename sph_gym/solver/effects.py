"""Every effect: its parameters, its term, its source. What a scene doesn't name is compiled away.

A term begins with `if effect is None` and hands back what it was given: numba decides that while
it compiles, so an absent effect leaves no instruction behind. Terms are lane-agnostic arithmetic
(see lanes.py); they leave out the factor m * gradient_scale, which the loop applies once a
particle.
"""

from typing import Any, NamedTuple

from sph_gym.solver.jit import jitable
from sph_gym.solver.lanes import like, minimum


class Pair(NamedTuple):
    """What particle i and its neighbour j share; kernel shapes are 0 from the support radius on.

    dx, dy: x_i - x_j [m]; du, dv: v_i - v_j [m/s]; stress: p_i/rho_i^2 + p_j/rho_j^2;
    inv_rho: 1 / (rho_i + rho_j); inv_rho_r2: the same divided by r^2 + eta^2;
    weight, gradient, viscosity: kernel shapes.
    """

    dx: Any
    dy: Any
    du: Any
    dv: Any
    stress: Any
    inv_rho: Any
    inv_rho_r2: Any
    weight: Any
    gradient: Any
    viscosity: Any


class Sums(NamedTuple):
    """What particle i collects: acceleration / (m gradient_scale), XSPH sum / (2 eps m W scale)."""

    ax: Any
    ay: Any
    sx: Any
    sy: Any


# --- Pressure -------------------------------------------------------------------------------


@jitable
def add_pressure(stress, pair, ax, ay):
    """- sum m (p_i/rho_i^2 + p_j/rho_j^2) grad W: equal and opposite.

    Source: Monaghan 1992, eq. 3.3.
    """
    force = stress * pair.gradient
    return ax + force * pair.dx, ay + force * pair.dy


# --- Artificial viscosity -------------------------------------------------------------------


class ArtificialViscosity(NamedTuple):
    """strength: 2 alpha c0 h [m^2/s], with the scene's nominal c0.

    A strength that followed the present stiffness would thicken the fluid when an agent stiffens
    it: the tuning would change the fluid and not only the numerics.
    """

    strength: float


@jitable
def add_artificial_viscosity(effect, pair, stress):
    """Pi_ij = - alpha c0 h v.r / ((r^2 + eta^2) rho_mean) for pairs that approach.

    Source: Monaghan 1992, eqs. 4.1 and 4.2, beta = 0, eta^2 = 0.01 h^2.
    """
    if effect is None:
        return stress
    approach = pair.du * pair.dx + pair.dv * pair.dy
    approach = minimum(approach, like(approach, 0.0))
    return stress - effect.strength * (approach * pair.inv_rho_r2)


# --- Laminar viscosity ----------------------------------------------------------------------


class LaminarViscosity(NamedTuple):
    """strength: 2 nu viscosity_scale / gradient_scale, nu [m^2/s] the kinematic viscosity."""

    strength: float


@jitable
def add_laminar_viscosity(effect, pair, ax, ay):
    """nu sum m (v_j - v_i) / rho_mean w_ij; dt <= 0.125 h^2 / nu.

    Source: Mueller, Charypar, Gross 2003, eq. 14, with the mean density, which conserves momentum.
    """
    if effect is None:
        return ax, ay
    drag = effect.strength * (pair.viscosity * pair.inv_rho)
    return ax - drag * pair.du, ay - drag * pair.dv


# --- XSPH -----------------------------------------------------------------------------------


class Xsph(NamedTuple):
    """scale: 2 eps m weight_scale."""

    scale: float


@jitable
def add_xsph(effect, pair, sx, sy):
    """eps sum m (v_j - v_i) W / rho_mean: smooths the velocity that moves the particles, no other.

    Source: Monaghan 1992, eq. 4.9.
    """
    if effect is None:
        return sx, sy
    smoothing = pair.weight * pair.inv_rho
    return sx - smoothing * pair.du, sy - smoothing * pair.dv


@jitable
def smoothed(effect, u, v, sums):
    """The velocity that moves a particle: its own, plus the XSPH correction where there is one."""
    if effect is None:
        return u, v
    return u + effect.scale * sums.sx, v + effect.scale * sums.sy


# --- Gravity --------------------------------------------------------------------------------


class UniformGravity(NamedTuple):
    """Uniform gravity gx, gy [m/s^2], raised from zero over `ramp` seconds (0: all at once)."""

    gx: float
    gy: float
    inv_ramp: float


@jitable
def add_gravity(effect, time, ax, ay):
    """g min(time / ramp, 1)."""
    if effect is None:
        return ax, ay
    share = minimum(time * effect.inv_ramp, 1.0) if effect.inv_ramp > 0.0 else 1.0
    return ax + effect.gx * share, ay + effect.gy * share


class PairEffects(NamedTuple):
    """The effects that act between two particles; None where the scene doesn't name one."""

    artificial_viscosity: ArtificialViscosity | None
    laminar_viscosity: LaminarViscosity | None
    xsph: Xsph | None
