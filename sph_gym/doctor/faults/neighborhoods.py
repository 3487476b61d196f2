"""Faults of the link "neighbours": pairs that are missing, doubled or out of date."""

import numpy as np

from sph_gym.doctor.faults.registry import fault
from sph_gym.doctor.plain import Indices, Plain

Pairs = tuple[Indices, Indices]


@fault("negative_cells", "neighbours", 2)
class NegativeCells(Plain):
    """The grid begins at 0: particles at negative coordinates are in no cell."""

    def candidates(self, cells: Indices) -> Pairs:
        i, j = super().candidates(cells)
        inside = cells.min(axis=1) >= 0
        return i[inside[i] & inside[j]], j[inside[i] & inside[j]]


@fault("grid_ends", "neighbours", 2)
class GridEnds(Plain):
    """The grid ends 64 cells from the origin, and particles that have left it aren't found."""

    def candidates(self, cells: Indices) -> Pairs:
        i, j = super().candidates(cells)
        inside = np.abs(cells).max(axis=1) < 64
        return i[inside[i] & inside[j]], j[inside[i] & inside[j]]


@fault("half_cells", "neighbours", 2)
class HalfCells(Plain):
    """Cells have half the support as their side, but only the eight around are searched."""

    def cells(self) -> Indices:
        return np.floor(self.x / (self.h / 2)).astype(np.int64)


@fault("stale_lists", "neighbours", 2)
class StaleLists(Plain):
    """Neighbours are searched in every twentieth evaluation, without a margin."""

    age = 0

    def candidates(self, cells: Indices) -> Pairs:
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


@fault("missing_column", "neighbours", 2)
class MissingColumn(Plain):
    """The column of cells on the right is left out, by a loop that ends one too early."""

    def candidates(self, cells: Indices) -> Pairs:
        i, j = super().candidates(cells)
        kept = cells[j, 0] <= cells[i, 0]
        return i[kept], j[kept]


@fault("no_corner_cells", "neighbours", 2)
class NoCornerCells(Plain):
    """The four cells that touch only at a corner are left out of the eight around."""

    def candidates(self, cells: Indices) -> Pairs:
        i, j = super().candidates(cells)
        kept = np.abs(cells[j] - cells[i]).sum(axis=1) < 2
        return i[kept], j[kept]


@fault("column_visited_twice", "neighbours", 2)
class ColumnVisitedTwice(Plain):
    """The cells on the right are searched twice: two indices lead to one place of the hash."""

    def candidates(self, cells: Indices) -> Pairs:
        i, j = super().candidates(cells)
        again = cells[j, 0] > cells[i, 0]
        return np.concatenate([i, i[again]]), np.concatenate([j, j[again]])


@fault("sixteen_neighbors", "neighbours", 2)
class SixteenNeighbors(Plain):
    """Lists hold 16 neighbours; what comes after is dropped."""

    def find_neighbors(self) -> None:
        super().find_neighbors()
        order = np.argsort(self.i, kind="stable")
        rank = np.arange(len(order)) - np.searchsorted(self.i[order], self.i[order])
        kept = order[rank < 16]
        self.i, self.j, self.r = self.i[kept], self.j[kept], self.r[kept]
        self.direction = self.direction[kept]


@fault("pairs_counted_twice", "neighbours", 2)
class PairsCountedTwice(Plain):
    """Each neighbour is twice in the list."""

    def candidates(self, cells: Indices) -> Pairs:
        i, j = super().candidates(cells)
        return np.concatenate([i, i]), np.concatenate([j, j])


@fault("one_of_two", "neighbours", 2)
class OneOfTwo(Plain):
    """Pairs are listed once, i < j, but only i is given its share."""

    def candidates(self, cells: Indices) -> Pairs:
        i, j = super().candidates(cells)
        return i[i < j], j[i < j]


@fault("sorted_positions", "neighbours", 2)
class SortedPositions(Plain):
    """Positions are sorted by cell in every step, velocities are not."""

    def step(self, dt: float) -> None:
        self.x = self.x[np.lexsort(self.cells().T)]
        super().step(dt)
