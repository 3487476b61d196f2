"""Are densities the sums over all neighbours within the support, each counted once?"""

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor.case import DX, Array, Case, case, lattice
from sph_gym.doctor.checks.neighbours import DISTANCES, STEP, Weights, pair_weights
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, need, passed, skipped
from sph_gym.doctor.groups import respond
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import check
from sph_gym.doctor.remedies import BRUTE_FORCE

# Densities of the crowd agree with the sums over pairs so far, or clearly don't.
AGREE, DISAGREE = 0.01, 0.03
# So many particles must have their full sums before others are said to have too few.
MANY = 8
# The force of a sound pair, near its end, falls below this share within 0.0125 h.
BREAK = 0.65
LOOKS_TOO_NEAR = (
    "The search looks less far than the kernel: give it the support radius case.h, not the "
    "smoothing length."
)


@check("neighbours", step=2, needs=("order",), shows=("rho",))
def pair_sums(lab: Lab) -> Result:
    """Measure what one neighbour adds to a density, and whether many add as much each."""
    weights = pair_weights(lab)
    if weights is None:
        return skipped(
            "densities don't show what a neighbour adds: those by continuity don't, nor do those "
            "held at rho0 from below"
        )
    for judge in (_one_sided, _twice, _cut_off, _crowded):
        if finding := judge(weights):
            return finding
    share = weights.rho / weights.predicted(weights.x)
    return passed(
        f"{len(DISTANCES)} pairs and a crowd of {len(weights.x)}: densities are sums over all",
        Measured(
            float(share[np.argmax(np.abs(share - 1))]),
            1.0,
            unit="of the sum over pairs",
            tolerance=f"{AGREE}",
        ),
    )


@check("neighbours", step=2, needs=("order",))
def pair_reach(lab: Lab) -> Result:
    """Put pairs at many distances: what they feel must die away, not break off, towards h."""
    start, center, r = _spaced_pairs(lab)
    response = respond(lab, start, center)
    need(response.finite, "pairs at many distances: some accelerations are not finite")
    a = np.linalg.norm(response.a.reshape(len(r), 2, 2), axis=2).mean(axis=1)
    felt_at = np.flatnonzero(a > 1e-6 * a.max())
    need(
        a.max() > 1e-6 * start.c0**2 / start.h and len(felt_at) > 2,
        "pairs don't feel each other, at rest or in motion",
    )
    last = felt_at[-1]
    # the weak end of a kernel may be lost among what is left of pressures that cancel
    numbers = Measured(float(r[last]), 1.0, unit="h")
    if r[last] < 0.96 and a[last] > max(BREAK * a[last - 1], 1e-3 * a.max()):
        return failed(
            f"pairs at {len(r)} distances: the nearer ones push each other, still with "
            f"{a[last]:.3g} m/s^2 at {r[last]:.4g} h, but not at all from there on",
            LOOKS_TOO_NEAR,
            numbers,
        )
    return passed("what pairs feel dies away with their distance", numbers)


def _spaced_pairs(lab: Lab) -> tuple[Case, Array, Array]:
    """Return pairs of so squeezed a fluid that they feel pressure, their centres, distances [h]."""
    h = 1.05 * DX
    r = np.arange(0.2, 1.05, 0.0125)
    places = lattice(9, 8, 4 * h)[: len(r)]
    turned = lab.rng.uniform(0, 2 * np.pi, len(r))
    half = 0.5 * h * r[:, None] * np.stack([np.cos(turned), np.sin(turned)], axis=1)
    x = np.stack([places - half, places + half], axis=1).reshape(-1, 2)
    return case(x, h=h), np.repeat(places, 2, axis=0), r


def _one_sided(weights: Weights) -> Result | None:
    if not weights.one_sided:
        return None
    first, second = weights.pairs.T
    k = int(np.argmax(np.abs(first - second)))
    return failed(
        f"two particles {DISTANCES[k]} h apart: one adds {first[k]:.4g} kg/m^3 to the other, "
        f"which adds {second[k]:.4g}",
        BRUTE_FORCE + "Where pairs are listed once (i < j), both must be given their share.",
        Measured(float(min(first[k], second[k])), float(max(first[k], second[k])), unit="kg/m^3"),
    )


def _twice(weights: Weights) -> Result | None:
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
        Measured(float(ratio), 1.0, tolerance="0.06"),
    )


def _cut_off(weights: Weights) -> Result | None:
    ends, added = weights.ends, np.abs(weights.added)
    last = float(added[ends == DISTANCES][0])
    if ends > 0.96 or last < STEP * added.max():
        return None
    return failed(
        f"pairs at {len(DISTANCES)} distances: the nearer ones add to each other's densities, "
        f"{last:.3g} kg/m^3 still at {ends} h, but nothing from there on",
        LOOKS_TOO_NEAR,
        Measured(ends, 1.0, unit="h"),
    )


def _crowded(weights: Weights) -> Result | None:
    share, count = [], []
    for x, rho in ((weights.x, weights.rho), (weights.few_x, weights.few_rho)):
        share.append(rho / weights.predicted(x))
        r = np.linalg.norm(x[:, None] - x[None], axis=2)
        count.append((r < weights.h).sum(axis=1) - 1)
    shares, counts = np.concatenate(share), np.concatenate(count)
    fine, short = np.abs(shares - 1) < AGREE, shares < 1 - DISAGREE
    if fine.all():
        return None
    if not short.any() or (shares > 1 + DISAGREE).any():
        return _unclear(shares)
    few = counts < counts[short].min()
    if few.sum() < MANY or short[~few].mean() < 0.5 or _capped(weights, short):
        return _unclear(shares)
    return failed(
        f"{len(shares)} particles: densities of those with less than {counts[short].min()} "
        f"neighbours are the sums over them, but of those with more, up to {counts.max()}, a part "
        f"is missing: {100 * (1 - shares.min()):.0f} % in the worst case",
        "Lists hold too few neighbours and drop what comes after: let them grow, or stop with an "
        f"error; {counts.max()} neighbours are common.",
        Measured(float(shares.min()), 1.0, unit="of the sum over pairs", tolerance=f"{DISAGREE}"),
    )


def _capped(weights: Weights, short: NDArray[np.bool_]) -> bool:
    """Return whether densities end at one value, which is a limit of densities, not of lists."""
    rho = weights.rho[short[: len(weights.rho)]]
    return len(rho) > 1 and float(np.ptp(rho)) < 1e-6 * float(rho.max())


def _unclear(shares: Array) -> Result:
    worst = float(shares[np.argmax(np.abs(shares - 1))])
    return inconclusive(
        "densities of a crowd are not the sums of what pairs add, and not by the number of "
        "neighbours: they may be normalised",
        Measured(worst, 1.0),
    )
