"""Is the pressure the one that the equation of state gives for the *measured* density, in time?"""

from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import C0, DX, GAMMA, RHO0, TAIT, Array, Case, H, all_finite, case, lattice
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, need, passed, skipped
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.probes import (
    COLLIDING,
    STILL,
    Seen,
    collide,
    fields,
    fluid,
    gentle,
    pairs,
    pairs_case,
    squeezing,
)
from sph_gym.doctor.registry import check
from sph_gym.doctor.remedies import CLAMP, TAIT_EQUATION


class PressureFit(NamedTuple):
    """p = stiffness ((rho / rho0)^gamma - 1) + offset; error: as a share of the largest p."""

    stiffness: float
    gamma: float
    offset: float
    error: float


@check("pressure", step=6, needs=("isolated",), shows=("rho", "p"), may_refuse=True)
def equation_of_state(lab: Lab) -> Result:
    """Squeeze a cloud: are pressures Tait's for the measured densities?"""
    rho, p = _samples(lab)
    if not all_finite(rho, p):
        return failed(
            "a squeezed cloud: p is not finite", TAIT_EQUATION, Measured("not finite", "finite")
        )
    dense = rho > 1.005 * RHO0
    if dense.sum() < 8:
        return inconclusive(
            "no cloud could be squeezed above rho0", Measured(float(rho.max() / RHO0), 1.0)
        )
    if not np.any(p[dense] > 0):
        return failed(
            "a squeezed cloud: no pressure is above zero although densities are above rho0",
            f"{CLAMP} Check that it isn't min(0, p), and that p is computed after rho. "
            + TAIT_EQUATION,
            Measured(float(p[dense].max()), "above 0", unit="Pa"),
        )
    return _judge(lab, _fit(rho[dense] / RHO0, p[dense]))


def _samples(lab: Lab) -> tuple[Array, Array]:
    """Return densities and pressures of clouds in several states, also below rho0."""
    found = []
    for spacing in (0.97, 0.88, 0.75):
        x = lattice(7, 7, spacing * DX, center=(1.0, 1.1))
        x += lab.rng.uniform(-0.08, 0.08, x.shape) * DX
        found.append(fields(lab, case(x)))
    if all(np.ptp(each.rho) < 1e-6 * np.abs(each.rho).max() for each in found):
        found = [_flown_together(lab, n) for n in (20, 40)]
    rho = np.concatenate([each.rho for each in found])
    p = np.concatenate([each.p for each in found])
    return rho, p


def _flown_together(lab: Lab, n_steps: int) -> Seen:
    """Return densities and pressures of a cloud that contracts, for densities by continuity."""
    x = lattice(9, 9, DX, center=(1.0, 1.1))
    start = case(x, -0.6 * C0 * (x - x.mean(axis=0)) / H * 0.5)
    subject = lab.make(start).step(0.02 * H / C0, n_steps)
    if "evaluate" in lab.shown:
        subject.evaluate()
    else:
        # the last evaluation may have been before densities were changed: stand still
        subject.step(STILL * H / C0, 2)
    return Seen(subject.get("rho"), subject.get("p"), np.empty((0, 2)))


def _fit(ratio: Array, p: Array) -> PressureFit:
    """Return the law that fits p best; ratio: rho / rho0."""
    best = PressureFit(0.0, 0.0, 0.0, np.inf)
    size = np.abs(p).max()
    # relative errors count: without weights, the largest pressures alone would decide
    weight = 1 / (np.abs(p) + 0.02 * size)
    for gamma in np.arange(0.5, 12.01, 0.05):
        columns = np.stack([ratio**gamma - 1, np.ones_like(p)], axis=1)
        (b, offset), *_ = np.linalg.lstsq(columns * weight[:, None], p * weight, rcond=None)
        error = float(np.abs((columns @ (b, offset) - p) * weight).max())
        if error < best.error:
            best = PressureFit(float(b), float(gamma), float(offset), error)
    return best


def _judge(lab: Lab, law: PressureFit) -> Result:
    numbers = Measured(
        f"B = {law.stiffness:.4g}, gamma = {law.gamma:.3g}",
        f"B = {TAIT:.4g}, gamma = {GAMMA:g}",
        "Pa",
        "3 % of B, 0.1 of gamma",
    )
    if law.error > 0.03:
        return inconclusive("a squeezed cloud: p is no power law of rho", numbers.bare)
    share = law.stiffness * law.gamma / (TAIT * GAMMA)
    off = abs(law.offset) > 0.05 * abs(law.stiffness) * law.gamma
    if abs(law.gamma - 1) < 0.1 and GAMMA > 1.5:
        return failed(
            f"a squeezed cloud: p = {share * C0**2:.4g} (rho - rho0), the linear gas law",
            "The linear law hardly resists strong compression: the fluid bounces like a gas. "
            + TAIT_EQUATION,
            numbers,
        )
    if abs(law.gamma - GAMMA) > 0.1:
        return failed(
            "a squeezed cloud: p against rho has another exponent",
            f"{TAIT_EQUATION} The exponent here is {law.gamma:.3g}.",
            numbers,
        )
    if abs(share - 1) < 0.03 and not off:
        return passed("a squeezed cloud: Tait's equation", numbers)
    if abs(law.offset / law.stiffness - 1) < 0.05:
        return failed(
            f"a squeezed cloud: p = {law.offset:.3g} Pa at rho0, where it should be 0: that is B",
            "The - 1 of Tait's equation is missing, so that fluid at rest is under pressure. "
            + TAIT_EQUATION,
            numbers,
        )
    if off:
        return inconclusive(f"a squeezed cloud: p = {law.offset:.3g} Pa at rho0", numbers)
    return _stiffness(lab, share, numbers)


def _stiffness(lab: Lab, share: float, numbers: Measured) -> Result:
    """Return whether a stiffness that isn't rho0 c0^2 / gamma is a fault."""
    subject = lab.make(case(lattice(3, 3)))
    c0 = subject.number("c0") if "c0" in lab.shown else None
    told = subject.number("stiffness") if "stiffness" in lab.shown else None
    if c0 and abs(share * (C0 / c0) ** 2 - 1) < 0.03:
        return passed(f"Tait's equation with the solver's own c0 = {c0:g} m/s", numbers.bare)
    known = next((n for n in (GAMMA, 1 / GAMMA) if abs(share / n - 1) < 0.03), None)
    # its own stiffness is legal, unless it also says that sound is as fast as the case wants it
    excused = told and abs(share * TAIT / told - 1) < 0.03 and not (c0 and abs(c0 / C0 - 1) < 0.03)
    if known is None and excused:
        return inconclusive("Tait's equation with a stiffness of the solver's own", numbers.bare)
    cause = {
        GAMMA: "B lacks the division by gamma: it is rho0 c0^2, sound is sqrt(gamma) times faster, "
        "and time steps for c0 are too long. ",
        1 / GAMMA: "B is divided by gamma twice: sound is sqrt(gamma) times slower. ",
    }.get(known or 0.0, f"B is {share:.3g} times as large as case.c0 makes it. ")
    return failed("a squeezed cloud: the stiffness B", cause + TAIT_EQUATION, numbers)


@check("pressure", step=5, needs=("isolated",), shows=("rho", "p"), may_refuse=True)
def clamp(lab: Lab) -> Result:
    """Look at pairs far below rho0: do pressures below zero pull them together?"""
    if lab.facts.get("density") == "continuity":
        return skipped("densities by continuity don't fall at a free surface")
    q = np.array([0.3, 0.5, 0.7])
    start = pairs_case(q, **fluid(H))
    found = fields(lab, start)
    thin = found.rho < 0.98 * RHO0
    need(thin.any(), "no density below rho0 could be had", Measured(float(found.rho.min()), RHO0))
    lowest, highest = float(found.p[thin].min()), float(found.p[thin].max())
    at_rest = np.median(np.abs(fields(lab, case(lattice(9, 9, center=(1.0, 1.1)))).p))
    if highest > max(0.1 * TAIT, 2 * float(at_rest)):
        return failed(
            "pairs far below rho0 are under more pressure than a lattice at rest",
            CLAMP + " |p| or rho0 / rho instead of rho / rho0 push thin fluid apart.",
            Measured(highest, "0", unit="Pa"),
        )
    numbers = Measured(lowest, "not below 0", unit="Pa")
    if lowest >= -1e-6 * TAIT:
        return passed("pairs far below rho0", numbers)
    pull = _pull(start, found.a, len(q))
    if pull < 0.01 * C0**2 / H:
        return passed(
            "pairs far below rho0: p is below zero but does not act", Measured(lowest, 0.0)
        )
    return failed(
        "pairs far below rho0: pressures below zero pull them together",
        CLAMP + " At a free surface half of the neighbours are missing, densities read low, and "
        "the fluid curdles into clumps.",
        numbers,
    )


def _pull(start: Case, a: Array, n: int) -> float:
    """Return the largest acceleration [m/s^2] of a pair's first partner towards the second."""
    d = start.x[:n] - start.x[n : 2 * n]
    return float(-(a[:n] * d / np.linalg.norm(d, axis=1)[:, None]).sum(axis=1).min())


_IN_TIME = (
    "Compute in this order, in every step: densities of all particles, then pressures of all, then "
    "forces. Here pressures are computed before the densities that they belong to."
)


@check(
    "pressure", step=4, needs=("isolated", "equation_of_state"), shows=("rho", "p"), may_refuse=True
)
def pressure_in_time(lab: Lab) -> Result:
    """Let pairs collide: does each pressure belong to the density of the same evaluation?"""
    if lab.facts.get("density") != "summation":
        return skipped("densities are no sums over positions")
    if "evaluate" in lab.shown and (found := _evaluated_twice(lab)):
        return found
    return _after_motion(lab)


def _evaluated_twice(lab: Lab) -> Result | None:
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
        Measured(float(np.abs(after - p).max() / size), 0.0, unit="of the largest pressure"),
    )


def _after_motion(lab: Lab) -> Result:
    """Return whether pairs that moved are pushed by the pressures of where they are now."""
    ratio = squeezing(lab)
    if ratio is None:
        return inconclusive("the solver takes no case in which a pair is under pressure")
    ratio = gentle(lab, lambda each: pairs(lab, COLLIDING, **fluid(H, each)).rho / RHO0)
    settings = fluid(H, ratio)
    found = collide(lab, **settings)
    before, x = found.x[-2:]
    # a scheme may evaluate in the middle of a step
    places = (x, before, (x + before) / 2)
    seen = (fields(lab, case(where, **settings)) for where in places)
    return _in_time(found.a, found.settled, *seen)


def _in_time(a: Array, settled: Array, now: Seen, *earlier: Seen) -> Result:
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
    numbers = Measured(right, 0.0, "of the push", "5 %")
    if right < 0.05:
        return passed("colliding pairs: pressures act in time", numbers)
    cured = float(np.abs(settled - now.a)[pushed].max()) < 0.05 * size
    if cured and right > 0.1 and wrong < min(0.2 * right, whole):
        what = "colliding pairs are pushed by the pressures of one step before"
        return failed(what, _IN_TIME, numbers)
    return inconclusive("colliding pairs: the push is no known one", numbers)
