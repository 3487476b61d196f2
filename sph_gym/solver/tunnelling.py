"""Particles that got into walls, which is a failure of the step."""

from typing import NamedTuple

from sph_gym.solver.jit import jitable
from sph_gym.solver.lanes import first_lanes, first_true, like, load
from sph_gym.solver.periodic import nearest_image

# Share of rho0 that walls alone contribute to the density of a fluid particle, beyond which it is
# inside a wall. They contribute up to 0.7 in a corner, up to 0.85 in a hole of one particle, and 1
# within.
INSIDE_WALL = 0.9
# Where nothing stands behind the boundary particles, a particle that moves farther than this share
# of h in a step may jump over a wall before it counts as inside. If its path then passes a boundary
# particle closer than this share of dx, it is in the wall: between two of them, dx / 2 is left.
LEAP, REACH = 0.5, 0.75


class UnbackedWalls(NamedTuple):
    """Boundary particles with neither box nor plates at their face.

    leap: the path of a particle that moves farther than this [m] in a step is checked; reach: a
    path closer than this [m] to a boundary particle leads into the wall.
    """

    leap: float
    reach: float


@jitable
def first_walled(walls, model, fluid, i, n, of_walls, dt):
    """Return the first of n lanes from particle i on that is inside a wall or leapt it, or -1.

    of_walls: the contribution of walls to their densities.
    """
    if walls is None:
        return -1
    share = of_walls * like(of_walls, model.eos.inv_rho0)
    inside = first_true((share > like(share, INSIDE_WALL)) & first_lanes(share, n))
    if inside < 0:
        inside = first_leap(model.unbacked_walls, walls, fluid, i, n, model.constants, dt)
    return inside


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
