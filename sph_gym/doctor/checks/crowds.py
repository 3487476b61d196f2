"""Do particles at one place, or in a crowd, stay finite?"""

import numpy as np

from sph_gym.doctor.case import C0, DX, Array, Case, H, case, lattice
from sph_gym.doctor.checks.force import LISTS
from sph_gym.doctor.findings import Finding, failed, passed
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.laws import MeasuredWeights
from sph_gym.doctor.probes import STILL, cluster, fields, not_finite, tolerant
from sph_gym.doctor.registry import check

_TOUCH = (
    "Skip pairs nearer than some 1e-6 h when the direction (x_i - x_j) / r is formed; their "
    "share of the density stays."
)


@check("force", step=3, needs=("isolated",))
@tolerant
def coincident(lab: Lab) -> Finding:
    """Put two particles at one place, alone and in a blob: does everything stay finite?"""
    blob = lattice(5, 5, DX, center=(1.0, 1.1))
    dense = lattice(5, 5, 0.85 * DX, center=(1.0, 1.1))
    cases = [case([*each, each[12]]) for each in (blob, dense)]
    speeds = [_speed_after(lab, each) for each in cases]
    if not np.isfinite(speeds).all():
        remedy = _TOUCH
        return failed(
            "two particles at one place: not finite after 7 steps", remedy, "not finite", "finite"
        )
    fastest = speeds[0]
    if fastest > max(5, 10 * _speed_after(lab, case(blob))):
        return failed(
            "two particles at one place in a blob at rest fly off",
            _TOUCH + " A division by r^2, or by a tiny r that stands for zero, has this effect.",
            fastest,
            "below 5",
            unit="c0",
        )
    return passed("two particles at one place, in a blob at rest", fastest, "below 5", unit="c0")


def _speed_after(lab: Lab, start: Case) -> float:
    """Return the largest speed [c0] after some steps, NaN if x or v is not finite."""
    subject = lab.make(start).step(STILL * H / C0, 2).step(0.5 * start.dt, 5)
    return float(np.abs([subject.v / C0, 0 * subject.x]).max())


@check("force", step=4, needs=("isolated", "kernel", "interior_density"))
@tolerant
def dense_group(lab: Lab) -> Finding:
    """Crowd 40 particles into one place: are densities their sums, and all finite?"""
    x = cluster(40, 0.6 * H, lab.rng, least=0.03) + np.array([1.0, 1.1])
    start = case(x)
    found = fields(lab, start)
    if not np.isfinite(found.a).all():
        return not_finite(lab, found, "40 particles within a circle of 0.6 h", _TOUCH)
    weights = lab.facts.get("weight")
    few = x[:3]
    if (
        not isinstance(weights, MeasuredWeights)
        or not _same(weights, start)
        or np.abs(_shares(lab, weights, few) - 1).max() > 0.02
    ):
        return passed("40 particles within a circle of 0.6 h: all finite")
    share = _shares(lab, weights, x)
    worst = float(share[np.argmax(np.abs(share - 1))])
    numbers = {"unit": "of the sum over pairs", "tolerance": "5 %"}
    text = "40 particles within a circle of 0.6 h: density"
    if 0.95 < worst < 1.05 or np.ptp(share) < 0.02:
        return passed(text, worst, 1.0, **numbers)
    remedy = LISTS + " Lists of a fixed length must be long enough for a crowd."
    return failed(text, remedy, worst, 1.0, link="neighbours", **numbers)


def _shares(lab: Lab, weights: MeasuredWeights, x: Array) -> Array:
    """Return densities (n,) as shares of the sums over pairs."""
    r = np.linalg.norm(x[:, None] - x[None], axis=2)
    np.fill_diagonal(r, np.inf)
    return np.asarray(fields(lab, case(x)).rho / (weights.own + weights(r).sum(axis=1)))


def _same(weights: MeasuredWeights, start: Case) -> bool:
    return weights.settings["h"] == start.h and weights.settings["dx"] == start.dx
