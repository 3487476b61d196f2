"""Measures of a state, and of how a run failed."""

from typing import NamedTuple

import numpy as np

from sph_gym.solver.equation_of_state import internal_energy
from sph_gym.solver.jit import jit
from sph_gym.solver.neighbors import rows, span

# Two particles closer than this share of dx count as clumped.
CLUMPED = 0.6


class Totals(NamedTuple):
    """Sums over the fluid: kinetic and internal energy [J/m], centre of mass [m], momentum
    [kg/s], angular momentum about the origin [kg m/s], largest speed [m/s], mean of
    max(rho/rho0 - 1, 0). The internal energy counts the wall particles too, since they take
    part in the pressure like fluid.
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


@jit
def _elastic(densities, stiffness, rho0, gamma, clamp):
    total = 0.0
    if densities is None:
        return total
    for rho in densities:
        total += internal_energy(stiffness, rho0, gamma, clamp, rho)
    return total


@jit
def _totals(fluid, wall_rho, mass, stiffness, rho0, gamma, clamp):
    n = fluid.x.size
    kinetic = com_x = com_y = momentum_x = momentum_y = angular = fastest = compression = 0.0
    for i in range(n):
        x, y = np.float64(fluid.x[i]), np.float64(fluid.y[i])
        u, v = np.float64(fluid.u[i]), np.float64(fluid.v[i])
        speed2 = u * u + v * v
        kinetic += speed2
        com_x += x
        com_y += y
        momentum_x += u
        momentum_y += v
        angular += x * v - y * u
        fastest = max(fastest, speed2)
        compression += max(fluid.rho[i] / rho0 - 1.0, 0.0)
    internal = _elastic(fluid.rho, stiffness, rho0, gamma, clamp)
    internal += _elastic(wall_rho, stiffness, rho0, gamma, clamp)
    return (
        0.5 * mass * kinetic,
        mass * internal,
        com_x / n,
        com_y / n,
        mass * momentum_x,
        mass * momentum_y,
        mass * angular,
        np.sqrt(fastest),
        compression / n,
    )


def totals(fluid, walls, mass, stiffness, rho0, gamma, clamp) -> Totals:
    """The sums for a state with fresh densities."""
    wall_rho = None if walls is None else walls.rho
    sums = _totals(fluid, wall_rho, mass, stiffness, rho0, gamma, clamp)
    return Totals(*map(float, sums))


@jit
def _add_count(sources, start, grid, x, y, h2, count):
    if sources is None:
        return count
    first_row, last_row = rows(grid, y)
    for row in range(first_row, last_row):
        low, high = span(grid, start, row, x)
        for j in range(low, high):
            dx, dy = x - sources.x[j], y - sources.y[j]
            count += 1 if dx * dx + dy * dy < h2 else 0
    return count


@jit
def nearest_and_count(fluid, start, walls, wall_start, grid, h2):
    """Squared distance [m^2] to the nearest other fluid particle, inf if none is within h, and
    the number of all other particles within h.
    """
    nearest = np.full(fluid.x.size, np.inf)
    count = np.zeros(fluid.x.size, np.int32)
    for i in range(fluid.x.size):
        x, y = fluid.x[i], fluid.y[i]
        first_row, last_row = rows(grid, y)
        for row in range(first_row, last_row):
            low, high = span(grid, start, row, x)
            for j in range(low, high):
                dx, dy = x - fluid.x[j], y - fluid.y[j]
                r2 = dx * dx + dy * dy
                if r2 < h2 and j != i:
                    nearest[i] = min(nearest[i], r2)
        count[i] = _add_count(fluid, start, grid, x, y, h2, -1)
        count[i] = _add_count(walls, wall_start, grid, x, y, h2, count[i])
    return nearest, count


class Ledger:
    """What energy a run may hold: the start, plus the work of gravity and of the controls.

    The energy that is neither is an error of the time stepping. It counts as a blow-up when it
    exceeds `TOLERANCE` times the energy at stake: what was there at the start, what gravity and
    the controls brought in, and the weight of the fluid times its own size. Friction, clamped
    pressure and clamping walls only take energy away, so there is no bound from below. A kernel
    pair that isn't matched makes energy of its own, at any time step; the tolerance leaves room
    for that as long as it is clamped or damped.
    """

    TOLERANCE = 2.0

    def __init__(self, totals: Totals, weight_scale: float, floor: float) -> None:
        self.expected = totals.kinetic + totals.internal
        self.at_stake = self.expected + weight_scale + floor
        self.gravity_work = 0.0
        self.deepest = 0.0

    def add_gravity(self, work: float) -> None:
        """Book the work [J/m] that gravity did."""
        self.gravity_work += work
        self.deepest = max(self.deepest, abs(self.gravity_work))

    def add_control(self, work: float) -> None:
        """Book the energy [J/m] that a change of stiffness put into the compressed fluid."""
        self.expected += work
        self.at_stake += abs(work)

    def excess(self, totals: Totals) -> float:
        """Energy that came from nowhere, as a share of the energy at stake."""
        held = totals.kinetic + totals.internal
        surplus = held - self.expected - self.gravity_work
        return float(surplus / (self.at_stake + self.deepest))

    def state(self) -> list[float]:
        """The four numbers of the ledger, for a snapshot."""
        return [self.expected, self.at_stake, self.gravity_work, self.deepest]

    def set_state(self, numbers: list[float]) -> None:
        """Take back what `state` gave."""
        self.expected, self.at_stake, self.gravity_work, self.deepest = numbers
