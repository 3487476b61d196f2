"""Do pressures belong to the densities of the same moment?"""

import numpy as np

from sph_gym.doctor.case import C0, DX, RHO0, TAIT, Array, H, case, lattice
from sph_gym.doctor.findings import Finding, failed, inconclusive, passed, skipped
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.probes import (
    STILL,
    Seen,
    change,
    fields,
    fluid,
    friction,
    gentle,
    pairs,
    pairs_case,
    squeezing,
    tolerant,
)
from sph_gym.doctor.registry import check

_IN_TIME = (
    "Compute in this order, in every step: densities of all particles, then pressures of all, then "
    "forces. Here pressures are computed before the densities that they belong to."
)


@check("pressure", step=4, needs=("isolated", "equation_of_state"), shows=("rho", "p"))
@tolerant
def pressure_in_time(lab: Lab) -> Finding:
    """Let pairs collide: does each pressure belong to the density of the same evaluation?"""
    if lab.facts.get("density") != "summation":
        return skipped("densities are no sums over positions")
    if "evaluate" in lab.shown:
        found = _evaluated_twice(lab)
        if found:
            return found
    return _after_motion(lab)


def _evaluated_twice(lab: Lab) -> Finding | None:
    """Return that a second evaluation gives other pressures, None if it doesn't."""
    x = lattice(5, 5, 0.8 * DX, center=(1.0, 1.1))
    subject = lab.make(case(x)).evaluate()
    rho, p = subject.get("rho"), subject.get("p")
    subject.evaluate()
    again, after = subject.get("rho"), subject.get("p")
    size = np.abs(after).max()
    if (
        size == 0
        or np.abs(after - p).max() < 0.01 * size
        or np.abs(again - rho).max() > 1e-4 * RHO0
    ):
        return None
    return failed(
        "a squeezed cloud evaluated twice: densities stay, pressures change",
        _IN_TIME,
        float(np.abs(after - p).max() / size),
        0.0,
        unit="of the largest pressure",
    )


def _after_motion(lab: Lab) -> Finding:
    """Return whether pairs that moved are pushed by the pressures of where they are now."""
    ratio = squeezing(lab)
    if ratio is None:
        return inconclusive("the solver takes no case in which a pair is under pressure")
    q = np.linspace(0.6, 0.9, 6)
    ratio = gentle(lab, lambda each: pairs(lab, q, **fluid(H, each)).rho / RHO0)
    settings = fluid(H, ratio)
    still = 100 * STILL * H / C0
    subject = lab.make(pairs_case(q, speed=2.0, **settings))
    before = subject.step(0.03 * H / C0, 2).x
    subject.step(0.03 * H / C0)
    x, v = subject.x, subject.v
    rubbed = friction(lab, x, v, **settings)
    # what lags behind is in time when particles have stood still for two steps
    a, _, settled = (change(subject, still, n) - rubbed for n in (1, 2, 1))
    # a scheme may evaluate in the middle of a step
    places = (x, before, (x + before) / 2)
    return _in_time(a, settled, *(fields(lab, case(where, **settings)) for where in places))


def _in_time(a: Array, settled: Array, now: Seen, *earlier: Seen) -> Finding:
    """Return which pressures made the accelerations a.

    settled: accelerations when particles stand still; earlier: moments of the step before.
    """
    pushed = now.p > 1e-3 * TAIT
    size = float(np.abs(now.a).max())
    if not pushed.any() or not size:
        return inconclusive("colliding pairs came under no pressure")

    def error(*models: Array) -> float:
        return min(float(np.abs(a - model)[pushed].max()) for model in models) / size

    late = []
    for old in earlier:
        share = np.where(pushed, old.p, 0.0) / np.where(pushed, now.p, 1.0)
        late += [share, share * (now.rho / old.rho) ** 2]
    # a leapfrog's step is half of the old push and half of the new one
    late += [(1 + each) / 2 for each in late]
    right, whole = error(now.a), error(*(old.a for old in earlier))
    wrong = error(*(each[:, None] * now.a for each in late))
    numbers = {"unit": "of the push", "tolerance": "5 %"}
    if right < 0.05:
        return passed("colliding pairs: pressures act in time", right, 0.0, **numbers)
    cured = float(np.abs(settled - now.a)[pushed].max()) < 0.05 * size
    if cured and right > 0.1 and wrong < min(0.2 * right, whole):
        what = "colliding pairs are pushed by the pressures of one step before"
        return failed(what, _IN_TIME, right, 0.0, **numbers)
    return inconclusive("colliding pairs: the push is no known one", right, 0.0, **numbers)
