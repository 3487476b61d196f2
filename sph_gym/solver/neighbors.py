"""The neighbour search: a cell grid, and lists of the neighbours of groups of particles.

Fluid particles are kept sorted by cell. A *group* is as many consecutive particles of a row of
cells as there are lanes; its neighbours are written down once a step, as indices of all particles
within the support radius of the rectangle around the group, first the fluid's, then the wall's.
Density and force then run over that list.

Brute force is a grid of one cell with an infinite reach: every list holds all particles. If a run
goes well with it and not with the grid, the fault is in this file.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.jit import jitable
from sph_gym.solver.lanes import (
    append,
    broadcast,
    entry,
    first_lanes,
    highest,
    like,
    load,
    lowest,
    maximum,
    minimum,
    select,
    width,
)
from sph_gym.solver.state import Floats, Indices
from sph_gym.solver.teams import meet, share

# A cell as wide as the support loses pairs to rounding on lattices with a whole h / dx.
SLACK = 1.001
COLUMNS_PER_SUPPORT = 4
CELLS_PER_PARTICLE = 8
# A group that is wider than this many support radii, across a gap or a corner, is cut in two; in a
# periodic domain so that no particle is near it and its image, of which the ends are not trusted.
WIDEST_GROUP = 4.0
NARROWEST_DOMAIN = 4.0
# Sigma clipping of the grid: strays beyond so many standard deviations are left out.
STRAY = 3.0


class Grid(NamedTuple):
    """Cells h high and h/4 wide, slightly enlarged; particles outside belong to the edge cells.

    Brute force has one cell.

    Clamping keeps the distance between two cells from growing, so neighbours are found wherever
    they are; a crowd outside costs time, nothing else.
    """

    x0: float
    y0: float
    columns_per_m: float
    rows_per_m: float
    n_columns: int
    n_rows: int


class Rectangle(NamedTuple):
    """The smallest one around some particles [m]."""

    x_low: Any
    x_high: Any
    y_low: Any
    y_high: Any


class CellWindow(NamedTuple):
    """Rows and columns of cells, first and last-plus-one, around a rectangle."""

    box: Rectangle
    first_row: int
    last_row: int
    first_column: int
    last_column: int


class Sorting(NamedTuple):
    """The arrays that the sort needs besides the particles.

    frame: (6,) the numbers of the present `Grid`; counts: (n_threads,
    n_cells) and cells: (n_particles,) scratch; shares: (n_threads,) particles in the cells that
    are each thread's part.
    """

    frame: Floats
    counts: Indices
    cells: Indices
    shares: Any


class Lists(NamedTuple):
    """The neighbours of every group.

    entries: indices of particles, a part of the array for each thread; groups: (4 n,) for the
    group that begins with fluid particle i, from 4 i on: where in `entries` its fluid neighbours
    begin, where they end and its wall neighbours begin, where those end, and its size.
    """

    entries: Indices
    groups: Any


# --- Cells ----------------------------------------------------------------------------------


@jitable
def read_grid(frame):
    """Return the present grid."""
    return Grid(frame[0], frame[1], frame[2], frame[3], int(frame[4]), int(frame[5]))


@jitable
def _clamped(position, n):
    """Index of a cell from its place in cell widths; written so that NaN gives 0."""
    if position >= n:
        return n - 1
    return int(position) if position > 0.0 else 0


@jitable
def _column(grid, x):
    return _clamped((x - grid.x0) * grid.columns_per_m, grid.n_columns)


@jitable
def _row(grid, y):
    return _clamped((y - grid.y0) * grid.rows_per_m, grid.n_rows)


@jitable
def cell(grid, x, y):
    """Index of the cell in which a particle at x, y [m] is kept."""
    return _row(grid, y) * grid.n_columns + _column(grid, x)


@jitable
def row_range(grid, start, row):
    """First and last-plus-one particle of a row of cells."""
    return entry(start, row * grid.n_columns), entry(start, (row + 1) * grid.n_columns)


@jitable
def copy_entry(source, target, i, k):
    """target[k] = source[i], for columns that may be absent."""
    if source is None:
        return
    target[k] = source[i]


@jitable
def copy_state(source, target, i, k):
    """Copy all that makes the state of particle i of `source` to place k of `target`."""
    target.x[k] = source.x[i]
    target.y[k] = source.y[i]
    target.u[k] = source.u[i]
    target.v[k] = source.v[i]
    target.id[k] = source.id[i]
    copy_entry(source.ax, target.ax, i, k)
    copy_entry(source.ay, target.ay, i, k)
    copy_entry(source.tx, target.tx, i, k)
    copy_entry(source.ty, target.ty, i, k)
    copy_entry(source.growth, target.growth, i, k)
    copy_entry(source.offset, target.offset, i, k)


@jitable
def sort_into_cells(rank, n_threads, team, source, target, sorting, start):
    """Copy the state from `source` to `target` in the order of their cells.

    A stable counting sort, each thread moving its share. Afterwards cell c holds
    target[start[c]:start[c + 1]]. Returns False if the team was told to stop.
    """
    grid = read_grid(sorting.frame)
    n_cells = grid.n_columns * grid.n_rows
    counts, cells = sorting.counts, sorting.cells
    for c in range(n_cells):
        counts[rank, c] = 0
    first, last = share(source.id.size, rank, n_threads)
    for i in range(first, last):
        c = cell(grid, source.x[i], source.y[i])
        cells[i] = c
        counts[rank, c] += 1
    if not meet(team, n_threads):
        return False
    if not _find_starts(rank, n_threads, team, n_cells, counts, sorting.shares, start):
        return False
    for i in range(first, last):
        c = cells[i]
        k = counts[rank, c]
        counts[rank, c] = k + 1
        copy_state(source, target, i, k)
    return meet(team, n_threads)


@jitable
def _find_starts(rank, n_threads, team, n_cells, counts, shares, start):
    """Turn the counts of all threads into the place of the first particle of each, cell by cell."""
    first, last = share(n_cells, rank, n_threads)
    place = 0
    if n_threads > 1:
        total = 0
        for t in range(n_threads):
            for c in range(first, last):
                total += counts[t, c]
        shares[rank] = total
        if not meet(team, n_threads):
            return False
        for t in range(rank):
            place += shares[t]
    for c in range(first, last):
        start[c] = place
        for t in range(n_threads):
            count = counts[t, c]
            counts[t, c] = place
            place += count
    if rank == n_threads - 1:
        start[n_cells] = place
    return meet(team, n_threads)


# --- Laying the grid ------------------------------------------------------------------------


@jitable
def rectangle(particles, i, n):
    """The rectangle around particles i to i + n."""
    x_low = x_high = broadcast(particles.x, i)
    y_low = y_high = broadcast(particles.y, i)
    for k in range(i, i + n, width(particles.x)):
        x, y = load(particles.x, k), load(particles.y, k)
        inside = first_lanes(x, i + n - k)
        x, y = select(inside, x, x_low), select(inside, y, y_low)
        x_low, x_high = minimum(x_low, x), maximum(x_high, x)
        y_low, y_high = minimum(y_low, y), maximum(y_high, y)
    return Rectangle(lowest(x_low), highest(x_high), lowest(y_low), highest(y_high))


@jitable
def lay_grid(frame, fluid, h, n_cells):
    """Lay the grid over where the fluid is, a bit more than h beyond; False if it is the same.

    Where a few strays would make it larger than `n_cells`, it covers the bulk of the fluid.
    """
    if frame[4] * frame[5] == 1.0:
        # brute force has nothing to lay
        return True
    height = SLACK * h
    cell_width = height / COLUMNS_PER_SUPPORT
    box = rectangle(fluid, 0, fluid.id.size)
    x_low, x_high = float(box.x_low), float(box.x_high)
    y_low, y_high = float(box.y_low), float(box.y_high)
    for _ in range(40):
        # floats, which cannot overflow into small numbers
        left, low = np.floor(x_low / cell_width), np.floor(y_low / height)
        first_column, first_row = left - COLUMNS_PER_SUPPORT - 1.0, low - 2.0
        # differences first: far enough from the origin, nothing is left of what is added to one
        n_columns = np.floor(x_high / cell_width) - left + (2.0 * COLUMNS_PER_SUPPORT + 3.0)
        n_rows = np.floor(y_high / height) - low + 5.0
        if n_columns * n_rows <= n_cells:
            break
        x_low, x_high = _bulk(fluid.x, fluid.id.size, x_low, x_high)
        y_low, y_high = _bulk(fluid.y, fluid.id.size, y_low, y_high)
    else:
        side = np.floor(math.sqrt(n_cells))
        n_columns, n_rows = min(n_columns, side), min(n_rows, side)
    x0, y0 = first_column * cell_width, first_row * height
    same = frame[0] == x0 and frame[1] == y0 and frame[4] == n_columns and frame[5] == n_rows
    frame[0], frame[1], frame[2], frame[3] = x0, y0, 1 / cell_width, 1 / height
    frame[4], frame[5] = n_columns, n_rows
    return not same


@jitable
def _bulk(values, n, low, high):
    """Mean -+ STRAY standard deviations of the values in [low, high], and no wider than that."""
    # two passes: a difference of squares would lose all digits where a stray is very far
    count, total, total2 = 0, 0.0, 0.0
    for i in range(n):
        value = float(values[i])
        if low <= value <= high:
            count += 1
            total += value
    mean = total / max(count, 1)
    for i in range(n):
        value = float(values[i])
        if low <= value <= high:
            total2 += (value - mean) ** 2
    reach = STRAY * math.sqrt(total2 / max(count, 1))
    return max(low, mean - reach), min(high, mean + reach)


# --- Lists ----------------------------------------------------------------------------------

BEGIN, MIDDLE, END, SIZE = 0, 1, 2, 3


@jitable
def neighbor(lists, k):
    """Return the index of the k-th neighbour."""
    return entry(lists.entries, k)


@jitable
def own_part(lists, rank, n_threads):
    """Return where in `entries` a thread's list begins and has to end."""
    return share(lists.entries.size, rank, n_threads)


@jitable
def rest_of_block(i, n_lanes, n):
    """Return how many of the next n particles, i places into their row, a group may have.

    Groups don't reach over a multiple of the lanes, counted from the row's first particle. So they
    are the same wherever a thread's share ends; a list of another length would be summed by
    another mix of unrolled and single passes, which round differently.
    """
    return min(n_lanes - i % n_lanes, n)


@jitable
def _next_block(grid, start, n_lanes, i):
    """The first particle from i on with which a block may begin."""
    for row in range(grid.n_rows):
        low, high = row_range(grid, start, row)
        if i < high:
            blocks = (max(i - low, 0) + n_lanes - 1) // n_lanes
            return min(low + blocks * n_lanes, high)
    return i


@jitable
def own_blocks(grid, start, n, n_lanes, rank, n_threads):
    """A thread's share of n sorted particles, in whole blocks."""
    first, last = share(n, rank, n_threads)
    return _next_block(grid, start, n_lanes, first), _next_block(grid, start, n_lanes, last)


@jitable
def group_size(lists, i):
    """Return the number of particles in the group that begins with fluid particle i."""
    return entry(lists.groups, 4 * i + SIZE)


@jitable
def fluid_range(lists, i):
    """Return where the fluid neighbours of the group of particle i begin and end."""
    return entry(lists.groups, 4 * i + BEGIN), entry(lists.groups, 4 * i + MIDDLE)


@jitable
def wall_range(lists, i):
    """Return where the wall neighbours of the group of particle i begin and end."""
    return entry(lists.groups, 4 * i + MIDDLE), entry(lists.groups, 4 * i + END)


@jitable
def compact_group(particles, i, n, widest):
    """A group of at most n particles from i on that isn't wider than `widest` [m], its rectangle.

    Sorted neighbours may lie far apart: at the two ends of a gap, or outside the grid.
    """
    box = rectangle(particles, i, n)
    while n > 1 and (box.x_high - box.x_low > widest or box.y_high - box.y_low > widest):
        n -= 1
        while n > 1 and abs(particles.x[i + n - 1] - particles.x[i]) > widest:
            n -= 1
        box = rectangle(particles, i, n)
    return n, box


@jitable
def make_window(grid, box):
    """Return the cells that hold the neighbours of all particles in the rectangle."""
    return CellWindow(
        box,
        max(_row(grid, box.y_low) - 1, 0),
        min(_row(grid, box.y_high) + 2, grid.n_rows),
        max(_column(grid, box.x_low) - COLUMNS_PER_SUPPORT, 0),
        min(_column(grid, box.x_high) + COLUMNS_PER_SUPPORT + 1, grid.n_columns),
    )


@jitable
def collect(window, start, n_columns, sources, h2, lists, k, list_end):
    """Append all of `sources` within sqrt(h2) of the rectangle; the new end of the list.

    Where the list might become too long, nothing is written and the end is beyond `list_end`.
    """
    if sources is None:
        return k
    box, n_lanes = window.box, width(sources.x)
    for row in range(window.first_row, window.last_row):
        low = entry(start, row * n_columns + window.first_column)
        high = entry(start, row * n_columns + window.last_column)
        if k + (high - low) + 2 * n_lanes > list_end:
            return list_end + 1
        for j in range(low, high, n_lanes):
            x, y = load(sources.x, j), load(sources.y, j)
            zero = like(x, 0.0)
            dx = maximum(maximum(box.x_low - x, x - box.x_high), zero)
            dy = maximum(maximum(box.y_low - y, y - box.y_high), zero)
            near = dx * dx + dy * dy < h2
            k = append(lists.entries, k, j, near & first_lanes(x, high - j))
    return k


@jitable
def _first_image(period, grid):
    if period is None:
        return 0
    # with brute force the list holds every particle once, and distances find the nearest image
    return 0 if grid.n_columns * grid.n_rows == 1 else -1


@jitable
def _shift(period, k):
    if period is None:
        return 0.0
    return k * float(period.length)


@jitable
def _is_far(period, low, high, h):
    """Return whether no particle in a periodic domain can be within h of [low, high]."""
    if period is None:
        return False
    # twice, since particles may be a bit outside in the middle of a step
    return high < period.low - 2.0 * h or low > period.high + 2.0 * h


@jitable
def collect_images(constants, box, grid, start, sources, lists, k, list_end):
    """`collect` for the rectangle and, in a periodic domain, its images.

    Groups are so narrow that no particle is within h of two images.
    """
    if sources is None:
        return k
    period_x, period_y, reach2 = constants.period_x, constants.period_y, constants.reach2
    h = float(constants.h)
    first_x, first_y = _first_image(period_x, grid), _first_image(period_y, grid)
    for a in range(first_x, 1 - first_x):
        shift_x = like(box.x_low, _shift(period_x, a))
        x_low, x_high = box.x_low + shift_x, box.x_high + shift_x
        if _is_far(period_x, x_low, x_high, h):
            continue
        for b in range(first_y, 1 - first_y):
            shift_y = like(box.y_low, _shift(period_y, b))
            y_low, y_high = box.y_low + shift_y, box.y_high + shift_y
            if _is_far(period_y, y_low, y_high, h):
                continue
            window = make_window(grid, Rectangle(x_low, x_high, y_low, y_high))
            k = collect(window, start, grid.n_columns, sources, reach2, lists, k, list_end)
            if k > list_end:
                return k
    return k


def make_sorting(n_fluid: int, n_walls: int, brute: bool, n_threads: int) -> Sorting:
    """Return arrays to sort so many particles with; `brute`: into one cell."""
    n_cells = 1 if brute else CELLS_PER_PARTICLE * n_fluid + 64
    return Sorting(
        np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0]) if brute else np.zeros(6),
        np.zeros((n_threads, n_cells), np.int32),
        np.zeros(max(n_fluid, n_walls), np.int32),
        np.zeros(n_threads, np.int64),
    )


def make_lists(n_fluid: int, n_threads: int, entries_per_particle: float) -> Lists:
    """Return lists that hold so many entries; they grow where that is too little."""
    n_entries = 4096 * n_threads + int(entries_per_particle * n_fluid)
    return Lists(np.zeros(n_entries, np.int32), np.zeros(4 * n_fluid, np.int64))
