"""Boundary particles: their densities and pressures, their motion, and what got past them.

They either sum a density like fluid does, or take the pressure of the fluid around them.
"""

import math
from typing import Any, NamedTuple

from sph_gym.solver.confinement import stroke_at
from sph_gym.solver.density import COINCIDENT, add_image_weights, add_weights, store_density
from sph_gym.solver.equation_of_state import density_at
from sph_gym.solver.gravity import add_gravity
from sph_gym.solver.jit import dispatch, jit, jitable
from sph_gym.solver.kernels import friction, weight
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
    collect_images,
    compact_group,
    neighbor,
    own_blocks,
    own_part,
    rest_of_block,
    row_range,
)
from sph_gym.solver.periodic import nearest_image, wrap_far

# --- Motion ---------------------------------------------------------------------------------


@jitable
def move_walls(stroke, source, constants, time):
    """Move boundary particles to where they are at a time [s]. Return whether any move."""
    if stroke is None:
        return False
    _displace(source.particles, source.rest, source.moves, constants, stroke, time)
    return True


@jitable
def _displace(source, rest, moves, constants, stroke, time):
    if source is None:
        return
    x, y, u, v = stroke_at(stroke, time)
    square = stroke.omega * stroke.omega * math.sin(stroke.omega * time)
    for i in range(source.id.size):
        share = moves[i]
        source.x[i] = wrap_far(constants.period_x, rest.x[i] + share * x)
        source.y[i] = wrap_far(constants.period_y, rest.y[i] + share * y)
        source.u[i], source.v[i] = rest.u[i] + share * u, rest.v[i] + share * v
        source.ax[i], source.ay[i] = -share * stroke.ax * square, -share * stroke.ay * square


# --- Densities and pressures ----------------------------------------------------------------


class LikeFluid(NamedTuple):
    """Task: a density and pressure as fluid has them."""


class OwnSums(NamedTuple):
    """Task: kernel sums of boundary particles over each other, where they move."""


class Extrapolation(NamedTuple):
    """Task: pressure, density and, without slip, ghost velocity from the fluid around.

    least: sum of W shapes below which a boundary particle counts as dry.
    """

    least: float


class Ghosts(NamedTuple):
    """Sums that a boundary particle gathers from the fluid around it.

    weight: of W shapes; p: of p, rx, ry: of rho times the offset from the fluid, weighted with
    them; friction: of the weights of laminar viscosity; u, v: of the velocity, weighted with those.
    """

    weight: Any
    p: Any
    rx: Any
    ry: Any
    friction: Any
    u: Any
    v: Any


@dispatch
def visit(
    task: Any, i: int, n: int, begin: int, end: int, cells: Any, model: Any, time: Any
) -> Any:
    """Do a task for the n boundary particles from i on, with the listed neighbours."""


@jitable
def visit_groups(task, part, sources, start, cells, model, grid, time):
    """Do a task for a part of the boundary particles, group by group.

    part: first and last-plus-one particle, begin and end of the list that is used meanwhile;
    sources, start: the particles among which neighbours are searched. Return whether the list
    was too short.
    """
    walls, lists, constants = cells.walls, cells.lists, model.constants
    first, last, begin, list_end = part
    for row in range(grid.n_rows):
        low, high = row_range(grid, cells.wall_start, row)
        i, high = max(low, first), min(high, last)
        while i < high:
            n = rest_of_block(i - low, width(walls.x), high - i)
            n, box = compact_group(walls, i, n, constants.widest)
            end = collect_images(constants, box, grid, start, sources, lists, begin, list_end)
            if end > list_end:
                return True
            visit(task, i, n, begin, end, cells, model, time)
            i += n
    return False


@jitable
def compute_wall_density(walls, rank, n_threads, cells, model, grid):
    """Compute densities of boundary particles like fluid. Return whether the list was too short."""
    if walls is None:
        return False
    first, last = own_blocks(grid, cells.wall_start, walls.id.size, width(walls.x), rank, n_threads)
    begin, list_end = own_part(cells.lists, rank, n_threads)
    part = first, last, begin, list_end
    return visit_groups(LikeFluid(), part, cells.fluid, cells.start, cells, model, grid, 0.0)


@jitable
def compute_wall_sums(walls, n_threads, cells, model, grid):
    """Compute kernel sums of boundary particles over each other, in thread 0.

    Return whether the list was too short.
    """
    if walls is None:
        return False
    begin, list_end = own_part(cells.lists, 0, n_threads)
    part = 0, walls.id.size, begin, list_end
    return visit_groups(OwnSums(), part, walls, cells.wall_start, cells, model, grid, 0.0)


@jitable
def extrapolate(extrapolation, rank, n_threads, begin, cells, model, grid, time):
    """Give boundary particles the pressure of the fluid. Return whether the list was too short.

    p = (sum p W + (g - a) . sum rho r W) / sum W, the hydrostatic one; v = 2 v_wall - mean v.
    begin: end of the thread's list of the fluid. Source: Adami, Hu, Adams 2012, eqs. 22 to 28.
    """
    walls = cells.walls
    first, last = own_blocks(grid, cells.wall_start, walls.id.size, width(walls.x), rank, n_threads)
    _, list_end = own_part(cells.lists, rank, n_threads)
    part = first, last, begin, list_end
    return visit_groups(extrapolation, part, cells.fluid, cells.start, cells, model, grid, time)


@visit.member(LikeFluid)
def _like_fluid(task, i, n, begin, end, cells, model, time):
    walls, kernel, constants = cells.walls, model.kernel, model.constants
    x, y, total = load(walls.x, i), load(walls.y, i), load(cells.wall_sums, i)
    total = add_weights(None, cells.fluid, cells.lists, begin, end, kernel, constants, x, y, total)
    total = add_image_weights(
        model.mirrors, None, cells.fluid, cells.lists, (begin, end), model, x, y, total
    )
    store_density(walls, i, n, constants.density_scale * total, model.eos)


@visit.member(OwnSums)
def _own_sums(task, i, n, begin, end, cells, model, time):
    walls, kernel, constants = cells.walls, model.kernel, model.constants
    x, y = load(walls.x, i), load(walls.y, i)
    total = add_weights(None, walls, cells.lists, begin, end, kernel, constants, x, y, like(x, 0.0))
    total = add_image_weights(
        model.mirrors, None, walls, cells.lists, (begin, end), model, x, y, total
    )
    store(cells.wall_sums, i, total, n)


@visit.member(Extrapolation)
def _extrapolated(task, i, n, begin, end, cells, model, time):
    walls, eos = cells.walls, model.eos
    x, y, u, v = load(walls.x, i), load(walls.y, i), load(walls.u, i), load(walls.v, i)
    zero = like(x, 0.0)
    ghosts = Ghosts(zero, zero, zero, zero, zero, zero, zero)
    ghosts = gather(cells.fluid, cells.lists, begin, end, model, x, y, ghosts)
    gx, gy = add_gravity(model.gravity, time, x, y, u, v, zero, zero)
    gx, gy = minus_own(walls.ax, i, gx), minus_own(walls.ay, i, gy)
    wet = ghosts.weight > like(x, task.least)
    inv_weight = select(wet, reciprocal(select(wet, ghosts.weight, like(x, 1.0))), zero)
    p = (ghosts.p + gx * ghosts.rx + gy * ghosts.ry) * inv_weight
    p = maximum(p, like(p, eos.floor))
    rho = density_at(eos, p)
    store(walls.rho, i, rho, n)
    store(walls.stress, i, p * reciprocal(rho * rho), n)
    inv_friction = select(wet, reciprocal(select(wet, ghosts.friction, like(x, 1.0))), zero)
    mirror(walls.ghost_u, walls.u, i, n, inv_friction, ghosts.u)
    mirror(walls.ghost_v, walls.v, i, n, inv_friction, ghosts.v)


@jitable
def gather(fluid, lists, first, last, model, x, y, ghosts):
    """Return ghosts plus the listed fluid's contribution to boundary particles at (x, y)."""
    kernel, constants = model.kernel, model.constants
    for k in range(first, last):
        j = neighbor(lists, k)
        dx = nearest_image(constants.period_x, x - broadcast(fluid.x, j))
        dy = nearest_image(constants.period_y, y - broadcast(fluid.y, j))
        r2 = dx * dx + dy * dy
        r = r2 * rsqrt(r2 + like(r2, COINCIDENT))
        near = r2 < kernel.h2
        w = select(near, weight(kernel, r2, r), like(r2, 0.0))
        rho = broadcast(fluid.rho, j)
        mass, rub = w * rho, friction(kernel.h, r)
        ghosts = Ghosts(
            ghosts.weight + w,
            ghosts.p + mass * (rho * broadcast(fluid.stress, j)),
            ghosts.rx + mass * dx,
            ghosts.ry + mass * dy,
            ghosts.friction + rub,
            ghosts.u + rub * broadcast(fluid.u, j),
            ghosts.v + rub * broadcast(fluid.v, j),
        )
    return ghosts


@jitable
def minus_own(own, i, a):
    """The acceleration a, less that of the wall itself if it moves."""
    if own is None:
        return a
    return a - load(own, i)


@jitable
def mirror(ghost, own, i, n, inv_friction, total):
    """Store the velocity that makes the fluid's mean that of the wall, at a wall without slip.

    The mean has the weights of laminar viscosity: with others, the wall seems to be elsewhere.
    """
    if ghost is None:
        return
    wall = load(own, i)
    seen = select(inv_friction > like(wall, 0.0), wall + wall - total * inv_friction, wall)
    store(ghost, i, seen, n)


@jit
def sum_walls(walls, everyone, sums, model):
    """Fill `sums` with kernel sums of boundary particles over each other, all with all.

    everyone: lists whose entries are all boundary particles.
    """
    i, n_walls, kernel, constants = 0, walls.id.size, model.kernel, model.constants
    while i < n_walls:
        x, y = load(walls.x, i), load(walls.y, i)
        total = like(x, 0.0)
        total = add_weights(None, walls, everyone, 0, n_walls, kernel, constants, x, y, total)
        total = add_image_weights(
            model.mirrors, None, walls, everyone, (0, n_walls), model, x, y, total
        )
        n = min(width(sums), n_walls - i)
        store(sums, i, total, n)
        i += n
