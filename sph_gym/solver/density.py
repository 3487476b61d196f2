"""Density and pressure of the fluid, and the lists of neighbours that are made on the way.

A density is the kernel sum over all neighbours, plus an offset of each particle where densities
follow the continuity equation.
"""

from sph_gym.solver.equation_of_state import pressure
from sph_gym.solver.jit import jitable
from sph_gym.solver.kernels import primitive, weight
from sph_gym.solver.lanes import (
    broadcast,
    like,
    load,
    maximum,
    reciprocal,
    rsqrt,
    select,
    store,
    width,
)
from sph_gym.solver.neighbors import (
    BEGIN,
    END,
    MIDDLE,
    SIZE,
    collect_images,
    compact_group,
    fluid_range,
    neighbor,
    own_part,
    rest_of_block,
    row_range,
    wall_range,
)
from sph_gym.solver.periodic import nearest_image
from sph_gym.solver.tunnelling import first_walled

# Added to r^2 [m^2]: the direction of two coincident particles is 0 / 1e-15 = 0, not NaN.
COINCIDENT = 1e-30


@jitable
def shape(continuity, kernel, r2, r):
    """Return W, or with continuity the shape whose derivative is the pressure gradient."""
    if continuity is None:
        return weight(kernel, r2, r)
    return primitive(kernel, r2, r)


@jitable
def shape_scale(continuity, constants):
    """Return the factor of a sum of shapes."""
    if continuity is None:
        return constants.density_scale
    return continuity.scale


@jitable
def add_weights(continuity, sources, lists, first, last, kernel, constants, x, y, total):
    """Return total plus the shapes between (x, y) and the listed `sources`, itself included."""
    if sources is None:
        return total
    zero = like(total, 0.0)
    for k in range(first, last):
        j = neighbor(lists, k)
        dx = nearest_image(constants.period_x, x - broadcast(sources.x, j))
        dy = nearest_image(constants.period_y, y - broadcast(sources.y, j))
        r2 = dx * dx + dy * dy
        r = r2 * rsqrt(r2 + like(r2, COINCIDENT))
        total += select(r2 < kernel.h2, shape(continuity, kernel, r2, r), zero)
    return total


@jitable
def store_density(particles, i, n, rho, eos):
    """Store rho and p / rho^2 of particles i to i + n."""
    store(particles.rho, i, rho, n)
    store(particles.stress, i, pressure(eos, rho) * reciprocal(rho * rho), n)


@jitable
def density(continuity, fluid, i, walls, lists, kernel, constants):
    """Return rho of the group of fluid particle i, and the contribution of walls to it."""
    x, y, scale = load(fluid.x, i), load(fluid.y, i), shape_scale(continuity, constants)
    begin, end = fluid_range(lists, i)
    own = add_weights(continuity, fluid, lists, begin, end, kernel, constants, x, y, like(x, 0.0))
    begin, end = wall_range(lists, i)
    total = add_weights(continuity, walls, lists, begin, end, kernel, constants, x, y, own)
    return add_offset(fluid.offset, i, scale * total), scale * (total - own)


@jitable
def add_offset(offset, i, rho):
    """Return rho plus the column `offset` where there is one."""
    if offset is None:
        return rho
    return rho + load(offset, i)


@jitable
def add_normals(tension, sources, lists, first, last, constants, x, y, nx, ny):
    """nx, ny + sum of grad W shapes between (x, y) and the listed `sources`."""
    if sources is None:
        return nx, ny
    zero = like(nx, 0.0)
    for k in range(first, last):
        j = neighbor(lists, k)
        dx = nearest_image(constants.period_x, x - broadcast(sources.x, j))
        dy = nearest_image(constants.period_y, y - broadcast(sources.y, j))
        r2 = dx * dx + dy * dy + like(nx, COINCIDENT)
        rest = maximum(tension.h - r2 * rsqrt(r2), zero)
        slope = rest * rest * rest
        nx, ny = nx - slope * dx, ny - slope * dy
    return nx, ny


@jitable
def store_normals(tension, fluid, i, n, walls, lists, constants):
    """n / sqrt|n|, n the gradient of the share of space that is filled, at the group of i.

    Walls count as filled: a surface ends at them, and isn't drawn along them.
    """
    if tension is None:
        return
    x, y = load(fluid.x, i), load(fluid.y, i)
    zero = like(x, 0.0)
    begin, end = fluid_range(lists, i)
    nx, ny = add_normals(tension, fluid, lists, begin, end, constants, x, y, zero, zero)
    begin, end = wall_range(lists, i)
    nx, ny = add_normals(tension, walls, lists, begin, end, constants, x, y, nx, ny)
    nx, ny = tension.volume_scale * nx, tension.volume_scale * ny
    inv_size = rsqrt(nx * nx + ny * ny + tension.disorder2)
    # 1 / sqrt|n|: the square root of 1 / |n|
    inv_root = inv_size * rsqrt(inv_size)
    store(fluid.nx, i, inv_root * nx, n)
    store(fluid.ny, i, inv_root * ny, n)


@jitable
def compute_fluid_density(rank, n_threads, first, last, cells, model, grid, dt):
    """Compute lists, rho and p / rho^2 of fluid particles first to last.

    Return the end of the thread's list, beyond its room if that was too short, in which case not
    all of it was done; and the first particle that is inside a wall, or -1.
    """
    fluid, walls, lists, constants = cells.fluid, cells.walls, cells.lists, model.constants
    k, room = own_part(lists, rank, n_threads)
    walled = -1
    for row in range(grid.n_rows):
        low, high = row_range(grid, cells.start, row)
        i, high = max(low, first), min(high, last)
        while i < high:
            n = rest_of_block(i - low, width(fluid.x), high - i)
            n, k = list_group(cells, grid, constants, i, n, k, room)
            if k > room:
                return k, walled
            rho, of_walls = density(
                model.effects.continuity, fluid, i, walls, lists, model.kernel, constants
            )
            inside = first_walled(walls, model, cells, i, n, of_walls, dt)
            if inside >= 0 and walled < 0:
                walled = i + inside
            store_density(fluid, i, n, rho, model.eos)
            store_normals(model.effects.surface_tension, fluid, i, n, walls, lists, constants)
            i += n
    return k, walled


@jitable
def list_group(cells, grid, constants, i, n, k, room):
    """Write down the neighbours of a group of at most n. Return its size and the list's end."""
    fluid, lists = cells.fluid, cells.lists
    n, box = compact_group(fluid, i, n, constants.widest)
    middle = collect_images(constants, box, grid, cells.start, fluid, lists, k, room)
    end = collect_images(constants, box, grid, cells.wall_start, cells.walls, lists, middle, room)
    groups = lists.groups
    groups[4 * i + BEGIN], groups[4 * i + MIDDLE] = k, middle
    groups[4 * i + END], groups[4 * i + SIZE] = end, n
    return n, end
