"""Measures of a state, and of how a run failed."""

import math
from typing import NamedTuple

import numpy as np

from sph_gym.solver.equation_of_state import internal_energy
from sph_gym.solver.jit import jit, jitable
from sph_gym.solver.lanes import broadcast, lane, like, load, minimum, select, store, width
from sph_gym.solver.neighbors import count, fluid_range, group_size, neighbor, wall_range
from sph_gym.solver.target import MOST_LANES
from sph_gym.solver.walls import nearest_image

# An index that no particle of a group has: a wall particle is never the one that counts.
NOT_ITSELF = -2 * MOST_LANES
# Two particles closer than this share of dx count as clumped.
CLUMPED = 0.6


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
    """Of boundary particles that are like fluid; the others only mirror its pressure."""
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
    """What `sum_up` found, with units."""
    kinetic, internal, com_x, com_y, momentum_x, momentum_y, spin, *others = sums.tolist()
    return Totals(
        mass * kinetic, mass * internal, com_x, com_y, mass * momentum_x, mass * momentum_y,
        mass * spin, *others,
    )  # fmt: skip


@jitable
def _count(x, y, sources, lists, i, first, last, constants, h2, nearest, count):
    """nearest and count, with the listed `sources` around lanes x, y; itself is no other."""
    if sources is None:
        return nearest, count
    zero, one, far = like(count, 0.0), like(count, 1.0), like(nearest, np.inf)
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
def look_around(i, fluid, walls, lists, constants, h2, nearest, number):
    """Fill two columns from fluid particle i on: the squared distance [m^2] to the nearest other
    fluid particle, inf if none is within h, and the number of all other particles within h.
    """
    n_fluid = fluid.id.size
    while i < n_fluid:
        n = group_size(lists, i, min(width(nearest), n_fluid - i))
        x, y = load(fluid.x, i), load(fluid.y, i)
        inf, zero = like(x, np.inf), like(x, 0.0)
        begin, end = fluid_range(lists, i, n_fluid)
        near, others = _count(x, y, fluid, lists, i, begin, end, constants, h2, inf, zero)
        begin, end = wall_range(lists, i, count(walls))
        _, others = _count(x, y, walls, lists, NOT_ITSELF, begin, end, constants, h2, inf, others)
        store(nearest, i, near, n)
        store(number, i, others, n)
        i += n


@jit
def nearest_and_count(i, fluid, walls, lists, constants, h2, nearest, number):
    """`look_around`, called from Python."""
    look_around(i, fluid, walls, lists, constants, h2, nearest, number)


class Survey(NamedTuple):
    """What a look at every particle tells, beyond `Totals`.

    density_p99: 99th percentile of max(rho/rho0 - 1, 0); clumping: share with another one closer
    than 0.6 dx; nearest, median: smallest and median distance to the nearest other [m]; neighbors:
    mean number of them; surface: share below 0.9 rho0; adrift: share whose acceleration is
    gravity's but for a tenth, 0 without gravity; acceleration: largest |a|^2 [m^2/s^4]; lowest:
    smallest y [m]; front: largest x [m]; extent_x, extent_y: standard deviations of x and y [m].
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


@jitable
def survey(
    fluid, walls, lists, constants, h2, ax, ay, gx, gy, com_x, com_y, clumped, inv_rho0, work,
    numbers,
):  # fmt: skip
    """Fill `numbers` with a `Survey`; com: centre of mass [m]; clumped: distance [m];
    work: (2, m) scratch.
    """
    n = fluid.id.size
    nearest, counts = work[0], work[1]
    look_around(0, fluid, walls, lists, constants, h2, nearest, counts)
    pull2 = gx * gx + gy * gy
    near = surface = adrift = 0
    neighbors, fastest, lowest, closest, front = 0.0, 0.0, np.inf, np.inf, -np.inf
    extent_x = extent_y = 0.0
    for i in range(n):
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


@jitable
def quantile(values, n, share):
    """Of the first n values, with linear interpolation as in numpy; leaves them in another order.

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


class Ledger:
    """What energy a run may hold: the start, plus the work of gravity and of the controls.

    The energy that is neither is an error of the time stepping. It counts as a blow-up when it
    exceeds `TOLERANCE` times the energy at stake: what was there at the start, what gravity and
    the controls brought in, and the weight of the fluid times its own size. Friction, clamped
    pressure and clamping walls only take energy away, so there is no bound from below. A kernel
    pair that isn't matched makes energy of its own, at any time step; the tolerance leaves room
    for that as long as it is clamped or damped.

    What bursts may fly apart before it gets there. So it counts as well when more than `HALF` of
    what is at stake is from nowhere, `SUDDEN` of it from the last leg alone, which is at most a
    frame. Measured in the study `stability`: of the runs of its maps, 576 came to more than half,
    all with 0.4 or more at once, and without this rule 9 of them were never reported; the other
    523 meet no part of it. Of its cases at the stable step, one comes to 0.36, and one to more: a
    fluid at rest whose kernels pair, 3e-5 m c0^2 in a frame, against 1e-4 in the least of those
    that fly apart, patches that collide at Mach 0.025; what is slower than `FLOW` is no burst. Nor
    is it judged where walls move, whose work isn't booked.
    """

    TOLERANCE, HALF, SUDDEN = 2.0, 0.5, 0.25
    # Of c0: slower than all the fluid moving at this speed, no energy is a burst; and rest.
    FLOW, REST = 0.012, 1e-4

    def __init__(
        self, totals: Totals, weight_scale: float, floor: float, driven: bool = False
    ) -> None:
        self.expected = totals.kinetic + totals.internal
        self.at_stake = self.expected + weight_scale + floor
        quiet = 0.5 * (self.FLOW / self.REST) ** 2 * floor
        self._least_burst = math.inf if driven else quiet
        self.gravity_work = self.deepest = self.control_work = 0.0

    def add_gravity(self, work: float) -> None:
        """Book the work [J/m] that gravity did."""
        self.gravity_work += work
        self.deepest = max(self.deepest, abs(self.gravity_work))

    def add_control(self, work: float) -> None:
        """Book the energy [J/m] that a change of stiffness put into the compressed fluid."""
        self.expected += work
        self.control_work += work
        self.at_stake += abs(work)

    @property
    def stake(self) -> float:
        """The energy at stake so far [J/m]."""
        return self.at_stake + self.deepest

    def surplus(self, totals: Totals) -> float:
        """Energy that came from nowhere [J/m]; less than 0 where friction took more."""
        held = totals.kinetic + totals.internal
        return held - self.expected - self.gravity_work

    def excess(self, totals: Totals) -> float:
        """The same as a share of the energy at stake."""
        return float(self.surplus(totals) / self.stake)

    def blown(self, totals: Totals, before: float) -> bool:
        """Whether there is more energy from nowhere than can be; before: [J/m] a leg ago."""
        surplus, stake = self.surplus(totals), self.stake
        excess = surplus / stake
        least_burst = max(self.SUDDEN * stake, self._least_burst)
        burst = excess > self.HALF and surplus - before > least_burst
        return burst or not (math.isfinite(excess) and excess <= self.TOLERANCE)

    def state(self) -> list[float]:
        """The numbers of the ledger, for a snapshot."""
        return [self.expected, self.at_stake, self.gravity_work, self.deepest, self.control_work]

    def set_state(self, numbers: list[float]) -> None:
        """Take back what `state` gave."""
        self.expected, self.at_stake, self.gravity_work, self.deepest, self.control_work = numbers
