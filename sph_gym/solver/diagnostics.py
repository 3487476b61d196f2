"""Measures of a state: totals, and a look at every particle."""

import math
from typing import NamedTuple

import numpy as np

from sph_gym.solver.equation_of_state import internal_energy
from sph_gym.solver.jit import jitable
from sph_gym.solver.lanes import broadcast, lane, like, load, minimum, select, store
from sph_gym.solver.neighbors import fluid_range, group_size, neighbor, wall_range
from sph_gym.solver.noise import split_velocities
from sph_gym.solver.periodic import nearest_image
from sph_gym.solver.target import MOST_LANES

# The parts of a survey: accelerations alone, the nearest and the number of neighbours, everything.
FORCES, NEIGHBORS, ALL = 0, 1, 2
# An index that no particle of a group has: a wall particle is never the one that counts.
NO_PARTICLE = -2 * MOST_LANES
# Two particles closer than this share of dx count as clumped.
CLUMPED = 0.6
# The flow speed is this quantile of all particles': the rest may be spray.
SPEEDY = 0.99


class Totals(NamedTuple):
    """Sums over the fluid: kinetic and internal energy [J/m], centre of mass [m], momentum
    [kg/s], angular momentum about the origin [kg m/s], largest speed [m/s], mean of
    max(rho/rho0 - 1, 0). The internal energy counts wall particles that take part in the
    pressure like fluid.
    """

    kinetic: float
    internal: float
    com_x: float
    com_y: float
    momentum_x: float
    momentum_y: float
    angular_momentum: float
    max_speed: float
    compression: float


@jitable
def _elastic(particles, eos):
    total = 0.0
    if particles is None:
        return total
    for i in range(particles.id.size):
        total += internal_energy(eos, float(particles.rho[i]))
    return total


@jitable
def _elastic_walls(extrapolation, walls, eos):
    # only those that are like fluid store energy; the others mirror its pressure
    if extrapolation is None:
        return _elastic(walls, eos)
    return 0.0


@jitable
def sum_up(fluid, walls, extrapolation, eos, sums):
    """Fill `sums` for a state with fresh densities: `Totals` per unit of particle mass."""
    n = fluid.id.size
    kinetic = com_x = com_y = momentum_x = momentum_y = angular = fastest = compression = 0.0
    for i in range(n):
        x, y = float(fluid.x[i]), float(fluid.y[i])
        u, v = float(fluid.u[i]), float(fluid.v[i])
        speed2 = u * u + v * v
        kinetic += speed2
        com_x += x
        com_y += y
        momentum_x += u
        momentum_y += v
        angular += x * v - y * u
        fastest = max(fastest, speed2)
        compression += max(float(fluid.rho[i]) * eos.inv_rho0 - 1.0, 0.0)
    sums[0] = 0.5 * kinetic
    sums[1] = _elastic(fluid, eos) + _elastic_walls(extrapolation, walls, eos)
    sums[2], sums[3] = com_x / n, com_y / n
    sums[4], sums[5], sums[6] = momentum_x, momentum_y, angular
    sums[7], sums[8] = math.sqrt(fastest), compression / n


def totals(sums, mass) -> Totals:
    """Return the totals that `sum_up` found, with units."""
    kinetic, internal, com_x, com_y, momentum_x, momentum_y, spin, *others = sums.tolist()
    return Totals(
        mass * kinetic, mass * internal, com_x, com_y, mass * momentum_x, mass * momentum_y,
        mass * spin, *others,
    )  # fmt: skip


# --- A look at every particle ---------------------------------------------------------------


class Request(NamedTuple):
    """The wishes of a caller of `survey`, as floats.

    wanted: FORCES, NEIGHBORS or ALL; time [s]; gx, gy: gravity [m/s^2]; com_x, com_y:
    centre of mass [m]; clumped: distance below which two particles count as clumped [m].
    """

    wanted: float
    time: float
    gx: float = 0.0
    gy: float = 0.0
    com_x: float = 0.0
    com_y: float = 0.0
    clumped: float = 0.0


class Survey(NamedTuple):
    """Measures that take a look at every particle, beyond `Totals`.

    density_p99: 99th percentile of max(rho/rho0 - 1, 0); clumping: share with another one closer
    than 0.6 dx; nearest, median: smallest and median distance to the nearest other [m]; neighbors:
    mean number of them; surface: share below 0.9 rho0; adrift: share whose acceleration is
    gravity's but for a tenth, 0 without gravity; acceleration: largest |a|^2 [m^2/s^4]; lowest:
    smallest y [m]; front: largest x [m]; extent_x, extent_y: standard deviations of x and y [m];
    noise: mean squared velocity noise [m^2/s^2]; flow: SPEEDY quantile of the squared flow
    velocity [m^2/s^2] (see noise.py).
    """

    density_p99: float
    clumping: float
    nearest: float
    median: float
    neighbors: float
    surface: float
    adrift: float
    acceleration: float
    lowest: float
    front: float
    extent_x: float
    extent_y: float
    noise: float
    flow: float


@jitable
def survey(cells, model, request, columns, numbers):
    """Fill `columns` from row 2 on, and `numbers` with a `Survey`, as far as is wanted.

    request: a `Request` as an array; columns: (6, n) ax, ay [m/s^2], squared distance to the
    nearest other fluid particle [m^2] (inf if none is within h), number of all others within h,
    squared velocity noise and flow velocity [m^2/s^2]; a `Survey` reorders all but the first two.
    """
    if request[0] >= NEIGHBORS:
        look_around(cells, model, columns[2], columns[3])
    if request[0] >= ALL:
        split_velocities(cells, model, columns[4], columns[5])
        _sum_survey(cells.fluid, float(model.eos.inv_rho0), request, columns, numbers)


@jitable
def _sum_survey(fluid, inv_rho0, request, columns, numbers):
    # in one function, so that one rounding of 1 / n serves all means
    n = fluid.id.size
    ax, ay, nearest, counts = columns[0], columns[1], columns[2], columns[3]
    gx, gy, com_x, com_y, clumped = request[2], request[3], request[4], request[5], request[6]
    pull2 = gx * gx + gy * gy
    near = surface = adrift = 0
    neighbors, fastest, lowest, closest, front = 0.0, 0.0, np.inf, np.inf, -np.inf
    extent_x = extent_y = noise = 0.0
    for i in range(n):
        noise += float(columns[4, i])
        distance = math.sqrt(float(nearest[i]))
        closest = min(closest, distance)
        near += 1 if distance < clumped else 0
        nearest[i] = distance
        neighbors += float(counts[i])
        x, y = float(ax[i]), float(ay[i])
        fastest = max(fastest, x * x + y * y)
        adrift += 1 if (x - gx) ** 2 + (y - gy) ** 2 < 0.01 * pull2 else 0
        ratio = float(fluid.rho[i]) * inv_rho0
        surface += 1 if ratio < 0.9 else 0
        x, y = float(fluid.x[i]), float(fluid.y[i])
        lowest, front = min(lowest, y), max(front, x)
        extent_x += (x - com_x) ** 2
        extent_y += (y - com_y) ** 2
        counts[i] = max(ratio - 1.0, 0.0)
    numbers[0], numbers[1] = quantile(counts, n, 0.99), near / n
    numbers[2], numbers[3] = closest, quantile(nearest, n, 0.5)
    numbers[4], numbers[5], numbers[6] = neighbors / n, surface / n, adrift / n
    numbers[7], numbers[8], numbers[9] = fastest, lowest, front
    numbers[10], numbers[11] = math.sqrt(extent_x / n), math.sqrt(extent_y / n)
    numbers[12], numbers[13] = noise / n, quantile(columns[5], n, SPEEDY)


@jitable
def look_around(cells, model, nearest, number):
    """Fill two columns: the squared distance [m^2] to the nearest other fluid particle, and the
    number of all other particles within h.
    """
    fluid, lists = cells.fluid, cells.lists
    i, n_fluid = 0, fluid.id.size
    while i < n_fluid:
        n = group_size(lists, i)
        x, y = load(fluid.x, i), load(fluid.y, i)
        inf, zero = like(x, np.inf), like(x, 0.0)
        begin, end = fluid_range(lists, i)
        near, others = _count(x, y, fluid, lists, begin, end, i, model, inf, zero)
        begin, end = wall_range(lists, i)
        _, others = _count(x, y, cells.walls, lists, begin, end, NO_PARTICLE, model, inf, others)
        store(nearest, i, near, n)
        store(number, i, others, n)
        i += n


@jitable
def _count(x, y, sources, lists, first, last, i, model, nearest, count):
    """Return nearest and count with the listed `sources`; i: of lane 0, which is no other."""
    if sources is None:
        return nearest, count
    zero, one, far = like(count, 0.0), like(count, 1.0), like(nearest, np.inf)
    constants, h2 = model.constants, model.kernel.h2
    for k in range(first, last):
        j = neighbor(lists, k)
        dx = nearest_image(constants.period_x, x - broadcast(sources.x, j))
        dy = nearest_image(constants.period_y, y - broadcast(sources.y, j))
        r2 = dx * dx + dy * dy
        other = select(lane(r2, j - i), far, r2)
        near = other < h2
        nearest = minimum(nearest, select(near, other, far))
        count += select(near, one, zero)
    return nearest, count


@jitable
def quantile(values, n, share):
    """Return a quantile of the first n values, interpolated as in numpy; reorders them.

    Source: Hoare 1961, algorithm 65 (find).
    """
    place = share * (n - 1)
    k = int(place)
    low, high = 0, n - 1
    while low < high:
        pivot, i, j = values[k], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if j < k:
            low = i
        if k < i:
            high = j
    below = float(values[k])
    if k + 1 >= n or place == k:
        return below
    above = float(values[k + 1])
    for i in range(k + 2, n):
        above = min(above, float(values[i]))
    # two infinities have no difference
    return below if above == below else below + (place - k) * (above - below)
