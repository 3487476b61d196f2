"""Does every particle list all others within the support, and once?"""

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor.case import DX, Array, Case, case, cloud, lattice
from sph_gym.doctor.findings import Finding, failed, inconclusive, passed
from sph_gym.doctor.lab import TINY, Lab
from sph_gym.doctor.registry import check
from sph_gym.doctor.subject import SolverUnderTest
from sph_gym.doctor.weights import ends_softly, pair_weights

Matrix = NDArray[np.int64]

# Pairs beyond this share of h weigh next to nothing, and rounding may put them on either side.
CERTAIN = 0.99
# Places far from the origin [h].
FAR = 1000.0
BRUTE_FORCE = (
    "Replace the search by a loop over all pairs: if the fault is gone, it was the search. If it "
    "stays, it is the adding: in NumPy, a[i] += b keeps only one of equal indices (np.add.at or "
    "np.bincount add all). "
)


@check("neighbours", step=2, needs=("order",), shows=("neighbors",))
def neighbor_lists(lab: Lab) -> Finding:
    """Compare the lists of neighbours with all pairs, at cell borders and around the origin."""
    tried = 0
    for where, start in _arrangements(lab):
        r = _distances(start.x)
        near = (r < CERTAIN * start.h) & ~np.eye(start.n, dtype=bool)
        counts = _lists(lab, start)
        tried += int(near.sum())
        missing = near & (counts == 0)
        if _is_half(counts, near):
            missing &= missing.T
        if missing.any():
            return _missing(lab, where, start, r, near, missing)
        if (counts[near] > 1).any():
            return _doubled(lab, where, counts, near)
    return passed(
        f"{tried} pairs nearer than {CERTAIN} h, in disorder and on lattices with h/dx = 2, 3, 4, "
        f"around the origin and {FAR:.0f} h from it: all listed",
        0,
        0,
        unit="pairs missing",
    )


def _arrangements(lab: Lab) -> list[tuple[str, Case]]:
    crowd = cloud(lab.rng, 7, 7, DX, 0.3)
    found = [("in disorder around the origin", case(crowd))]
    for ratio in (2, 3, 4):
        # multiples of dx: every few particles lie exactly on the border of two cells
        x = np.round(lattice(9, 5) / DX) * DX
        found.append((f"on a lattice with h = {ratio} dx around the origin", case(x, h=ratio * DX)))
    negative = np.array([-7.37, -20.0])
    found.append(("at negative coordinates", case(crowd + negative * found[0][1].h)))
    found.append((f"{FAR:.0f} h from the origin", case(crowd + FAR * found[0][1].h)))
    return found


def _lists(lab: Lab, start: Case) -> Matrix:
    subject = lab.make(start)
    if "evaluate" in lab.shown:
        subject.evaluate()
    else:
        subject.step(TINY * start.h / start.c0)
    return listed(subject)


def listed(subject: SolverUnderTest) -> Matrix:
    """Return how often each particle lists each other, (n, n)."""
    n = subject.case.n
    counts = np.zeros((n, n), dtype=np.int64)
    for i in range(n):
        found = subject.neighbors(i).astype(np.int64)
        # lists of one length are filled up with -1 or n by some
        np.add.at(counts[i], found[(found >= 0) & (found < n)], 1)
    return counts


def _is_half(counts: Matrix, near: NDArray[np.bool_]) -> bool:
    """Return whether each pair is in the list of one of the two, as some solvers do on purpose."""
    return bool(((counts > 0) ^ (counts.T > 0))[near].mean() > 0.99)


def _distances(x: Array) -> Array:
    return np.asarray(np.linalg.norm(x[:, None] - x[None], axis=2))


def _missing(
    lab: Lab, where: str, start: Case, r: Array, near: NDArray[np.bool_], missing: NDArray[np.bool_]
) -> Finding:
    i, j = np.argwhere(missing)[0]
    text = (
        f"{start.n} particles {where}: {int(missing.sum())} of {int(near.sum())} neighbours are "
        f"not listed, such as {j} of particle {i}, {r[i, j] / start.h:.2f} h apart"
    )
    numbers = (int(missing.sum()), 0)
    found = near & ~missing
    reach = float(r[found].max() / start.h) if found.any() else 0.0
    if found.any() and reach < 0.95 and r[missing].min() > (reach - 1e-6) * start.h:
        finding = _short(lab, reach, f"{text}; no pair beyond {reach:.2f} h is")
        if finding:
            return finding
    return failed(
        text,
        BRUTE_FORCE + "Cells must be at least as wide as the support, all nine cells around a "
        "particle be searched, and cells of negative coordinates come from floor(), not int().",
        *numbers,
        unit="pairs missing",
    )


def _short(lab: Lab, reach: float, text: str) -> Finding | None:
    """Judge lists that end at `reach` [h]; None if the kernel goes on there."""
    soft = ends_softly(lab, reach)
    if soft is None:
        return inconclusive(text, reach, 1.0, unit="h")
    if not soft:
        return None
    return failed(
        f"{text}, and there the kernel ends as well",
        "case.h is the radius at which the kernel ends. A code whose h is the smoothing length, "
        "with kernels that end at 2 h, has to take case.h / 2 for it.",
        reach,
        1.0,
        unit="h",
        link="density",
    )


def _doubled(lab: Lab, where: str, counts: Matrix, near: NDArray[np.bool_]) -> Finding:
    number = int((counts[near] > 1).sum())
    text = f"particles {where}: {number} of {int(near.sum())} neighbours are listed more than once"
    weights = pair_weights(lab)
    if weights is None or (weights.once and not weights.one_sided):
        return inconclusive(f"{text}, but the sums don't show it", number, 0)
    return failed(
        f"{text}, and the sums count them so",
        "Two of the nine cells may have the same place in a hash table: search each place once.",
        number,
        0,
        unit="pairs doubled",
    )
