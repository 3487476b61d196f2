"""The forces: everything that acts between two particles, and on one.

The pair loop runs over the neighbours of a group of particles at once (neighbors.py): the group's
particles are the lanes of x, y ..., each neighbour is repeated in all lanes. Nothing is summed
across lanes, and groups do not depend on the number of threads, so neither does any sum.
"""

from typing import Any, NamedTuple

from sph_gym.solver.density import COINCIDENT
from sph_gym.solver.effects import (
    add_artificial_viscosity,
    add_crowding,
    add_density_diffusion,
    add_laminar_viscosity,
    add_pressure,
    add_quadratic_viscosity,
    add_shift,
    add_smoothing,
    add_surface_tension,
    add_tensile_correction,
    add_xsph,
)
from sph_gym.solver.gravity import add_gravity
from sph_gym.solver.jit import jitable
from sph_gym.solver.kernels import gradient, viscosity, weight
from sph_gym.solver.lanes import broadcast, like, load, reciprocal, rsqrt, select
from sph_gym.solver.neighbors import fluid_range, neighbor, wall_range
from sph_gym.solver.periodic import nearest_image


class Pair(NamedTuple):
    """Quantities of particle i and its neighbour j; kernel shapes are 0 from the support radius on.

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
    """Sums over the neighbours of particle i.

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


class Rates(NamedTuple):
    """Rates of change of a group of particles.

    ax, ay: acceleration [m/s^2]; tx, ty: what is added to the velocity that moves them [m/s];
    growth: d rho/dt by diffusion [kg/(m^3 s)].
    """

    ax: Any
    ay: Any
    tx: Any
    ty: Any
    growth: Any


class Target(NamedTuple):
    """A group of particles for which sums are taken."""

    x: Any
    y: Any
    u: Any
    v: Any
    rho: Any
    stress: Any
    nx: Any
    ny: Any


@jitable
def load_target(fluid, i):
    """Return the group that begins with fluid particle i as a target of sums."""
    x = load(fluid.x, i)
    return Target(
        x,
        load(fluid.y, i),
        load(fluid.u, i),
        load(fluid.v, i),
        load(fluid.rho, i),
        load(fluid.stress, i),
        load_or_zero(fluid.nx, i, x),
        load_or_zero(fluid.ny, i, x),
    )


# --- Pairs ----------------------------------------------------------------------------------


@jitable
def slip(ghost, own, j, difference):
    """Return v_i - v_j as viscosity sees it: at a wall that mirrors, with the mirrored velocity."""
    if ghost is None:
        return difference
    return difference + (broadcast(own, j) - broadcast(ghost, j))


@jitable
def load_or_zero(column, i, other):
    """Return the group's numbers of a column; zeros like `other` where there is none."""
    if column is None:
        return like(other, 0.0)
    return load(column, i)


@jitable
def broadcast_or_zero(column, j, zero):
    """Return particle j's number of a column; `zero` where there is none."""
    if column is None:
        return zero
    return broadcast(column, j)


@jitable
def add_pair(target, sources, j, kernel, constants, effects, sums):
    """Return sums plus everything that particle j of `sources` adds to them for `target`."""
    dx = nearest_image(constants.period_x, target.x - broadcast(sources.x, j))
    dy = nearest_image(constants.period_y, target.y - broadcast(sources.y, j))
    r2 = dx * dx + dy * dy + like(dx, COINCIDENT)
    inv_r = rsqrt(r2)
    r = r2 * inv_r
    softened_r2 = r2 + constants.eta2
    rho_j, stress_j = broadcast(sources.rho, j), broadcast(sources.stress, j)
    density_sum = target.rho + rho_j
    inv_rho_r2 = reciprocal(softened_r2 * density_sum)
    du, dv = target.u - broadcast(sources.u, j), target.v - broadcast(sources.v, j)
    near, zero = r2 < kernel.h2, like(r2, 0.0)
    pair = Pair(
        dx,
        dy,
        r2,
        r,
        du,
        dv,
        slip(sources.ghost_u, sources.u, j, du),
        slip(sources.ghost_v, sources.v, j, dv),
        target.stress,
        stress_j,
        rho_j - target.rho,
        density_sum,
        inv_rho_r2 * softened_r2,
        inv_rho_r2,
        select(near, weight(kernel, r2, r), zero),
        select(near, gradient(kernel, r2, r, inv_r), zero),
        select(near, viscosity(kernel, r2, r), zero),
    )
    stress = add_tensile_correction(effects.tensile_correction, pair, target.stress + stress_j)
    stress = add_artificial_viscosity(effects.artificial_viscosity, pair, stress)
    stress = add_quadratic_viscosity(effects.quadratic_viscosity, pair, stress)
    ax, ay = add_pressure(stress, pair, sums.ax, sums.ay)
    ax, ay = add_laminar_viscosity(effects.laminar_viscosity, pair, ax, ay)
    ax, ay = add_surface_tension(
        effects.surface_tension, pair, target.nx, target.ny,
        broadcast_or_zero(sources.nx, j, zero), broadcast_or_zero(sources.ny, j, zero), ax, ay,
    )  # fmt: skip
    sx, sy = add_xsph(effects.xsph, pair, sums.sx, sums.sy)
    growth = add_density_diffusion(effects.density_diffusion, pair, sums.growth)
    cx, cy = add_crowding(effects.shifting, pair, sums.cx, sums.cy)
    return Sums(ax, ay, sx, sy, growth, cx, cy)


@jitable
def add_pairs(target, sources, lists, first, last, model, effects, sums):
    """Return sums plus everything that the listed particles of `sources` add to them."""
    if sources is None:
        return sums
    for k in range(first, last):
        j = neighbor(lists, k)
        sums = add_pair(target, sources, j, model.kernel, model.constants, effects, sums)
    return sums


@jitable
def pair_sums(i, fluid, walls, lists, model):
    """Return the sums of the group that begins with fluid particle i, over fluid and walls."""
    target = load_target(fluid, i)
    zero = like(target.x, 0.0)
    sums = Sums(zero, zero, zero, zero, zero, zero, zero)
    begin, end = fluid_range(lists, i)
    sums = add_pairs(target, fluid, lists, begin, end, model, model.effects, sums)
    begin, end = wall_range(lists, i)
    return add_pairs(target, walls, lists, begin, end, model, model.wall_effects, sums)


# --- Single particles -----------------------------------------------------------------------


@jitable
def rates(i, fluid, walls, lists, model, time):
    """Return the rates of the group that begins with fluid particle i: all that acts on it."""
    sums, effects = pair_sums(i, fluid, walls, lists, model), model.effects
    scale, zero = model.constants.force_scale, like(sums.ax, 0.0)
    x, y, u, v = load(fluid.x, i), load(fluid.y, i), load(fluid.u, i), load(fluid.v, i)
    ax, ay = add_gravity(model.gravity, time, x, y, u, v, scale * sums.ax, scale * sums.ay)
    tx, ty = add_smoothing(effects.xsph, sums, zero, zero)
    tx, ty = add_shift(effects.shifting, sums, tx, ty)
    return Rates(ax, ay, tx, ty, scale * sums.growth)
