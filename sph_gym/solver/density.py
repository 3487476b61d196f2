"""Density and pressure of fluid and walls, and the lists of neighbours that they find on the way.

Fluid: the kernel sum over everybody, and an offset of each particle where densities follow the
continuity equation. Boundary particles: a kernel sum as well, or the pressure of the fluid around
them.
"""

from typing import Any, NamedTuple

from sph_gym.solver.equation_of_state import density_at, pressure
from sph_gym.solver.gravity import add_gravity
from sph_gym.solver.jit import jitable
from sph_gym.solver.kernels import primitive, weight
from sph_gym.solver.lanes import (
    broadcast,
    first_lanes,
    first_true,
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
    count,
    count_rows,
    fluid_range,
    neighbor,
    own_blocks,
    own_part,
    rest_of_block,
    row_range,
    wall_range,
)
from sph_gym.solver.walls import nearest_image

# A fluid particle of whose density walls alone make more than this share of rho0 is inside of one.
# They make up to 0.7 in a corner, up to 0.85 in a hole of one particle, and 1 within.
WALLED = 0.9
# Where nothing stands behind the walls' particles, who moves farther than this share of h in a step
# may be over a wall before that makes 0.9 of a density. Whose path then passes a wall's particle by
# less than this share of dx is in the wall: between two of them, half of dx is left.
LEAP, REACH = 0.5, 0.75
# Added to r^2 [m^2]: the direction of two coincident particles is 0 / 1e-15 = 0, not NaN.
COINCIDENT = 1e-30


class Constants(NamedTuple):
    """Numbers that all pair loops share, in the precision of the arrays.

    h: support radius [m]; reach2: its square with room for rounding [m^2]; eta2: 0.01 h^2 [m^2];
    density_scale: m weight_scale; force_scale: m gradient_scale; widest: of a group [m];
    period_x, period_y: where space closes upon itself, or None.
    """

    h: Any
    reach2: Any
    eta2: Any
    density_scale: Any
    force_scale: Any
    widest: Any
    period_x: Any
    period_y: Any


class Ghosts(NamedTuple):
    """What a boundary particle gathers from the fluid around it, weighted with W.

    weight: sum of W shapes; p, rx, ry: of p, of rho times the offset from the fluid; u, v.
    """

    weight: Any
    p: Any
    rx: Any
    ry: Any
    u: Any
    v: Any


# --- Fluid ----------------------------------------------------------------------------------


@jitable
def shape(continuity, kernel, r2, r):
    """What is summed: W, or what the pressure's gradient is the derivative of."""
    if continuity is None:
        return weight(kernel, r2, r)
    return primitive(kernel, r2, r)


@jitable
def shape_scale(continuity, constants):
    """What a sum of shapes is multiplied by."""
    if continuity is None:
        return constants.density_scale
    return continuity.scale


@jitable
def add_weights(continuity, sources, lists, first, last, kernel, constants, x, y, total):
    """total + sum of W shapes between (x, y) and the listed `sources`, itself if it is one."""
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
    """rho and p / rho^2 of particles i to i + n."""
    store(particles.rho, i, rho, n)
    store(particles.stress, i, pressure(eos, rho) * reciprocal(rho * rho), n)


@jitable
def density(continuity, fluid, i, walls, lists, kernel, constants):
    """rho of the group of fluid particle i: the sum over everybody, and its offset.

    Also returns how much of it the walls make.
    """
    x, y, scale = load(fluid.x, i), load(fluid.y, i), shape_scale(continuity, constants)
    begin, end = fluid_range(lists, i, fluid.id.size)
    own = add_weights(continuity, fluid, lists, begin, end, kernel, constants, x, y, like(x, 0.0))
    begin, end = wall_range(lists, i, count(walls))
    total = add_weights(continuity, walls, lists, begin, end, kernel, constants, x, y, own)
    return add_offset(fluid.offset, i, scale * total), scale * (total - own)


@jitable
def first_walled(walls, alone, fluid, i, n, of_walls, eos, constants, dt):
    """The first of n lanes from particle i on that is inside of a wall, or may have jumped it.

    of_walls: how much of their densities the walls make. Returns -1 if nobody is.
    """
    if walls is None:
        return -1
    share = of_walls * like(of_walls, eos.inv_rho0)
    inside = first_true((share > like(share, WALLED)) & first_lanes(share, n))
    return first_leap(walls, alone, fluid, i, n, constants, dt) if inside < 0 else inside


@jitable
def first_leap(walls, alone, fluid, i, n, constants, dt):
    """The first of n lanes that leapt into or over boundary particles that stand alone, or -1."""
    if alone is None:
        return -1
    u, v = dt * load(fluid.u, i), dt * load(fluid.v, i)
    fast = u * u + v * v > like(u, alone.leap * alone.leap)
    first = first_true(fast & first_lanes(u, n))
    if first < 0:
        return -1
    # so few that each may look at every wall particle
    for lane in range(first, n):
        if leapt(walls, alone, fluid, i + lane, constants, dt):
            return lane
    return -1


@jitable
def leapt(walls, alone, fluid, i, constants, dt):
    """Whether the path of fluid particle i in the last step passed close by a wall particle."""
    u, v = dt * fluid.u[i], dt * fluid.v[i]
    length2 = u * u + v * v
    if not length2 > alone.leap * alone.leap:
        return False
    for j in range(walls.id.size):
        dx = nearest_image(constants.period_x, fluid.x[i] - walls.x[j])
        dy = nearest_image(constants.period_y, fluid.y[i] - walls.y[j])
        back = min(max((dx * u + dy * v) / length2, 0.0), 1.0)
        dx, dy = dx - back * u, dy - back * v
        if dx * dx + dy * dy < alone.reach * alone.reach:
            return True
    return False


@jitable
def add_offset(offset, i, rho):
    """rho, and the column `offset` where there is one."""
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
    begin, end = fluid_range(lists, i, fluid.id.size)
    nx, ny = add_normals(tension, fluid, lists, begin, end, constants, x, y, zero, zero)
    begin, end = wall_range(lists, i, count(walls))
    nx, ny = add_normals(tension, walls, lists, begin, end, constants, x, y, nx, ny)
    nx, ny = tension.volume_scale * nx, tension.volume_scale * ny
    inv_size = rsqrt(nx * nx + ny * ny + tension.disorder2)
    # 1 / sqrt|n|: the square root of 1 / |n|
    inv_root = inv_size * rsqrt(inv_size)
    store(fluid.nx, i, inv_root * nx, n)
    store(fluid.ny, i, inv_root * ny, n)


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
    effects,
    alone,
    dt,
):
    """Lists, rho and p / rho^2 of fluid particles first to last.

    Returns where the thread's list ends, beyond its room if that was too short, in which case not
    all of it was done; and the first particle that is inside of a wall, or -1.
    """
    k, room = own_part(lists, rank, n_threads)
    walled = -1
    for row in range(count_rows(grid)):
        low, high = row_range(grid, start, row)
        i, high = max(low, first), min(high, last)
        while i < high:
            n = rest_of_block(i - low, width(fluid.x), high - i)
            n, k = list_group(
                lists, fluid, start, walls, wall_start, grid, constants, i, n, k, room
            )
            if k > room:
                return k, walled
            rho, of_walls = density(effects.continuity, fluid, i, walls, lists, kernel, constants)
            inside = first_walled(walls, alone, fluid, i, n, of_walls, eos, constants, dt)
            if inside >= 0 and walled < 0:
                walled = i + inside
            store_density(fluid, i, n, rho, eos)
            store_normals(effects.surface_tension, fluid, i, n, walls, lists, constants)
            i += n
    return k, walled


@jitable
def list_group(lists, fluid, start, walls, wall_start, grid, constants, i, n, k, room):
    """Write down the neighbours of a group of at most n; its size and the list's new end."""
    if lists is None:
        return n, k
    n, box = compact_group(fluid, i, n, constants.widest)
    middle = collect_images(constants, box, grid, start, fluid, lists, k, room)
    end = collect_images(constants, box, grid, wall_start, walls, lists, middle, room)
    groups = lists.groups
    groups[4 * i + BEGIN], groups[4 * i + MIDDLE] = k, middle
    groups[4 * i + END], groups[4 * i + SIZE] = end, n
    return n, end


# --- Boundary particles like fluid ----------------------------------------------------------


@jitable
def list_sources(lists, walls, sources, start, grid, constants, i, n, begin, room):
    """The neighbours of a group of wall particles, for this moment only; its size, their end."""
    if lists is None:
        return n, sources.id.size
    n, box = compact_group(walls, i, n, constants.widest)
    return n, collect_images(constants, box, grid, start, sources, lists, begin, room)


@jitable
def compute_wall_density(
    rank, n_threads, walls, wall_sums, wall_start, fluid, start, grid, lists, kernel, eos, constants
):
    """rho and p / rho^2 of wall particles; their sums over each other are known beforehand.

    Returns whether the thread's part of the list was too short.
    """
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
            total = add_weights(None, fluid, lists, begin, end, kernel, constants, x, y, total)
            store_density(walls, i, n, constants.density_scale * total, eos)
            i += n
    return False


@jitable
def compute_wall_sums(
    rank, n_threads, walls, wall_sums, wall_start, grid, lists, kernel, constants
):
    """The kernel sums of wall particles over each other, in the order of `walls`.

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
            total = add_weights(
                None, walls, lists, begin, end, kernel, constants, x, y, like(x, 0.0)
            )
            store(wall_sums, i, total, n)
            i += n
    return False


# --- Boundary particles with the fluid's pressure -------------------------------------------


class Alone(NamedTuple):
    """Boundary particles with neither box nor plates at their face.

    leap: of who moves farther than this [m] in a step, the path is looked at; reach: closer than
    this [m] to one of them, it leads into the wall.
    """

    leap: float
    reach: float


class Extrapolation(NamedTuple):
    """least: sum of W shapes below which a boundary particle counts as dry."""

    least: float


@jitable
def gather(sources, lists, first, last, kernel, constants, x, y, ghosts):
    """ghosts + what the listed fluid particles give to boundary particles at (x, y)."""
    for k in range(first, last):
        j = neighbor(lists, k)
        dx = nearest_image(constants.period_x, x - broadcast(sources.x, j))
        dy = nearest_image(constants.period_y, y - broadcast(sources.y, j))
        r2 = dx * dx + dy * dy
        r = r2 * rsqrt(r2 + like(r2, COINCIDENT))
        near = r2 < kernel.h2
        w = select(near, weight(kernel, r2, r), like(r2, 0.0))
        rho = broadcast(sources.rho, j)
        mass = w * rho
        ghosts = Ghosts(
            ghosts.weight + w,
            ghosts.p + mass * (rho * broadcast(sources.stress, j)),
            ghosts.rx + mass * dx,
            ghosts.ry + mass * dy,
            ghosts.u + w * broadcast(sources.u, j),
            ghosts.v + w * broadcast(sources.v, j),
        )
    return ghosts


@jitable
def minus_own(own, i, a):
    """The acceleration a, less that of the wall itself if it moves."""
    if own is None:
        return a
    return a - load(own, i)


@jitable
def mirror(ghost, own, i, n, inv_weight, total):
    """Store the velocity that makes the fluid's mean that of the wall, at a wall without slip."""
    if ghost is None:
        return
    wall = load(own, i)
    seen = select(inv_weight > like(wall, 0.0), wall + wall - total * inv_weight, wall)
    store(ghost, i, seen, n)


@jitable
def extrapolate(
    extrapolation, rank, n_threads, end, walls, wall_start, fluid, start, grid, lists, kernel, eos,
    constants, gravity, time,
):  # fmt: skip
    """Pressure, density and, without slip, ghost velocity of boundary particles.

    p = (sum p W + (g - a) . sum rho r W) / sum W, the hydrostatic one; v = 2 v_wall - mean v.
    `end`: of the thread's list. Returns whether what is left of its part was too short.
    Source: Adami, Hu, Adams 2012, eqs. 22 to 28.
    """
    if extrapolation is None:
        return False
    first, last = own_blocks(grid, wall_start, walls.id.size, width(walls.x), rank, n_threads)
    _, room = own_part(lists, rank, n_threads)
    for row in range(count_rows(grid)):
        low, high = row_range(grid, wall_start, row)
        i, high = max(low, first), min(high, last)
        while i < high:
            n = rest_of_block(i - low, width(walls.x), high - i)
            n, stop = list_sources(lists, walls, fluid, start, grid, constants, i, n, end, room)
            if lists is not None and stop > room:
                return True
            begin = end if lists is not None else 0
            x, y, u, v = load(walls.x, i), load(walls.y, i), load(walls.u, i), load(walls.v, i)
            zero = like(x, 0.0)
            ghosts = Ghosts(zero, zero, zero, zero, zero, zero)
            ghosts = gather(fluid, lists, begin, stop, kernel, constants, x, y, ghosts)
            gx, gy = add_gravity(gravity, time, x, y, u, v, zero, zero)
            gx, gy = minus_own(walls.ax, i, gx), minus_own(walls.ay, i, gy)
            wet = ghosts.weight > like(x, extrapolation.least)
            inv_weight = select(wet, reciprocal(select(wet, ghosts.weight, like(x, 1.0))), zero)
            p = (ghosts.p + gx * ghosts.rx + gy * ghosts.ry) * inv_weight
            p = maximum(p, like(p, eos.floor))
            rho = density_at(eos, p)
            store(walls.rho, i, rho, n)
            store(walls.stress, i, p * reciprocal(rho * rho), n)
            mirror(walls.ghost_u, walls.u, i, n, inv_weight, ghosts.u)
            mirror(walls.ghost_v, walls.v, i, n, inv_weight, ghosts.v)
            i += n
    return False
