"""Does every particle list all others within the support, and once?"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor.case import DX, RHO0, Array, Case, case, cloud, lattice
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, passed
from sph_gym.doctor.groups import at_rest
from sph_gym.doctor.lab import Lab, once
from sph_gym.doctor.registry import check
from sph_gym.doctor.remedies import BRUTE_FORCE
from sph_gym.doctor.subject import SolverUnderTest

# Distances of the pairs [h].
DISTANCES = np.round(np.arange(0.025, 1.225, 0.025), 3)
# Wide enough for 50 neighbours at rest, and so for more in the crowd than many lists hold.
SUPPORT = 4.0
# A kernel that ends with a larger step than this share of its middle does not end there by itself.
STEP = 0.04


class Weights(NamedTuple):
    """Densities [kg/m^3] of one evaluation.

    alone: that of a particle alone; pairs: (k, 2) what the other adds, for both of each pair at the
    k `DISTANCES`; x, rho: positions (m, 2) [m] and densities (m,) of a crowd; few_x, few_rho:
    (9, 2), (9,) the same of a group of nine; h: support radius [m].
    """

    alone: float
    pairs: Array
    x: Array
    rho: Array
    few_x: Array
    few_rho: Array
    h: float

    @property
    def added(self) -> Array:
        """Return what a neighbour adds (k,), the mean of both of a pair."""
        return np.asarray(self.pairs.mean(axis=1))

    @property
    def once(self) -> bool:
        """Return whether a very near neighbour adds what a particle adds to itself."""
        return abs(self.added[0] / self.alone - 1) < 0.2

    @property
    def one_sided(self) -> bool:
        """Return whether the two of a pair add different amounts to each other."""
        first, second = self.pairs[DISTANCES < 0.7].T
        return bool(np.abs(first - second).max() > 0.05 * np.abs(self.pairs).max())

    @property
    def ends(self) -> float:
        """Return the largest distance [h] at which a neighbour adds something."""
        counted = np.abs(self.added) > 1e-3 * np.abs(self.added).max()
        return float(DISTANCES[counted].max())

    def predicted(self, x: Array) -> Array:
        """Return the densities (m,) that the pairs predict for particles at x."""
        r = np.linalg.norm(x[:, None] - x[None], axis=2) / self.h
        added = np.interp(r, DISTANCES, self.added, left=self.added[0], right=0.0)
        np.fill_diagonal(added, 0.0)
        return np.asarray(self.alone + added.sum(axis=1))


@once
def pair_weights(lab: Lab) -> Weights | None:
    """Return what neighbours add to densities.

    None if the solver shows no densities, if they don't react on neighbours (as those by
    continuity), are held at rho0 from below or are not finite, or if particles fly off at once.
    """
    if "rho" not in lab.shown:
        return None
    h = SUPPORT * DX
    rng = np.random.default_rng(1)
    k = len(DISTANCES)
    # one particle alone, then the pairs, 4 h from each other and in all directions
    places = lattice(8, 7, 4 * h, (0.3 * h, 17.1 * h))[: k + 1]
    turned = rng.uniform(0, 2 * np.pi, k)
    others = places[1:] + h * DISTANCES[:, None] * np.stack([np.cos(turned), np.sin(turned)], 1)
    crowd, few = cloud(rng, 9, 9, 0.95 * DX, 0.1), lattice(3, 3, 0.95 * DX, (4.4 * h, 0.1 * h))
    x = np.concatenate([places, others, crowd, few])
    rho, _, moved = at_rest(lab, case(x, h=h))
    if rho is None or not np.isfinite(rho).all() or not np.abs(moved).max() < 1e-3 * h:
        return None
    alone, first, second, rho_crowd, rho_few = np.split(rho, np.cumsum([1, k, k, len(crowd)]))
    pairs = np.stack([first, second], axis=1) - alone
    held = abs(alone[0] / RHO0 - 1) < 1e-6
    if held or not np.abs(pairs).max() > 1e-4 * np.abs(rho).max():
        return None
    return Weights(float(alone[0]), pairs, crowd, rho_crowd, few, rho_few, h)


def ends_softly(lab: Lab, reach: float) -> bool | None:
    """Return whether what a neighbour adds dies away towards `reach` [h], where lists end.

    None where that can't be measured.
    """
    weights = pair_weights(lab)
    if weights is None:
        return None
    last = np.interp(0.97 * reach, DISTANCES, weights.added)
    return bool(abs(last) < STEP * np.abs(weights.added).max())


Matrix = NDArray[np.int64]

# Pairs beyond this share of h weigh next to nothing, and rounding may put them on either side.
CERTAIN = 0.99
# Places far from the origin [h].
FAR = 1000.0


@check("neighbours", step=2, needs=("order",), shows=("neighbors",))
def neighbor_lists(lab: Lab) -> Result:
    """Compare the lists of neighbours with all pairs, at cell borders and around the origin."""
    tried = 0
    for where, start in _arrangements(lab):
        r = np.linalg.norm(start.x[:, None] - start.x[None], axis=2)
        near = (r < CERTAIN * start.h) & ~np.eye(start.n, dtype=bool)
        counts = listed(lab.evaluated(start))
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
        Measured(0, 0, unit="pairs missing"),
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


def _missing(
    lab: Lab, where: str, start: Case, r: Array, near: NDArray[np.bool_], missing: NDArray[np.bool_]
) -> Result:
    i, j = np.argwhere(missing)[0]
    text = (
        f"{start.n} particles {where}: {int(missing.sum())} of {int(near.sum())} neighbours are "
        f"not listed, such as {j} of particle {i}, {r[i, j] / start.h:.2f} h apart"
    )
    numbers = (int(missing.sum()), 0)
    found = near & ~missing
    reach = float(r[found].max() / start.h) if found.any() else 0.0
    is_short = found.any() and reach < 0.95 and r[missing].min() > (reach - 1e-6) * start.h
    told = f"{text}; no pair beyond {reach:.2f} h is"
    if is_short and (finding := _short(lab, reach, told)):
        return finding
    return failed(
        text,
        BRUTE_FORCE + "Cells must be at least as wide as the support, all nine cells around a "
        "particle be searched, and cells of negative coordinates come from floor(), not int().",
        Measured(*numbers, unit="pairs missing"),
    )


def _short(lab: Lab, reach: float, text: str) -> Result | None:
    """Judge lists that end at `reach` [h]; None if the kernel goes on there."""
    soft = ends_softly(lab, reach)
    numbers = Measured(reach, 1.0, unit="h")
    if soft is None:
        return inconclusive(text, numbers)
    if not soft:
        return None
    return failed(
        f"{text}, and there the kernel ends as well",
        "case.h is the radius at which the kernel ends. A code whose h is the smoothing length, "
        "with kernels that end at 2 h, has to take case.h / 2 for it.",
        numbers,
        link="density",
    )


def _doubled(lab: Lab, where: str, counts: Matrix, near: NDArray[np.bool_]) -> Result:
    number = int((counts[near] > 1).sum())
    text = f"particles {where}: {number} of {int(near.sum())} neighbours are listed more than once"
    weights = pair_weights(lab)
    if weights is None or (weights.once and not weights.one_sided):
        return inconclusive(f"{text}, but the sums don't show it", Measured(number, 0))
    return failed(
        f"{text}, and the sums count them so",
        "Two of the nine cells may have the same place in a hash table: search each place once.",
        Measured(number, 0, unit="pairs doubled"),
    )
