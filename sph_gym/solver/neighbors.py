"""Who may be a neighbour of whom: a cell grid, and brute force behind the same interface.

Both answer two questions: which rows of cells can hold neighbours of a particle (`rows`), and
which consecutive particles of such a row (`span`). Particles are kept sorted by cell, so that a
span is a plain range of indices. `grid=None` means brute force: one row, everybody in it. If a
run goes well without the grid and not with it, the fault is in this file.
"""

import math
from typing import NamedTuple

import numpy as np

from sph_gym.solver.jit import jit
from sph_gym.solver.state import Floats, Indices, Particles, WallParticles

# A cell as wide as the support loses pairs to rounding on lattices with a whole h / dx.
SLACK = 1.001
COLUMNS_PER_SUPPORT = 4
CELLS_PER_PARTICLE = 16


class Grid(NamedTuple):
    """Cells h high and h/4 wide, slightly enlarged; particles outside belong to the edge cells.

    Clamping keeps the distance between two cells from growing, so neighbours are found wherever
    they are; a crowd outside costs time, nothing else.
    """

    x0: float
    y0: float
    columns_per_m: float
    rows_per_m: float
    n_columns: int
    n_rows: int


@jit
def _clamped(position, n):
    """Index of a cell from its place in cell widths; written so that NaN gives 0."""
    if position >= n:
        return n - 1
    return int(position) if position > 0.0 else 0


@jit
def cell(grid, x, y):
    """Index of the cell in which a particle at x, y [m] is kept."""
    if grid is None:
        return 0
    column = _clamped((x - grid.x0) * grid.columns_per_m, grid.n_columns)
    return _clamped((y - grid.y0) * grid.rows_per_m, grid.n_rows) * grid.n_columns + column


@jit
def count_cells(grid):
    """Number of cells."""
    if grid is None:
        return 1
    return grid.n_columns * grid.n_rows


@jit
def rows(grid, y):
    """First and last-plus-one row of cells that can hold neighbours of a particle at y [m]."""
    if grid is None:
        return 0, 1
    row = _clamped((y - grid.y0) * grid.rows_per_m, grid.n_rows)
    return max(row - 1, 0), min(row + 2, grid.n_rows)


@jit
def span(grid, start, row, x):
    """Unsigned range of the particles in `row` that can be neighbours of one at x [m]."""
    if grid is None:
        return np.uint64(start[0]), np.uint64(start[1])
    column = _clamped((x - grid.x0) * grid.columns_per_m, grid.n_columns)
    first = max(column - COLUMNS_PER_SUPPORT, 0)
    last = min(column + COLUMNS_PER_SUPPORT, grid.n_columns - 1)
    base = row * grid.n_columns
    return np.uint64(start[base + first]), np.uint64(start[base + last + 1])


@jit
def sort_into_cells(grid, source, target, start, cells):
    """Copy positions, velocities and ids from `source` to `target` in the order of their cells.

    A stable counting sort. Afterwards cell c holds target[start[c]:start[c + 1]]; `start` has
    count_cells + 2 entries, `cells` one a particle, both are scratch.
    """
    n = source.x.size
    start[: count_cells(grid) + 2] = 0
    for i in range(n):
        c = cell(grid, source.x[i], source.y[i])
        cells[i] = c
        start[c + 2] += 1
    total = 0
    for c in range(2, count_cells(grid) + 2):
        total += start[c]
        start[c] = total
    for i in range(n):
        k = start[cells[i] + 1]
        start[cells[i] + 1] = k + 1
        target.x[k] = source.x[i]
        target.y[k] = source.y[i]
        target.u[k] = source.u[i]
        target.v[k] = source.v[i]
        target.id[k] = source.id[i]


def make_grid(fluid: Particles, walls: WallParticles | None, h: float) -> Grid:
    """The grid that covers all particles, or the bulk of them where a few are far away."""
    height = SLACK * h
    width = height / COLUMNS_PER_SUPPORT
    n_particles = fluid.x.size + (0 if walls is None else walls.x.size)
    budget = CELLS_PER_PARTICLE * n_particles + 64
    for quantile in (0.0, 0.02):
        x0, n_columns = _side(fluid.x, None if walls is None else walls.x, width, quantile)
        y0, n_rows = _side(fluid.y, None if walls is None else walls.y, height, quantile)
        if n_columns * n_rows <= budget:
            break
    else:
        side = math.floor(math.sqrt(budget))
        n_columns, n_rows = min(n_columns, side), min(n_rows, side)
    return Grid(x0, y0, 1 / width, 1 / height, int(n_columns), int(n_rows))


def _side(fluid: Floats, walls: Floats | None, size: float, quantile: float) -> tuple[float, float]:
    """Where the cells begin [m], on a multiple of their size, and how many there are."""
    bounds = (
        np.quantile(fluid, (quantile, 1 - quantile)) if quantile else (fluid.min(), fluid.max())
    )
    low, high = float(bounds[0]), float(bounds[1])
    if walls is not None:
        low, high = min(low, float(walls.min())), max(high, float(walls.max()))
    first = math.floor(low / size)
    return first * size, float(math.floor(high / size) - first + 1)


def scratch(grid: Grid | None, n: int) -> tuple[Indices, Indices]:
    """Arrays `start` and `cells` for `sort_into_cells`."""
    n_cells = 1 if grid is None else grid.n_columns * grid.n_rows
    return np.zeros(n_cells + 2, np.int32), np.zeros(n, np.int32)
