"""The article's solver in plain numpy, as one would write it down: the example of the protocol.

    solver = make(case)         # see `Case` for what a case holds
    solver.step(case.dt)        # solver.x, solver.v, solver.rho, ... in the order of case.x

The chain, a method a link: neighbours -> density -> pressure -> force -> step. Every sum over
neighbours runs over a list of pairs (i, j), in which each two neighbours are twice: as (i, j) and
as (j, i). So `total(values)` sums over the neighbours j of every particle i.
"""

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor.case import Array, Case

Indices = NDArray[np.int64]
# Pairs nearer than this share of h have no direction.
TOUCHING = 1e-6
# What is left of the normal speed after a bounce off a wall.
RESTITUTION = 0.0
# Between the columns of the grid: more than there are cells in one.
COLUMN = 2**32


class Plain:
    """Weakly compressible SPH in two dimensions, with Mueller's kernels.

    Shows all that the protocol knows: x, v (n, 2), rho, p (n,) and a (n, 2) of the last evaluation,
    evaluate(), neighbors(i), c0 and stiffness.
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self.x, self.v = case.x.copy(), case.v.copy()
        self.n, self.h, self.c0 = len(case.x), case.h, case.c0
        self.stiffness = self.tait_stiffness()
        self.mass = self.calibrated_mass()
        self.evaluate()

    # Kernels of two dimensions; h is where they end.

    def weight(self, r: Array) -> Array:
        """Return poly6, W(r) [1/m^2], for densities."""
        return 4 / (np.pi * self.h**8) * np.maximum(self.h**2 - r**2, 0) ** 3

    def slope(self, r: Array) -> Array:
        """Return the derivative dW/dr [1/m^3] of the spiky kernel, for pressure."""
        return -30 / (np.pi * self.h**5) * np.maximum(self.h - r, 0) ** 2

    def laplacian(self, r: Array) -> Array:
        """Return the Laplacian [1/m^4] of Mueller's third kernel, for viscosity."""
        return 40 / (np.pi * self.h**5) * np.maximum(self.h - r, 0)

    def calibrated_mass(self) -> float:
        """Return the mass [kg/m] with which a square lattice of spacing dx has the density rho0."""
        reach = np.arange(-np.ceil(self.h / self.case.dx), np.ceil(self.h / self.case.dx) + 1)
        distances = self.case.dx * np.hypot(*np.meshgrid(reach, reach))
        return float(self.case.rho0 / self.weight(distances).sum())

    def tait_stiffness(self) -> float:
        """Return Tait's B [Pa], with which sound in fluid at rest has the speed c0."""
        return self.case.rho0 * self.case.c0**2 / self.case.gamma

    # The chain.

    def evaluate(self) -> None:
        """Compute neighbours, densities, pressures and accelerations at the present positions."""
        self.find_neighbors()
        self.rho = self.density()
        self.p = self.pressure()
        self.a = self.force() + self.viscosity() + self.gravity()

    def find_neighbors(self) -> None:
        """List all pairs nearer than h, by a grid of cells whose side is h."""
        i, j = self.candidates(self.cells())
        d = self.x[i] - self.x[j]
        r = np.sqrt((d**2).sum(axis=1))
        near = (r < self.h) & (i != j)
        self.i, self.j, self.r = i[near], j[near], r[near]
        self.direction = self.directions(d[near], r[near])

    def cells(self) -> Indices:
        """Return column and row (n, 2) of every particle's cell; both may be negative."""
        return np.floor(self.x / self.h).astype(np.int64)

    def candidates(self, cells: Indices) -> tuple[Indices, Indices]:
        """Return all pairs (i, j) in which j is in the cell of i or in one of the eight around it.

        Particles sorted by cell lie one behind the other, and three cells of a column are one run.
        """
        key = cells[:, 0] * COLUMN + cells[:, 1]
        order = np.argsort(key, kind="stable")
        pairs = []
        for column in (-COLUMN, 0, COLUMN):
            first = np.searchsorted(key[order], key + column - 1, side="left")
            last = np.searchsorted(key[order], key + column + 1, side="right")
            count = last - first
            start = np.repeat(first - np.cumsum(count) + count, count)
            j = order[start + np.arange(count.sum())]
            pairs.append((np.repeat(np.arange(self.n), count), j))
        return np.concatenate([i for i, _ in pairs]), np.concatenate([j for _, j in pairs])

    def directions(self, d: Array, r: Array) -> Array:
        """Return unit vectors from j to i (n pairs, 2); zero where the two are at one place."""
        touching = r < TOUCHING * self.h
        return np.where(touching[:, None], 0.0, d / np.where(touching, 1.0, r)[:, None])

    def density(self) -> Array:
        """Return rho (n,) [kg/m^3], with each particle's own share: it is never zero."""
        return self.mass * (self.weight(np.zeros(self.n)) + self.total(self.weight(self.r)))

    def pressure(self) -> Array:
        """Return p (n,) [Pa] by Tait's equation, without suction."""
        ratio = self.rho / self.case.rho0
        return np.maximum(self.stiffness * (ratio**self.case.gamma - 1), 0.0)

    def force(self) -> Array:
        """Return the acceleration by pressure (n, 2) [m/s^2]; what i does to j, j does to i."""
        share = self.p / self.rho**2
        push = -self.mass * (share[self.i] + share[self.j]) * self.slope(self.r)
        return self.total_vector(push[:, None] * self.direction)

    def viscosity(self) -> Array:
        """Return the acceleration by viscosity (n, 2) [m/s^2], that of a kinematic nu [m^2/s]."""
        drag = self.case.viscosity * self.case.rho0 * self.mass * self.laplacian(self.r)
        drag /= self.rho[self.i] * self.rho[self.j]
        return self.total_vector(drag[:, None] * (self.v[self.j] - self.v[self.i]))

    def gravity(self) -> Array:
        """Return the acceleration by gravity (2,) [m/s^2]."""
        return self.case.gravity

    def xsph(self) -> Array:
        """Return what XSPH adds to the velocities (n, 2) [m/s] when particles are moved."""
        mean = (self.rho[self.i] + self.rho[self.j]) / 2
        share = self.case.xsph * self.mass * self.weight(self.r) / mean
        return self.total_vector(share[:, None] * (self.v[self.j] - self.v[self.i]))

    # Time.

    def step(self, dt: float) -> None:
        """Do a time step of dt seconds by symplectic Euler: new velocities move the particles."""
        self.evaluate()
        self.advance(dt)
        self.bounce()

    def advance(self, dt: float) -> None:
        """Change velocities by the accelerations, and positions by the smoothed velocities."""
        self.v = self.v + dt * self.a
        self.x = self.x + dt * (self.v + self.xsph())

    def bounce(self) -> None:
        """Put particles that have passed a wall back onto it, and reflect their velocities."""
        for axis, side, outward in self.sides():
            outside = outward * (self.x[:, axis] - side) > 0
            leaving = outside & (outward * self.v[:, axis] > 0)
            self.x[outside, axis] = side
            self.v[leaving, axis] *= -RESTITUTION

    def sides(self) -> list[tuple[int, float, int]]:
        """Return the walls: axis, coordinate [m], and -1 or 1 for where outside is."""
        if self.case.box is None:
            return []
        x_min, x_max, y_min, y_max = self.case.box
        return [(0, x_min, -1), (0, x_max, 1), (1, y_min, -1), (1, y_max, 1)]

    # Sums.

    def total(self, values: Array) -> Array:
        """Return the sums (n,) over the neighbours of each particle; values: one a pair."""
        return np.asarray(np.bincount(self.i, values, self.n), dtype=np.float64)

    def total_vector(self, values: Array) -> Array:
        """Return the sums (n, 2) over the neighbours of each particle; values: (pairs, 2)."""
        return np.stack([self.total(values[:, 0]), self.total(values[:, 1])], axis=1)

    def neighbors(self, i: int) -> Indices:
        """Return the indices of the particles nearer to particle i than h."""
        return self.j[self.i == i]


def make(case: Case) -> Plain:
    """Return a solver for the case."""
    return Plain(case)
