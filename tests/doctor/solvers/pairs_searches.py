"""Searches of neighbours, sound and broken, for `pairs_zoo.zoo(pairs=...)`.

Each is a function of the solver and of its distances (n, n), and returns how often each pair (i, j)
counts in the sums of i, (n, n).
"""

import numpy as np


def _near(solver, r):
    return (r < solver.h).astype(int)


def _cells(solver, size=1.0):
    return np.floor(solver.x / (size * solver.h)).astype(int)


def _adjacent(cells):
    return (np.abs(cells[:, None] - cells[None]).max(axis=2) <= 1).astype(int)


def grid(solver, r):
    """Nine cells as wide as the support: sound."""
    return _near(solver, r) * _adjacent(_cells(solver))


def truncated_grid(solver, r):
    """int() for floor(): the cells around 0 are twice as wide, which does no harm."""
    return _near(solver, r) * _adjacent((solver.x / solver.h).astype(int))


def verlet(solver, r):
    """Lists up to 1.3 h, anew when somebody has moved by half of the margin: sound."""
    if not hasattr(solver, "kept") or np.abs(solver.x - solver.at).max() > 0.1 * solver.h:
        solver.kept, solver.at = (r < 1.3 * solver.h).astype(int), solver.x.copy()
    return solver.kept


def at_intervals(solver, r):
    """Lists up to 1.2 h, anew in every tenth evaluation: enough at the speeds of a sound case."""
    solver.age = getattr(solver, "age", -1) + 1
    if solver.age % 10 == 0:
        solver.kept = (r < 1.2 * solver.h).astype(int)
    return solver.kept


def _hashed(solver, size, once):
    """Return how often j is found where the nine cells around i lead to in a table."""
    cells = _cells(solver)
    place = lambda c: ((c[..., 0] * 73856093) ^ (c[..., 1] * 19349663)) % size  # noqa: E731
    around = np.array([(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)])
    searched = place(cells[:, None] + around[None])
    found = searched[:, None, :] == place(cells)[None, :, None]
    return found.any(axis=2).astype(int) if once else found.sum(axis=2)


def hashed(solver, r):
    """A hash table, each place searched once: sound."""
    return _near(solver, r) * _hashed(solver, 64, True)


def hashed_twice(solver, r):
    """A hash table that is too small: two of the nine cells lead to one place."""
    return _near(solver, r) * _hashed(solver, 64, False)


def nearest(k):
    """Return a search for the k nearest only."""

    def search(solver, r):
        rank = np.argsort(np.argsort(r, axis=1), axis=1)
        return _near(solver, r) * (rank <= k)

    return search


def first(k):
    """Return lists that hold k neighbours."""

    def search(solver, r):
        near = _near(solver, r)
        np.fill_diagonal(near, 0)
        return near * (np.cumsum(near, axis=1) <= k)

    return search


def anew_every(k):
    """Return a search that is done in every k-th evaluation, without a margin."""

    def search(solver, r):
        solver.age = getattr(solver, "age", -1) + 1
        if solver.age % k == 0:
            solver.kept = _near(solver, r)
        return solver.kept

    return search


def half_radius(solver, r):
    """A search up to h / 2 for kernels that end at h."""
    return (r < solver.h / 2).astype(int)


def domain(solver, r):
    """Cells of a domain from 0 to 100 h; who is outside is in no cell."""
    cells = _cells(solver)
    inside = ((cells >= 0) & (cells < 100)).all(axis=1)
    return _near(solver, r) * inside[:, None] * inside[None]


def one_row(solver, r):
    """Only the cells on the left and right are searched, the rows above and below are not."""
    cells = _cells(solver)
    return _near(solver, r) * _adjacent(cells) * (cells[:, None, 1] == cells[None, :, 1])


def one_side(solver, r):
    """Each pair once, and only one of both is given its share."""
    return np.triu(_near(solver, r), 1)


SOUND = {
    "grid": grid,
    "truncated_grid": truncated_grid,
    "verlet": verlet,
    "at_intervals": at_intervals,
    "hashed": hashed,
}
BROKEN = {
    "hashed_twice": hashed_twice,
    "nearest_12": nearest(12),
    "nearest_20": nearest(20),
    "nearest_32": nearest(32),
    "first_20": first(20),
    "first_32": first(32),
    "anew_every_20": anew_every(20),
    "anew_every_500": anew_every(500),
    "half_radius": half_radius,
    "domain": domain,
    "one_row": one_row,
    "one_side": one_side,
}
