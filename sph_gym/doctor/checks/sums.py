"""Are densities the sums over all neighbours within the support, each counted once?"""

import numpy as np

from sph_gym.doctor.case import Array
from sph_gym.doctor.checks.neighbours import BRUTE_FORCE
from sph_gym.doctor.findings import Finding, failed, inconclusive, passed, skipped
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import check
from sph_gym.doctor.weights import DISTANCES, STEP, Weights, pair_weights

# Densities of the crowd agree with the sums over pairs so far, or clearly don't.
AGREE, DISAGREE = 0.01, 0.03


@check("neighbours", step=2, needs=("order",), shows=("rho",))
def pair_sums(lab: Lab) -> Finding:
    """Measure what one neighbour adds to a density, and whether many add as much each."""
    weights = pair_weights(lab)
    if weights is None:
        return skipped(
            "densities don't show what a neighbour adds: those by continuity don't, nor do those "
            "held at rho0 from below"
        )
    for judge in (_one_sided, _twice, _cut_off, _crowded):
        finding = judge(weights)
        if finding:
            return finding
    share = weights.rho / weights.predicted(weights.x)
    return passed(
        f"{len(DISTANCES)} pairs and a crowd of {len(weights.x)}: densities are sums over all",
        float(share[np.argmax(np.abs(share - 1))]),
        1.0,
        unit="of the sum over pairs",
        tolerance=f"{AGREE}",
    )


def _one_sided(weights: Weights) -> Finding | None:
    if not weights.one_sided:
        return None
    first, second = weights.pairs.T
    k = int(np.argmax(np.abs(first - second)))
    return failed(
        f"two particles {DISTANCES[k]} h apart: one adds {first[k]:.4g} kg/m^3 to the other, "
        f"which adds {second[k]:.4g}",
        BRUTE_FORCE + "Where pairs are listed once (i < j), both must be given their share.",
        float(min(first[k], second[k])),
        float(max(first[k], second[k])),
        unit="kg/m^3",
    )


def _twice(weights: Weights) -> Finding | None:
    """Judge the nearest pair: what it adds is what a particle adds to itself."""
    if not weights.alone > 0:
        return None
    ratio = weights.added[0] / weights.alone
    if abs(ratio - 2) > 0.06:
        return None
    return failed(
        f"two particles {DISTANCES[0]} h apart: the other adds {ratio:.3g} times of what a "
        "particle adds to itself",
        "Each pair is counted twice: loop over i and over the neighbours of i, or over pairs with "
        "i < j and give both their share, but not both.",
        float(ratio),
        1.0,
        tolerance="0.06",
    )


def _cut_off(weights: Weights) -> Finding | None:
    ends, added = weights.ends, np.abs(weights.added)
    last = float(added[ends == DISTANCES][0])
    if ends > 0.96 or last < STEP * added.max():
        return None
    return failed(
        f"pairs at {len(DISTANCES)} distances: the nearer ones add to each other's densities, "
        f"{last:.3g} kg/m^3 still at {ends} h, but nothing from there on",
        "The search looks less far than the kernel: give it the support radius case.h, not the "
        "smoothing length.",
        ends,
        1.0,
        unit="h",
    )


def _crowded(weights: Weights) -> Finding | None:
    share, count = [], []
    for x, rho in ((weights.x, weights.rho), (weights.few_x, weights.few_rho)):
        share.append(rho / weights.predicted(x))
        r = np.linalg.norm(x[:, None] - x[None], axis=2)
        count.append((r < weights.h).sum(axis=1) - 1)
    shares, counts = np.concatenate(share), np.concatenate(count)
    fine, short = np.abs(shares - 1) < AGREE, shares < 1 - DISAGREE
    if fine.all():
        return None
    if not (short.any() and fine.any()) or counts[fine].max() > counts[short].min() + 1:
        return _unclear(shares)
    if (shares > 1 + DISAGREE).any() or _capped(weights.rho[short[: len(weights.rho)]]):
        return _unclear(shares)
    return failed(
        f"{len(shares)} particles: densities of those with few neighbours, up to "
        f"{counts[fine].max()}, are the sums over them, but of those with more, up to "
        f"{counts.max()}, a part is missing: {100 * (1 - shares.min()):.0f} % in the worst case",
        "Lists hold too few neighbours and drop what comes after: let them grow, or stop with an "
        f"error; {counts.max()} neighbours are common.",
        float(shares.min()),
        1.0,
        unit="of the sum over pairs",
        tolerance=f"{DISAGREE}",
    )


def _capped(rho: Array) -> bool:
    """Return whether densities end at one value, which is a limit of densities, not of lists."""
    return len(rho) > 1 and np.ptp(rho) < 1e-6 * rho.max()


def _unclear(shares: Array) -> Finding:
    worst = float(shares[np.argmax(np.abs(shares - 1))])
    return inconclusive(
        "densities of a crowd are not the sums of what pairs add, and not by the number of "
        "neighbours: they may be normalised",
        worst,
        1.0,
    )
