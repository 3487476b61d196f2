"""The only pair loops: kernel sums for the density, and everything that acts between two particles.

Both run over the neighbours of a group of particles at once (neighbors.py): the group's particles
are the lanes of x, y ..., each neighbour is repeated in all lanes. Nothing is summed across lanes,
and groups do not depend on the number of threads, so neither does any sum.
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
from sph_gym.solver.jit import jitable
from sph_gym.solver.kernels import gradient, viscosity, weight
from sph_gym.solver.lanes import broadcast, like, load, reciprocal, rsqrt, select, store, width
from sph_gym.solver.neighbors import (
    BEGIN,
    END,
    MIDDLE,
    SIZE,
    WIDEST_GROUP,
    collect,
    compact_group,
    count,
    count_rows,
    fluid_range,
    make_window,
    neighbor,
    own_blocks,
    own_part,
    rest_of_block,
    row_range,
    wall_range,
)

# Added to r^2 [m^2]: the direction of two coincident particles is 0 / 1e-15 = 0, not NaN.
COINCIDENT = 1e-30


class Constants(NamedTuple):
    """Numbers that all pair loops share, in the precision of the arrays.

    h: support radius [m]; reach2: its square with room for rounding [m^2]; eta2: 0.01 h^2 [m^2];
    density_scale: m weight_scale; force_scale: m gradient_scale.
    """

    h: Any
    reach2: Any
    eta2: Any
    density_scale: Any
    force_scale: Any


class Target(NamedTuple):
    """The particles for which a sum is taken."""

    x: Any
    y: Any
    u: Any
    v: Any
    rho: Any
    stress: Any


# --- Density --------------------------------------------------------------------------------


@jitable
def add_weights(sources, lists, first, last, kernel, x, y, total):
    """total + sum of W shapes between (x, y) and the listed `sources`, itself if it is one."""
    if sources is None:
        return total
    zero = like(total, 0.0)
    for k in range(first, last):
        j = neighbor(lists, k)
        dx = x - broadcast(sources.x, j)
        dy = y - broadcast(sources.y, j)
        r2 = dx * dx + dy * dy
        r = r2 * rsqrt(r2 + like(r2, COINCIDENT))
        total += select(r2 < kernel.h2, weight(kernel, r2, r), zero)
    return total


@jitable
def store_density(particles, i, n, total, eos, density_scale):
    """rho and p / rho^2 of particles i to i + n from their kernel sums."""
    rho = density_scale * total
    store(particles.rho, i, rho, n)
    store(particles.stress, i, pressure(eos, rho) * reciprocal(rho * rho), n)


@jitable
def compute_fluid_density(
    rank,
    n_threads,
    first,
    last,
    fluid,
    start,
    walls,
    wall_start,
    grid,
    lists,
    kernel,
    eos,
    constants,
):
    """rho and p / rho^2 of fluid particles first to last: self, fluid and walls; and the lists.

    Returns whether the thread's list was too short, in which case not all of it was done.
    """
    k, room = own_part(lists, rank, n_threads)
    for row in range(count_rows(grid)):
        low, high = row_range(grid, start, row)
        i, high = max(low, first), min(high, last)
        while i < high:
            n = rest_of_block(i - low, width(fluid.x), high - i)
            n, k = list_group(
                lists, fluid, start, walls, wall_start, grid, constants, i, n, k, room
            )
            if k > room:
                return True
            x, y = load(fluid.x, i), load(fluid.y, i)
            begin, end = fluid_range(lists, i, fluid.id.size)
            total = add_weights(fluid, lists, begin, end, kernel, x, y, like(x, 0.0))
            begin, end = wall_range(lists, i, count(walls))
            total = add_weights(walls, lists, begin, end, kernel, x, y, total)
            store_density(fluid, i, n, total, eos, constants.density_scale)
            i += n
    return False


@jitable
def list_group(lists, fluid, start, walls, wall_start, grid, constants, i, n, k, room):
    """Write down the neighbours of a group of at most n; its size and the list's new end."""
    if lists is None:
        return n, k
    n, box = compact_group(fluid, i, n, WIDEST_GROUP * constants.h)
    window, reach2 = make_window(grid, box), constants.reach2
    middle = collect(window, start, grid.n_columns, fluid, reach2, lists, k, room)
    end = collect(window, wall_start, grid.n_columns, walls, reach2, lists, middle, room)
    groups = lists.groups
    groups[4 * i + BEGIN], groups[4 * i + MIDDLE] = k, middle
    groups[4 * i + END], groups[4 * i + SIZE] = end, n
    return n, end


@jitable
def list_sources(lists, walls, sources, start, grid, constants, i, n, begin, room):
    """The neighbours of a group of wall particles, for this moment only; its size, their end."""
    if lists is None:
        return n, sources.id.size
    n, box = compact_group(walls, i, n, WIDEST_GROUP * constants.h)
    window = make_window(grid, box)
    return n, collect(window, start, grid.n_columns, sources, constants.reach2, lists, begin, room)


@jitable
def compute_wall_density(
    rank, n_threads, walls, wall_sums, wall_start, fluid, start, grid, lists, kernel, eos, constants
):
    """The same for wall particles, whose sum over each other never changes."""
    if walls is None:
        return False
    first, last = own_blocks(grid, wall_start, walls.id.size, width(walls.x), rank, n_threads)
    begin, room = own_part(lists, rank, n_threads)
    for row in range(count_rows(grid)):
        low, high = row_range(grid, wall_start, row)
        i, high = max(low, first), min(high, last)
        while i < high:
            n = rest_of_block(i - low, width(walls.x), high - i)
            n, end = list_sources(lists, walls, fluid, start, grid, constants, i, n, begin, room)
            if lists is not None and end > room:
                return True
            x, y, total = load(walls.x, i), load(walls.y, i), load(wall_sums, i)
            total = add_weights(fluid, lists, begin, end, kernel, x, y, total)
            store_density(walls, i, n, total, eos, constants.density_scale)
            i += n
    return False


@jitable
def compute_wall_sums(
    rank, n_threads, walls, wall_sums, wall_start, grid, lists, kernel, constants
):
    """The kernel sums of wall particles over each other, once for all, in the order of `walls`.

    Returns whether the thread's part of the list was too short.
    """
    begin, room = own_part(lists, rank, n_threads)
    for row in range(count_rows(grid)):
        low, high = row_range(grid, wall_start, row)
        i = low
        while i < high:
            n = rest_of_block(i - low, width(walls.x), high - i)
            n, end = list_sources(
                lists, walls, walls, wall_start, grid, constants, i, n, begin, room
            )
            if lists is not None and end > room:
                return True
            x, y = load(walls.x, i), load(walls.y, i)
            total = add_weights(walls, lists, begin, end, kernel, x, y, like(x, 0.0))
            store(wall_sums, i, total, n)
            i += n
    return False


# --- Forces ---------------------------------------------------------------------------------


@jitable
def add_pair(target, sources, j, kernel, constants, effects, sums):
    """sums + everything that particle j of `sources` does to `target`."""
    dx = target.x - broadcast(sources.x, j)
    dy = target.y - broadcast(sources.y, j)
    r2 = dx * dx + dy * dy + like(dx, COINCIDENT)
    inv_r = rsqrt(r2)
    r = r2 * inv_r
    softened_r2 = r2 + constants.eta2
    inv_rho_r2 = reciprocal(softened_r2 * (target.rho + broadcast(sources.rho, j)))
    near, zero = r2 < kernel.h2, like(r2, 0.0)
    pair = Pair(
        dx,
        dy,
        target.u - broadcast(sources.u, j),
        target.v - broadcast(sources.v, j),
        target.stress + broadcast(sources.stress, j),
        inv_rho_r2 * softened_r2,
        inv_rho_r2,
        select(near, weight(kernel, r2, r), zero),
        select(near, gradient(kernel, r2, r, inv_r), zero),
        select(near, viscosity(kernel, r2, r), zero),
    )
    stress = add_artificial_viscosity(effects.artificial_viscosity, pair, pair.stress)
    ax, ay = add_pressure(stress, pair, sums.ax, sums.ay)
    ax, ay = add_laminar_viscosity(effects.laminar_viscosity, pair, ax, ay)
    sx, sy = add_xsph(effects.xsph, pair, sums.sx, sums.sy)
    return Sums(ax, ay, sx, sy)


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
    )
    zero = like(target.x, 0.0)
    sums = Sums(zero, zero, zero, zero)
    begin, end = fluid_range(lists, i, fluid.id.size)
    sums = add_forces(target, fluid, lists, begin, end, kernel, constants, effects, sums)
    begin, end = wall_range(lists, i, count(walls))
    return add_forces(target, walls, lists, begin, end, kernel, constants, wall_effects, sums)
