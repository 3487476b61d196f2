"""Every effect in a section of its own; an effect that a scene does not name is compiled away.

A section holds the numbers that the compiled loop takes, how they follow from the scene (the
decorated function, whose docstring also gives meaning and source of the parameter), and the term.
A term begins with `if effect is None` and returns what it was given: numba decides that while it
compiles, so an absent effect leaves no instruction behind. Terms are written for lanes (lanes.py)
and leave out the factor m * gradient_scale, which the loop applies once a particle. `forces.Pair`
and `forces.Sums` are what they read and what they add to.

To add an effect: a section here, its field in `Effects` at the end of this file, its line in
forces.py, and its twin in tests/naive.py. See docs/architecture.md.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.checks import finite_array
from sph_gym.solver.gravity import AnyGravity, Gravity
from sph_gym.solver.jit import jitable
from sph_gym.solver.kernels import (
    friction,
    friction_scale,
    primitive,
    primitive_scale,
    surface_densities,
    weight,
)
from sph_gym.solver.lanes import like, maximum, minimum, reciprocal, rsqrt
from sph_gym.solver.registry import EFFECTS, effect
from sph_gym.solver.surface import (
    DISORDER,
    HELD_BACK,
    SHAPE_SCALE,
    calibrated_stress,
    inverse_weight,
    layer_viscosity,
)

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


@effect(typical=lambda scene: 0.2)
def tensile_correction(epsilon, given):
    """epsilon, about 0.2: a repulsion within dx that keeps particles from pairing under tension.

    Source: Monaghan 2000, section 3, eqs. 3.1 and 4.2.
    """
    # with h = dx no particle at rest is within the support, and none is near enough to correct
    at_dx = float(weight(given.kernel, given.dx**2, given.dx)) if given.h > given.dx else np.inf
    return TensileCorrection(epsilon, 1 / at_dx)


@jitable
def add_tensile_correction(effect, pair, stress):
    """R (W(r) / W(dx))^4, R = eps |p|/rho^2 of both under tension + 0.02 of the lesser pressure.

    Monaghan takes 0.01 of both pressures, which jumps where one of them changes its sign, so that
    round-off at p = 0 would decide on a force.
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


@effect(typical=lambda scene: 0.02, at_walls="no-slip")
def artificial_viscosity(alpha, given):
    """alpha, which multiplies the nominal sound speed and the support radius.

    Source: Monaghan 1992, eqs. 4.1 and 4.2.
    """
    return ArtificialViscosity(2 * alpha * given.c0 * given.h)


@jitable
def add_artificial_viscosity(effect, pair, stress):
    """Pi_ij = - alpha c0 h v.r / ((r^2 + eta^2) rho_mean) for pairs that approach.

    eta^2 = 0.01 h^2.
    """
    if effect is None:
        return stress
    approach = pair.slip_u * pair.dx + pair.slip_v * pair.dy
    approach = minimum(approach, like(approach, 0.0))
    return stress - effect.strength * (approach * pair.inv_rho_r2)


# --- Quadratic viscosity --------------------------------------------------------------------


class QuadraticViscosity(NamedTuple):
    """strength: 2 beta h^2 [m^2]."""

    strength: float


@effect(typical=lambda scene: 0.04, at_walls="no-slip")
def quadratic_viscosity(beta, given):
    """beta: a viscosity of fast approaches, against penetration.

    Source: Monaghan 1992, eq. 4.1, the beta term.
    """
    return QuadraticViscosity(2 * beta * given.h**2)


@jitable
def add_quadratic_viscosity(effect, pair, stress):
    """beta (h v.r / (r^2 + eta^2))^2 / rho_mean for pairs that approach."""
    if effect is None:
        return stress
    approach = pair.slip_u * pair.dx + pair.slip_v * pair.dy
    rate = minimum(approach, like(approach, 0.0)) * pair.inv_rho_r2
    return stress + effect.strength * (rate * rate * pair.density_sum)


# --- Laminar viscosity ----------------------------------------------------------------------


class LaminarViscosity(NamedTuple):
    """strength: 2 nu K rho0 / (m gradient_scale), K see `kernels.friction_scale`; h [m]."""

    strength: float
    h: float


@effect(typical=lambda scene: 1e-3 * scene.h * scene.fluid.c0, at_walls="no-slip")
def laminar_viscosity(nu, given):
    """Kinematic viscosity nu [m^2/s], calibrated on the lattice: the same with every kernel.

    Source: Morris, Fox, Zhu 1997, eq. 22.
    """
    scale = friction_scale(given.h, given.dx) * given.rho0 / given.mass
    return LaminarViscosity(2 * nu * scale / given.kernel.gradient_scale, given.h)


@jitable
def add_laminar_viscosity(effect, pair, ax, ay):
    """nu sum K rho0 / rho_mean (h - r)^3 (v_j - v_i); for the step see `kernels.viscous_share`.

    The mean density conserves momentum.
    """
    if effect is None:
        return ax, ay
    drag = effect.strength * (friction(effect.h, pair.r) * pair.inv_rho)
    return ax - drag * pair.slip_u, ay - drag * pair.slip_v


# --- Surface tension ------------------------------------------------------------------------


class SurfaceTension(NamedTuple):
    """strength: K V^2 shape scale / (m^2 gradient_scale), see `surface.calibrated_stress`;
    volume_scale: V times the shape's scale; h [m]; disorder2: square of the gradient that counts
    as none [1/m^2]; held_back: share of the pull; inv_weight: 1 / W shape(dx); friction:
    viscosity of the layer V rho0 h shape scale / (m gradient_scale).
    """

    strength: float
    volume_scale: float
    h: float
    disorder2: float
    held_back: float
    inv_weight: float
    friction: float


@effect(
    typical=lambda scene: 1e-4 * scene.fluid.rho0 * scene.fluid.c0**2 * scene.h, at_walls="never"
)
def surface_tension(sigma, given):
    """sigma [N/m]: a stress along the surface; boundary particles are not wetted.

    Source: Lafaurie et al. 1994; for particles Hu & Adams 2006.
    """
    kernel, h, volume = given.kernel, given.h, given.mass / given.rho0
    stress = calibrated_stress(sigma, kernel, volume, given.dx)
    shape_scale = SHAPE_SCALE / h**7
    pair_scale = volume * shape_scale / (given.mass * kernel.gradient_scale)
    return SurfaceTension(
        stress * volume / given.mass * pair_scale,
        volume * shape_scale,
        h,
        (DISORDER / h) ** 2,
        HELD_BACK,
        kernel.weight_scale * inverse_weight(kernel, given.dx),
        layer_viscosity(sigma, h, given.rho0) * given.rho0 * h * pair_scale,
    )


@jitable
def add_surface_tension(effect, pair, nx_i, ny_i, nx_j, ny_j, ax, ay):
    """Divergence of K (|n| - n n / |n|), a pull along the surface; n: of the share that is filled.

    Given as n / sqrt|n|. Equal and opposite between two particles, but not along their line. A
    share is held back between near neighbours, as in Monaghan 2000. The friction of the layer,
    nu h sum V (|n_i| + |n_j|) rho0 / (rho_i + rho_j) v.r / (r^2 + eta^2) grad W, is along it.
    """
    if effect is None:
        return ax, ay
    size = nx_i * nx_i + ny_i * ny_i + (nx_j * nx_j + ny_j * ny_j)
    along_i = nx_i * pair.dx + ny_i * pair.dy
    along_j = nx_j * pair.dx + ny_j * pair.dy
    rest = maximum(effect.h - pair.r, like(pair.r, 0.0))
    near = pair.weight * effect.inv_weight
    near = near * near * (near * near)
    slope = rest * rest * rest
    pull = effect.strength * slope * (like(pair.r, 1.0) - effect.held_back * near)
    parting = (pair.du * pair.dx + pair.dv * pair.dy) * pair.inv_rho_r2
    central = (pull + effect.friction * slope * parting) * size
    ax = ax - central * pair.dx + pull * (nx_i * along_i + nx_j * along_j)
    ay = ay - central * pair.dy + pull * (ny_i * along_i + ny_j * along_j)
    return ax, ay


# --- XSPH -----------------------------------------------------------------------------------


class Xsph(NamedTuple):
    """scale: 2 eps m weight_scale, eps being the control."""

    scale: float


@effect(at_walls="never", flag=True)
def xsph(named, given):
    """Smoothing of the velocity that moves the particles; its strength is `Controls.xsph`.

    Source: Monaghan 1992, eq. 4.9.
    """
    return Xsph(0.0)


@jitable
def add_xsph(effect, pair, sx, sy):
    """eps sum m (v_j - v_i) W / rho_mean: smooths the velocity that moves the particles."""
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

# Mach number that c0 is meant for, and the share of that speed that bounds the shifts.
MACH, TOP_SHIFT = 0.1, 0.5
# Share of the densities of the first two rows below a free surface up to which a particle is open.
OPEN = 0.7
# Share of 1 / h: a smaller gradient of the openness is no surface.
FAINT = 0.003


class Shifting(NamedTuple):
    """scale: 2 A U h m gradient_scale, U [m/s] a tenth of c0; top: the largest shift [m/s]; faint:
    A U FAINT [m/s]; closed: density [kg/m^3] from which on a particle is inside; inv_range: 1 / its
    distance from the density of a free surface.
    """

    scale: float
    top: float
    faint: float
    closed: float
    inv_range: float


@effect(typical=lambda scene: 1.0)
def shifting(factor, given):
    """A, about 2, times h and a tenth of c0: particles leave crowded places, inside the fluid.

    Source: Skillen, Lind, Stansby, Rogers 2013, eq. 13; at free surfaces Lind et al. 2012.
    """
    speed = MACH * given.c0
    force_scale = given.mass * given.kernel.gradient_scale
    first, second = surface_densities(
        given.kernel, given.mass, given.dx, primitive if given.effects.continuity else weight
    )
    span = max(OPEN * (second - first), 1e-3 * given.rho0)
    return Shifting(
        2 * factor * speed * given.h * force_scale, TOP_SHIFT * speed, FAINT * factor * speed,
        first + span, 1 / span,
    )  # fmt: skip


@jitable
def openness(effect, density):
    """Return 1 at a free surface, 0 inside; density: as the kernel sum [kg/m^3]."""
    if effect is None:
        return density
    zero, one = like(density, 0.0), like(density, 1.0)
    return minimum(maximum((effect.closed - density) * effect.inv_range, zero), one)


@jitable
def add_crowding(effect, pair, sums):
    """cx, cy: - grad C = - sum V_j grad W, the concentration of particles, V = m / rho_mean.

    ox, oy: the same sum of the openness of j. Source: Lind, Xu, Stansby, Rogers 2012, eq. 21.
    """
    if effect is None:
        return sums.cx, sums.cy, sums.ox, sums.oy
    crowd = pair.gradient * pair.inv_rho
    cx, cy, opening = crowd * pair.dx, crowd * pair.dy, openness(effect, pair.sum_j)
    return sums.cx + cx, sums.cy + cy, sums.ox + opening * cx, sums.oy + opening * cy


@jitable
def add_shift(effect, sums, density, tx, ty):
    """tx, ty and the velocity [m/s] with which particles leave where they are crowded.

    Near a free surface it has no part along the surface's normal, the gradient of the openness; at
    the surface itself there is none. The speed is the scene's own. density: as the kernel sum.
    """
    if effect is None:
        return tx, ty
    opening = openness(effect, density)
    x, y = effect.scale * sums.cx, effect.scale * sums.cy
    nx, ny = effect.scale * sums.ox - opening * x, effect.scale * sums.oy - opening * y
    size2 = nx * nx + ny * ny + effect.faint * effect.faint
    across = (x * nx + y * ny) * reciprocal(size2 + like(x, 1e-30))
    inside = like(x, 1.0) - opening
    x, y = inside * (x - across * nx), inside * (y - across * ny)
    size2 = x * x + y * y
    share = minimum(effect.top * rsqrt(size2 + like(size2, 1e-30)), like(size2, 1.0))
    return tx + share * x, ty + share * y


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


@effect(flag=True)
def continuity(named, given):
    """A density is rho0 plus the growth of the particle's kernel sum since the start.

    Source: Monaghan 1992, eq. 2.18, integrated exactly.
    """
    return Continuity(given.mass * primitive_scale(given.kernel))


class DensityDiffusion(NamedTuple):
    """strength: 2 delta c0 h, h the support radius [m^2/s]; hydro_x, hydro_y: rho0 g / c^2, with
    the c that follows from the stiffness control.
    """

    strength: float
    hydro_x: float
    hydro_y: float


@effect(
    typical=lambda scene: 0.1,
    at_walls="never",
    needs=("continuity", "a density that is summed needs none"),
)
def density_diffusion(delta, given):
    """delta of delta-SPH, about 0.1, for densities by continuity: smooths the densities.

    Source: Molteni & Colagrossi 2009; Fourtakas, Vacondio, Dominguez, Rogers 2020, eq. 11.
    """
    return DensityDiffusion(2 * delta * given.c0 * given.h, 0.0, 0.0)


@jitable
def add_density_diffusion(effect, pair, growth):
    """2 delta h c0 sum m / rho_mean (rho_j - rho_i - rho_H) (-dW/dr)/r: smooths the densities.

    rho_H is the difference that a fluid at rest under gravity has between the two places, so that
    a tank at rest stays what it is, linearised. h: smoothing length, half of the support radius.
    """
    if effect is None:
        return growth
    at_rest = effect.hydro_x * pair.dx + effect.hydro_y * pair.dy
    gap = pair.density_gap + at_rest
    return growth + effect.strength * (gap * (pair.gradient * pair.inv_rho))


# --- All of them ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Effects:
    """The effects that act on the fluid besides pressure; one that is left out costs nothing.

    gravity: (gx, gy) [m/s^2], or one of the kinds in gravity.py; artificial_viscosity: alpha;
    laminar_viscosity: nu [m^2/s]; surface_tension: sigma [N/m]; quadratic_viscosity: beta;
    tensile_correction, density_diffusion and shifting: without a unit. docs/solver.md has their
    terms and sources.

    Raises ValueError for values that aren't finite, for negative ones, and for a density
    diffusion without continuity.
    """

    gravity: AnyGravity | tuple[float, float] | None = None
    xsph: bool = False
    artificial_viscosity: float | None = None
    laminar_viscosity: float | None = None
    surface_tension: float | None = None
    quadratic_viscosity: float | None = None
    tensile_correction: float | None = None
    continuity: bool = False
    density_diffusion: float | None = None
    shifting: float | None = None

    def __post_init__(self) -> None:
        if self.gravity is not None and not isinstance(self.gravity, AnyGravity):
            vector = finite_array("effects.gravity", self.gravity, (2,))
            object.__setattr__(self, "gravity", Gravity(float(vector[0]), float(vector[1])))
        for each in EFFECTS:
            each.check(self)

    @property
    def field(self) -> AnyGravity | None:
        """The gravity as one of the kinds in gravity.py."""
        return None if isinstance(self.gravity, tuple) else self.gravity

    def gravity_at(self, time: float) -> NDArray[np.float64]:
        """Return the uniform part of gravity [m/s^2] at a time [s]; zero where there is none."""
        return np.zeros(2) if self.field is None else self.field.at(time)
