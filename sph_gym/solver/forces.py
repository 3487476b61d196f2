"""The only pair loops: kernel sums for the density, and everything that acts between two particles.

Neighbours come as rows of cells and spans of consecutive particles (neighbors.py); the range over
a span is unsigned, since a signed index would keep LLVM from vectorising the loop.
"""

from typing import Any, NamedTuple

from sph_gym.solver.effects import (
    Pair,
    Sums,
    add_artificial_viscosity,
    add_laminar_viscosity,
    add_pressure,
    add_xsph,
)
from sph_gym.solver.equation_of_state import pressure
from sph_gym.solver.jit import jit
from sph_gym.solver.kernels import gradient, viscosity, weight
from sph_gym.solver.lanes import like, reciprocal, rsqrt, select
from sph_gym.solver.neighbors import rows, span

# Added to r^2 [m^2]: the direction of two coincident particles is 0 / 1e-15 = 0, not NaN.
COINCIDENT = 1e-30


class Constants(NamedTuple):
    """Numbers that all pair loops share, in the precision of the arrays.

    h2: h^2 [m^2]; eta2: 0.01 h^2 [m^2]; density_scale: m weight_scale; force_scale:
    m gradient_scale.
    """

    h2: Any
    eta2: Any
    density_scale: Any
    force_scale: Any


class Target(NamedTuple):
    """The particle for which a sum is taken."""

    x: Any
    y: Any
    u: Any
    v: Any
    rho: Any
    stress: Any


@jit
def add_weights(sources, start, grid, kernel, h2, x, y, total):
    """total + sum of W shapes between (x, y) and `sources`, itself included if it is one."""
    if sources is None:
        return total
    first_row, last_row = rows(grid, y)
    for row in range(first_row, last_row):
        low, high = span(grid, start, row, x)
        for j in range(low, high):
            dx = x - sources.x[j]
            dy = y - sources.y[j]
            r2 = dx * dx + dy * dy
            r = r2 * rsqrt(r2 + like(r2, COINCIDENT))
            total += select(r2 < h2, weight(kernel, r2, r), like(r2, 0.0))
    return total


@jit
def compute_fluid_density(fluid, start, walls, wall_start, grid, kernel, eos, constants):
    """rho and p / rho^2 of every fluid particle: self, fluid and wall contributions."""
    for i in range(fluid.x.size):
        x, y = fluid.x[i], fluid.y[i]
        total = add_weights(fluid, start, grid, kernel, constants.h2, x, y, like(x, 0.0))
        total = add_weights(walls, wall_start, grid, kernel, constants.h2, x, y, total)
        rho = constants.density_scale * total
        fluid.rho[i] = rho
        fluid.stress[i] = pressure(eos, rho) * reciprocal(rho * rho)


@jit
def compute_wall_sums(walls, start, grid, kernel, h2):
    """The kernel sums of wall particles over each other, by their public index, once for all."""
    for i in range(walls.x.size):
        x, y = walls.x[i], walls.y[i]
        total = add_weights(walls, start, grid, kernel, h2, x, y, like(x, 0.0))
        walls.wall_sum[walls.id[i]] = total


@jit
def compute_wall_density(walls, fluid, start, grid, kernel, eos, constants):
    """The same for wall particles, whose sum over each other never changes."""
    if walls is None:
        return
    for i in range(walls.x.size):
        x, y = walls.x[i], walls.y[i]
        total = walls.wall_sum[walls.id[i]]
        total = add_weights(fluid, start, grid, kernel, constants.h2, x, y, total)
        rho = constants.density_scale * total
        walls.rho[i] = rho
        walls.stress[i] = pressure(eos, rho) * reciprocal(rho * rho)


@jit
def add_pair(target, sources, j, kernel, constants, effects, sums):
    """sums + everything that particle j of `sources` does to `target`."""
    dx = target.x - sources.x[j]
    dy = target.y - sources.y[j]
    r2 = dx * dx + dy * dy
    inv_r = rsqrt(r2 + like(r2, COINCIDENT))
    r = r2 * inv_r
    rho = target.rho + sources.rho[j]
    softened_r2 = r2 + constants.eta2
    inv_rho_r2 = reciprocal(softened_r2 * rho)
    zero = like(r2, 0.0)
    pair = Pair(
        dx,
        dy,
        target.u - sources.u[j],
        target.v - sources.v[j],
        target.stress + sources.stress[j],
        inv_rho_r2 * softened_r2,
        inv_rho_r2,
        select(r2 < constants.h2, weight(kernel, r2, r), zero),
        select(r2 < constants.h2, gradient(kernel, r2, r, inv_r), zero),
        select(r2 < constants.h2, viscosity(kernel, r2, r), zero),
    )
    stress = add_artificial_viscosity(effects.artificial_viscosity, pair, pair.stress)
    ax, ay = add_pressure(stress, pair, sums.ax, sums.ay)
    ax, ay = add_laminar_viscosity(effects.laminar_viscosity, pair, ax, ay)
    sx, sy = add_xsph(effects.xsph, pair, sums.sx, sums.sy)
    return Sums(ax, ay, sx, sy)


@jit
def add_forces(target, sources, start, grid, kernel, constants, effects, sums):
    """sums + everything that all particles of `sources` do to `target`."""
    if sources is None:
        return sums
    first_row, last_row = rows(grid, target.y)
    for row in range(first_row, last_row):
        low, high = span(grid, start, row, target.x)
        for j in range(low, high):
            sums = add_pair(target, sources, j, kernel, constants, effects, sums)
    return sums


@jit
def force_sums(i, fluid, start, walls, wall_start, grid, model):
    """The sums of fluid particle i over fluid and walls."""
    target = Target(fluid.x[i], fluid.y[i], fluid.u[i], fluid.v[i], fluid.rho[i], fluid.stress[i])
    zero = like(target.x, 0.0)
    sums = Sums(zero, zero, zero, zero)
    kernel, constants = model.kernel, model.constants
    sums = add_forces(target, fluid, start, grid, kernel, constants, model.effects, sums)
    return add_forces(target, walls, wall_start, grid, kernel, constants, model.wall_effects, sums)
