"""The pair loop: everything that acts between two particles.

It runs over the neighbours of a group of particles at once (neighbors.py): the group's particles
are the lanes of x, y ..., each neighbour is repeated in all lanes. Nothing is summed across lanes,
and groups do not depend on the number of threads, so neither does any sum.
"""

from typing import Any, NamedTuple

from sph_gym.solver.density import COINCIDENT
from sph_gym.solver.effects import (
    Pair,
    Sums,
    add_artificial_viscosity,
    add_crowding,
    add_density_diffusion,
    add_laminar_viscosity,
    add_pressure,
    add_quadratic_viscosity,
    add_surface_tension,
    add_tensile_correction,
    add_xsph,
)
from sph_gym.solver.jit import jitable
from sph_gym.solver.kernels import gradient, viscosity, weight
from sph_gym.solver.lanes import broadcast, like, load, reciprocal, rsqrt, select
from sph_gym.solver.neighbors import count, fluid_range, neighbor, wall_range
from sph_gym.solver.walls import nearest_image


class Target(NamedTuple):
    """The particles for which a sum is taken."""

    x: Any
    y: Any
    u: Any
    v: Any
    rho: Any
    stress: Any
    nx: Any
    ny: Any


@jitable
def slip(ghost, own, j, difference):
    """v_i - v_j as viscosity sees it: of a wall that mirrors, with the mirrored velocity."""
    if ghost is None:
        return difference
    return difference + (broadcast(own, j) - broadcast(ghost, j))


@jitable
def loaded(column, i, other):
    """The group's numbers of a column, zeros like `other` where there is none."""
    if column is None:
        return like(other, 0.0)
    return load(column, i)


@jitable
def repeated(column, j, zero):
    """Particle j's number of a column, `zero` where there is none."""
    if column is None:
        return zero
    return broadcast(column, j)


@jitable
def add_pair(target, sources, j, kernel, constants, effects, sums):
    """sums + everything that particle j of `sources` does to `target`."""
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
        repeated(sources.nx, j, zero), repeated(sources.ny, j, zero), ax, ay,
    )  # fmt: skip
    sx, sy = add_xsph(effects.xsph, pair, sums.sx, sums.sy)
    growth = add_density_diffusion(effects.density_diffusion, pair, sums.growth)
    cx, cy = add_crowding(effects.shifting, pair, sums.cx, sums.cy)
    return Sums(ax, ay, sx, sy, growth, cx, cy)


@jitable
def add_forces(target, sources, lists, first, last, kernel, constants, effects, sums):
    """sums + everything that the listed particles of `sources` do to `target`."""
    if sources is None:
        return sums
    for k in range(first, last):
        j = neighbor(lists, k)
        sums = add_pair(target, sources, j, kernel, constants, effects, sums)
    return sums


@jitable
def force_sums(i, fluid, walls, lists, kernel, constants, effects, wall_effects):
    """The sums of the group that begins with fluid particle i, over fluid and walls."""
    target = Target(
        load(fluid.x, i),
        load(fluid.y, i),
        load(fluid.u, i),
        load(fluid.v, i),
        load(fluid.rho, i),
        load(fluid.stress, i),
        loaded(fluid.nx, i, load(fluid.x, i)),
        loaded(fluid.ny, i, load(fluid.x, i)),
    )
    zero = like(target.x, 0.0)
    sums = Sums(zero, zero, zero, zero, zero, zero, zero)
    begin, end = fluid_range(lists, i, fluid.id.size)
    sums = add_forces(target, fluid, lists, begin, end, kernel, constants, effects, sums)
    begin, end = wall_range(lists, i, count(walls))
    return add_forces(target, walls, lists, begin, end, kernel, constants, wall_effects, sums)
