"""Particles that got into walls, which is a failure of the step."""

from typing import NamedTuple

from sph_gym.solver.jit import jitable
from sph_gym.solver.lanes import first_lanes, first_true, like, load
from sph_gym.solver.neighbors import neighbor, wall_range
from sph_gym.solver.periodic import nearest_image
from sph_gym.solver.thickness import LINK

# Share of rho0 that walls alone contribute to the density of a fluid particle, beyond which it is
# inside a wall. They contribute up to 0.7 in a corner, up to 0.85 in a hole of one particle, and 1
# within.
INSIDE_WALL = 0.9
# Where nothing stands behind the boundary particles, a particle that moves farther than this share
# of h in a step may jump over a wall before it counts as inside. If its path then passes a boundary
# particle closer than this share of dx, it is in the wall: between two of them, dx / 2 is left.
LEAP, REACH = 0.5, 0.75
# A thin wall never contributes so much. A particle that squeezes through one passes its middle,
# where the walls around have their centroid, between two boundary particles. It is within this
# share of dx of both then, or within half of its last step. It is looked for where walls
# contribute more than this share of what the thinnest one does on its middle.
MIDDLE, GATE = 0.25, 0.7


class UnbackedWalls(NamedTuple):
    """Boundary particles with neither box nor plates at their face.

    leap: the path of a particle that moves farther than this [m] in a step is checked; reach: a
    path closer than this [m] to a boundary particle leads into the wall; gate: share of rho0 that
    walls contribute at least where a particle passes them; link: nearer boundary particles are
    neighbours in one wall [m].
    """

    leap: float
    reach: float
    gate: float
    link: float


@jitable
def first_walled(walls, model, cells, i, n, of_walls, dt):
    """Return the first of n lanes from particle i on that is in a wall or passed it, or -1.

    of_walls: the contribution of walls to their densities.
    """
    if walls is None:
        return -1
    share = of_walls * like(of_walls, model.eos.inv_rho0)
    unbacked, fluid = model.unbacked_walls, cells.fluid
    inside = first_true((share > like(share, INSIDE_WALL)) & first_lanes(share, n))
    if inside < 0:
        inside = first_leap(unbacked, walls, fluid, i, n, model.constants, dt)
    if inside < 0:
        inside = first_passing(unbacked, model, cells, i, n, share, dt)
    return inside


@jitable
def first_passing(unbacked, model, cells, i, n, share, dt):
    """Return the first of n lanes that is between the particles of an unbacked wall, or -1."""
    if unbacked is None:
        return -1
    near = share > like(share, unbacked.gate)
    first = first_true(near & first_lanes(share, n))
    if first < 0:
        return -1
    # they are few
    for lane in range(first, n):
        if passes(unbacked, model.constants, cells, i, lane, dt):
            return lane
    return -1


@jitable
def passes(unbacked, constants, cells, i, lane, dt):
    """Return whether a lane of the group of i is on the middle of a wall, between its particles."""
    fluid, walls, lists, link = cells.fluid, cells.walls, cells.lists, float(unbacked.link)
    begin, end = wall_range(lists, i)
    x, y, u, v = fluid.x[i + lane], fluid.y[i + lane], fluid.u[i + lane], fluid.v[i + lane]
    near2 = max((MIDDLE / LINK * link) ** 2, float(dt * dt * (u * u + v * v)) / 4)
    total = sum_x = sum_y = 0.0
    for k in range(begin, end):
        dx, dy = to_wall(constants, walls, neighbor(lists, k), x, y)
        weight = max(float(constants.h) ** 2 - dx * dx - dy * dy, 0.0) ** 2
        total, sum_x, sum_y = total + weight, sum_x + weight * dx, sum_y + weight * dy
    if not sum_x * sum_x + sum_y * sum_y < near2 * total * total:
        return False
    for k in range(begin, end):
        ax, ay = to_wall(constants, walls, neighbor(lists, k), x, y)
        for other in range(begin, k):
            bx, by = to_wall(constants, walls, neighbor(lists, other), x, y)
            tx, ty = bx - ax, by - ay
            length2 = tx * tx + ty * ty
            if length2 < link * link:
                share = min(max(-(ax * tx + ay * ty) / max(length2, 1e-30), 0.0), 1.0)
                gap_x, gap_y = ax + share * tx, ay + share * ty
                if gap_x * gap_x + gap_y * gap_y < near2:
                    return True
    return False


@jitable
def to_wall(constants, walls, j, x, y):
    """Return the way [m] from a point to boundary particle j, or to its nearest image."""
    dx = nearest_image(constants.period_x, float(walls.x[j]) - float(x))
    dy = nearest_image(constants.period_y, float(walls.y[j]) - float(y))
    return dx, dy


@jitable
def first_leap(unbacked, walls, fluid, i, n, constants, dt):
    """Return the first of n lanes that leapt into or over unbacked walls, or -1."""
    if unbacked is None:
        return -1
    u, v = dt * load(fluid.u, i), dt * load(fluid.v, i)
    fast = u * u + v * v > like(u, unbacked.leap * unbacked.leap)
    first = first_true(fast & first_lanes(u, n))
    if first < 0:
        return -1
    # they are so few that each may look at every wall particle
    for lane in range(first, n):
        if leapt(walls, unbacked, fluid, i + lane, constants, dt):
            return lane
    return -1


@jitable
def leapt(walls, unbacked, fluid, i, constants, dt):
    """Return whether the path of fluid particle i in the last step passed a wall particle."""
    u, v = dt * fluid.u[i], dt * fluid.v[i]
    length2 = u * u + v * v
    if not length2 > unbacked.leap * unbacked.leap:
        return False
    for j in range(walls.id.size):
        dx = nearest_image(constants.period_x, fluid.x[i] - walls.x[j])
        dy = nearest_image(constants.period_y, fluid.y[i] - walls.y[j])
        back = min(max((dx * u + dy * v) / length2, 0.0), 1.0)
        dx, dy = dx - back * u, dy - back * v
        if dx * dx + dy * dy < unbacked.reach * unbacked.reach:
            return True
    return False
