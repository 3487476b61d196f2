"""Faults of the link "neighbours": pairs that are missing, doubled or out of date."""

import numpy as np

from sph_gym.doctor.faults.registry import fault, replaces
from sph_gym.doctor.plain import Indices, Plain

IndexPairs = tuple[Indices, Indices]


@replaces("candidates", "neighbours", 2)
def negative_cells(solver: Plain, cells: Indices) -> IndexPairs:
    """The grid begins at 0: particles at negative coordinates are in no cell."""
    i, j = Plain.candidates(solver, cells)
    inside = cells.min(axis=1) >= 0
    return i[inside[i] & inside[j]], j[inside[i] & inside[j]]


@replaces("candidates", "neighbours", 2)
def grid_ends(solver: Plain, cells: Indices) -> IndexPairs:
    """The grid ends 64 cells from the origin, and particles that have left it aren't found."""
    i, j = Plain.candidates(solver, cells)
    inside = np.abs(cells).max(axis=1) < 64
    return i[inside[i] & inside[j]], j[inside[i] & inside[j]]


@replaces("cells", "neighbours", 2)
def half_cells(solver: Plain) -> Indices:
    """Cells have half the support as their side, but only the eight around are searched."""
    return np.floor(solver.x / (solver.h / 2)).astype(np.int64)


@fault("stale_lists", "neighbours", 2)
class StaleLists(Plain):
    """Neighbours are searched in every twentieth evaluation, without a margin."""

    age = 0

    def candidates(self, cells: Indices) -> IndexPairs:
        if self.age % 20 == 0:
            self.kept = super().candidates(cells)
            near = np.linalg.norm(self.x[self.kept[0]] - self.x[self.kept[1]], axis=1) < self.h
            self.kept = self.kept[0][near], self.kept[1][near]
        self.age += 1
        return self.kept


@fault("lists_of_the_start", "neighbours", 2)
class ListsOfTheStart(Plain):
    """Neighbours are searched once, at the start."""

    def find_neighbors(self) -> None:
        if not hasattr(self, "kept"):
            super().find_neighbors()
            self.kept = self.i, self.j
        self.i, self.j = self.kept
        d = self.x[self.i] - self.x[self.j]
        self.r = np.sqrt((d**2).sum(axis=1))
        self.direction = self.directions(d, self.r)


@replaces("candidates", "neighbours", 2)
def missing_column(solver: Plain, cells: Indices) -> IndexPairs:
    """The column of cells on the right is left out, by a loop that ends one too early."""
    i, j = Plain.candidates(solver, cells)
    kept = cells[j, 0] <= cells[i, 0]
    return i[kept], j[kept]


@replaces("candidates", "neighbours", 2)
def no_corner_cells(solver: Plain, cells: Indices) -> IndexPairs:
    """The four cells that touch only at a corner are left out of the eight around."""
    i, j = Plain.candidates(solver, cells)
    kept = np.abs(cells[j] - cells[i]).sum(axis=1) < 2
    return i[kept], j[kept]


@replaces("candidates", "neighbours", 2)
def column_visited_twice(solver: Plain, cells: Indices) -> IndexPairs:
    """The cells on the right are searched twice: two indices lead to one place of the hash."""
    i, j = Plain.candidates(solver, cells)
    again = cells[j, 0] > cells[i, 0]
    return np.concatenate([i, i[again]]), np.concatenate([j, j[again]])


@replaces("find_neighbors", "neighbours", 2)
def sixteen_neighbors(solver: Plain) -> None:
    """Lists hold 16 neighbours; what comes after is dropped."""
    Plain.find_neighbors(solver)
    order = np.argsort(solver.i, kind="stable")
    rank = np.arange(len(order)) - np.searchsorted(solver.i[order], solver.i[order])
    kept = order[rank < 16]
    solver.i, solver.j, solver.r = solver.i[kept], solver.j[kept], solver.r[kept]
    solver.direction = solver.direction[kept]


@replaces("candidates", "neighbours", 2)
def pairs_counted_twice(solver: Plain, cells: Indices) -> IndexPairs:
    """Each neighbour is twice in the list."""
    i, j = Plain.candidates(solver, cells)
    return np.concatenate([i, i]), np.concatenate([j, j])


@replaces("candidates", "neighbours", 2)
def one_of_two(solver: Plain, cells: Indices) -> IndexPairs:
    """Pairs are listed once, i < j, but only i is given its share."""
    i, j = Plain.candidates(solver, cells)
    return i[i < j], j[i < j]


@replaces("step", "neighbours", 2)
def sorted_positions(solver: Plain, dt: float) -> None:
    """Positions are sorted by cell in every step, velocities are not."""
    solver.x = solver.x[np.lexsort(solver.cells().T)]
    Plain.step(solver, dt)
