"""Every effect: its parameters, its term, its source. What a scene doesn't name is compiled away.

A term begins with `if effect is None` and hands back what it was given: numba decides that while
it compiles, so an absent effect leaves no instruction behind. Terms are lane-agnostic arithmetic
(see lanes.py); they leave out the factor m * gradient_scale, which the loop applies once a
particle. `Pair` and `Sums` say what they are given and what they add to.
"""

from typing import Any, NamedTuple

from sph_gym.solver.jit import dispatch, jitable
from sph_gym.solver.lanes import like, maximum, minimum, rsqrt


class Pair(NamedTuple):
    """What particle i and its neighbour j share; kernel shapes are 0 from the support radius on.

    dx, dy: x_i - x_j [m]; r2: its square, r: its length; du, dv: v_i - v_j [m/s]; slip_u, slip_v:
    the same as viscosity sees it, which at a wall may be a mirrored velocity; stress_i, stress_j:
    p / rho^2; density_gap: rho_j - rho_i; density_sum: rho_i + rho_j; inv_rho: 1 / (rho_i +
    rho_j); inv_rho_r2: the same divided by r^2 + eta^2; weight, gradient, viscosity: kernel
    shapes.
    """

    dx: Any
    dy: Any
    r2: Any
    r: Any
    du: Any
    dv: Any
    slip_u: Any
    slip_v: Any
    stress_i: Any
    stress_j: Any
    density_gap: Any
    density_sum: Any
    inv_rho: Any
    inv_rho_r2: Any
    weight: Any
    gradient: Any
    viscosity: Any


class Sums(NamedTuple):
    """What particle i collects.

    ax, ay: acceleration / (m gradient_scale); sx, sy: XSPH sum / (2 eps m weight_scale); growth:
    d rho/dt by diffusion / (m gradient_scale); cx, cy: - grad C / (2 m gradient_scale), see
    `add_crowding`.
    """

    ax: Any
    ay: Any
    sx: Any
    sy: Any
    growth: Any
    cx: Any
    cy: Any


# --- Pressure -------------------------------------------------------------------------------


@jitable
def add_pressure(stress, pair, ax, ay):
    """- sum m (p_i/rho_i^2 + p_j/rho_j^2) grad W: equal and opposite.

    Source: Monaghan 1992, eq. 3.3.
    """
    force = stress * pair.gradient
    return ax + force * pair.dx, ay + force * pair.dy


# --- Tensile correction ---------------------------------------------------------------------


class TensileCorrection(NamedTuple):
    """strength: epsilon, the share of a tension that repels; inv_weight: 1 / W shape(dx)."""

    strength: float
    inv_weight: float


@jitable
def add_tensile_correction(effect, pair, stress):
    """R (W(r) / W(dx))^4, R = eps |p|/rho^2 of both under tension + 0.02 of the lesser pressure.

    A repulsion within dx that keeps particles from pairing under tension.
    Source: Monaghan 2000, section 3, eqs. 3.1 and 4.2; there 0.01 of both pressures, which jumps
    where one of them changes its sign, so that round-off at p = 0 would decide on a force.
    """
    if effect is None:
        return stress
    zero = like(pair.r2, 0.0)
    tension = maximum(zero - pair.stress_i, zero) + maximum(zero - pair.stress_j, zero)
    squeezed = maximum(minimum(pair.stress_i, pair.stress_j), zero)
    push = effect.strength * tension + like(zero, 0.02) * squeezed
    share = pair.weight * effect.inv_weight
    return stress + push * (share * share * (share * share))


# --- Artificial viscosity -------------------------------------------------------------------


class ArtificialViscosity(NamedTuple):
    """strength: 2 alpha c0 h [m^2/s], with the scene's nominal c0.

    A strength that followed the present stiffness would thicken the fluid when an agent stiffens
    it: the tuning would change the fluid and not only the numerics.
    """

    strength: float


class QuadraticViscosity(NamedTuple):
    """strength: 2 beta h^2 [m^2]."""

    strength: float


@jitable
def add_artificial_viscosity(effect, pair, stress):
    """Pi_ij = - alpha c0 h v.r / ((r^2 + eta^2) rho_mean) for pairs that approach.

    Source: Monaghan 1992, eqs. 4.1 and 4.2, eta^2 = 0.01 h^2.
    """
    if effect is None:
        return stress
    approach = pair.slip_u * pair.dx + pair.slip_v * pair.dy
    approach = minimum(approach, like(approach, 0.0))
    return stress - effect.strength * (approach * pair.inv_rho_r2)


@jitable
def add_quadratic_viscosity(effect, pair, stress):
    """beta (h v.r / (r^2 + eta^2))^2 / rho_mean for pairs that approach, against penetration.

    Source: Monaghan 1992, eq. 4.1, the beta term.
    """
    if effect is None:
        return stress
    approach = pair.slip_u * pair.dx + pair.slip_v * pair.dy
    rate = minimum(approach, like(approach, 0.0)) * pair.inv_rho_r2
    return stress + effect.strength * (rate * rate * pair.density_sum)


# --- Laminar viscosity ----------------------------------------------------------------------


class LaplacianViscosity(NamedTuple):
    """strength: 2 nu viscosity_scale / gradient_scale, nu [m^2/s] the kinematic viscosity."""

    strength: float


class MorrisViscosity(NamedTuple):
    """strength: 4 nu [m^2/s]."""

    strength: float


@dispatch
def friction(effect: Any, pair: Pair) -> Any:
    """Factor of v_j - v_i in the viscous acceleration."""


@friction.member(LaplacianViscosity)
def _laplacian_friction(effect, pair):
    return effect.strength * (pair.viscosity * pair.inv_rho)


@friction.member(MorrisViscosity)
def _morris_friction(effect, pair):
    return effect.strength * (pair.gradient * (pair.r2 * pair.inv_rho_r2))


@jitable
def add_laminar_viscosity(effect, pair, ax, ay):
    """nu sum m (v_j - v_i) / rho_mean w_ij; for the step see `kernels.viscous_share`.

    w is the Laplacian weight of the kernel (Mueller, Charypar, Gross 2003, eq. 14), or
    2 r . grad W / (r^2 + eta^2) (Morris, Fox, Zhu 1997, eq. 22), both with the mean density,
    which conserves momentum.
    """
    if effect is None:
        return ax, ay
    drag = friction(effect, pair)
    return ax - drag * pair.slip_u, ay - drag * pair.slip_v


# --- Surface tension ------------------------------------------------------------------------


class SurfaceTension(NamedTuple):
    """strength: K V^2 shape scale / (m^2 gradient_scale), see `surface.calibrated_stress`;
    volume_scale: V times the shape's scale; h [m]; disorder2: square of the gradient that counts
    as none [1/m^2]; held_back: share of the pull; inv_weight: 1 / W shape(dx).
    """

    strength: float
    volume_scale: float
    h: float
    disorder2: float
    held_back: float
    inv_weight: float


@jitable
def add_surface_tension(effect, pair, nx_i, ny_i, nx_j, ny_j, ax, ay):
    """Divergence of K (|n| - n n / |n|), a pull along the surface; n: of the share that is filled.

    Given as n / sqrt|n|. Equal and opposite between two particles, but not along their line.
    Source: Lafaurie et al. 1994; for particles Hu & Adams 2006. What is held back between near
    neighbours is as in Monaghan 2000.
    """
    if effect is None:
        return ax, ay
    size = nx_i * nx_i + ny_i * ny_i + (nx_j * nx_j + ny_j * ny_j)
    along_i = nx_i * pair.dx + ny_i * pair.dy
    along_j = nx_j * pair.dx + ny_j * pair.dy
    rest = maximum(effect.h - pair.r, like(pair.r, 0.0))
    near = pair.weight * effect.inv_weight
    near = near * near * (near * near)
    pull = effect.strength * (rest * rest * rest) * (like(pair.r, 1.0) - effect.held_back * near)
    ax = ax - pull * (size * pair.dx - nx_i * along_i - nx_j * along_j)
    ay = ay - pull * (size * pair.dy - ny_i * along_i - ny_j * along_j)
    return ax, ay


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
def add_smoothing(effect, sums, tx, ty):
    """tx, ty and the XSPH correction [m/s] of the velocity that moves a particle."""
    if effect is None:
        return tx, ty
    return tx + effect.scale * sums.sx, ty + effect.scale * sums.sy


# --- Particle shifting ----------------------------------------------------------------------


class Shifting(NamedTuple):
    """scale: 2 A U h m gradient_scale, U [m/s] a tenth of c0; top: the largest shift [m/s]."""

    scale: float
    top: float


@jitable
def add_crowding(effect, pair, cx, cy):
    """- grad C = - sum V_j grad W, the concentration of particles, V = m / rho_mean.

    Source: Lind, Xu, Stansby, Rogers 2012, eq. 21.
    """
    if effect is None:
        return cx, cy
    crowd = pair.gradient * pair.inv_rho
    return cx + crowd * pair.dx, cy + crowd * pair.dy


@jitable
def add_shift(effect, sums, tx, ty):
    """tx, ty and the velocity [m/s] with which particles leave where they are crowded.

    For confined flows: at a free surface the gradient points out of the fluid.
    Source: Skillen, Lind, Stansby, Rogers 2013, eq. 13, with the scene's own speed.
    """
    if effect is None:
        return tx, ty
    shift_x, shift_y = effect.scale * sums.cx, effect.scale * sums.cy
    size2 = shift_x * shift_x + shift_y * shift_y
    share = minimum(effect.top * rsqrt(size2 + like(size2, 1e-30)), like(size2, 1.0))
    return tx + share * shift_x, ty + share * shift_y


# --- Density by continuity ------------------------------------------------------------------


class Continuity(NamedTuple):
    """Densities begin at rho0 and grow where particles approach. scale: m primitive_scale.

    The growth sum m (v_i - v_j) . grad W is the time derivative of sum m W, so that it needs no
    integration: rho(t) = rho0 + sum m W(t) - sum m W(0), where all but sum m W(t) is an offset
    that a particle keeps. In exact time, forces are then the derivative of one energy; summed up
    step by step from old velocities, densities would drive every sound wave.
    Source: Monaghan 1992, eq. 2.18.
    """

    scale: float


class DensityDiffusion(NamedTuple):
    """strength: 2 delta c0 h, h the support radius [m^2/s]; hydro_x, hydro_y: rho0 g / c^2."""

    strength: float
    hydro_x: float
    hydro_y: float


@jitable
def add_density_diffusion(effect, pair, growth):
    """2 delta h c0 sum m / rho_mean (rho_j - rho_i - rho_H) (-dW/dr)/r: smooths the densities.

    rho_H is the difference that a fluid at rest under gravity has between the two places, so that
    a tank at rest stays what it is. h: smoothing length, half of the support radius.
    Source: Molteni & Colagrossi 2009; rho_H: Fourtakas, Vacondio, Dominguez, Rogers 2020, eq. 11,
    linearised.
    """
    if effect is None:
        return growth
    at_rest = effect.hydro_x * pair.dx + effect.hydro_y * pair.dy
    gap = pair.density_gap + at_rest
    return growth + effect.strength * (gap * (pair.gradient * pair.inv_rho))


class PairEffects(NamedTuple):
    """The effects that act between two particles; None where the scene doesn't name one."""

    artificial_viscosity: ArtificialViscosity | None = None
    quadratic_viscosity: QuadraticViscosity | None = None
    laminar_viscosity: LaplacianViscosity | MorrisViscosity | None = None
    tensile_correction: TensileCorrection | None = None
    surface_tension: SurfaceTension | None = None
    xsph: Xsph | None = None
    shifting: Shifting | None = None
    continuity: Continuity | None = None
    density_diffusion: DensityDiffusion | None = None
