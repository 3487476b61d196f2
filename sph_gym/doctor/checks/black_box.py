"""Judge density, pressure and force of solvers that show only positions and velocities."""

import numpy as np

from sph_gym.doctor.case import C0, RHO0, SUPPORT, Array, H, all_finite, case, lattice
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, need, passed, skipped
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.pair_law import (
    CLEARLY,
    EXPLAINS,
    FAR,
    ROUNDING,
    FittedPairLaw,
    PairForces,
    density,
    force,
    laws,
    scaled_law,
)
from sph_gym.doctor.probes import (
    COLLIDING,
    DISTANCES,
    STILL,
    closing,
    collide,
    fields,
    fluid,
    gentle,
    pairs,
    pairs_case,
    squeezing,
    takes,
    triangles,
)
from sph_gym.doctor.registry import check
from sph_gym.doctor.remedies import RENEW

_IN_ORDER = "In every step: densities of all particles first, then pressures, then forces."
# In c0^2 / h, a force that counts as none, and one that counts as a push.
_NONE, _PUSH = 2 * ROUNDING, 2e-2


@check("force", step=4, needs=("isolated",), may_refuse=True)
def steady(lab: Lab) -> Result:
    """Let squeezed pairs stand still for 30 tiny steps: do forces stay what they are?"""
    ratio = squeezing(lab)
    if ratio is None:
        return inconclusive("the solver takes no case in which a pair is under pressure")
    start = pairs_case(np.array([0.3, 0.5, 0.7]), **fluid(H, ratio))
    dt = 0.03 * STILL * H / C0
    subject = lab.make(start)
    speeds = [subject.step(dt, n).v for n in (4, 2, 22, 2)]
    early, late = speeds[1] - speeds[0], speeds[3] - speeds[2]
    size = float(np.abs(early).max())
    if not np.isfinite(late).all() or not size:
        return skipped("squeezed pairs at rest are not pushed")
    growth = float(np.abs(late).max()) / size
    # speeds that are damped in each step change a little, which is no matter of forces
    if growth < 3:
        return passed(
            "squeezed pairs at rest for 30 tiny steps: growth of forces", Measured(growth, 1.0)
        )
    return failed(
        "squeezed pairs at rest for 30 tiny steps: forces grow although no particle moves",
        "Set densities, and then accelerations, to zero before each sum: here they pile up.",
        Measured(growth, 1.0, tolerance="a factor of 3"),
        link="density",
    )


@check("force", step=8, needs=("isolated", "push_apart", "momentum", "isotropy"), may_refuse=True)
def pair_law(lab: Lab) -> Result:
    """Measure the force of pairs in several cases: which densities, law and kernel explain it?"""
    if {"rho", "p"} <= lab.shown:
        return skipped("rho and p are shown: other checks have measured them")
    ratio = squeezing(lab)
    if ratio is None:
        return inconclusive("the solver takes no case in which a pair is under pressure")
    series = _measured(lab, ratio)
    need(all_finite(*(one.force for one in series)), "forces of pairs are not finite")
    least = _NONE if series[0].start is None else 1e-2 * _NONE
    if sum(int((np.abs(one.force) > least).sum()) for one in series) < 10:
        return inconclusive("too few pairs push or pull each other")
    return _explained(lab, series)


def _explained(lab: Lab, series: list[PairForces]) -> Result:
    """Return which law explains the forces of pairs."""
    moving = series[0].start is not None
    # accelerations of pairs in motion belong to a time that is known to half a step only
    explains = 2 * EXPLAINS if moving else EXPLAINS
    sound, faulty = laws(series)
    text = "forces of pairs at 28 distances, in several cases"
    if sound.error < explains:
        if not moving:
            lab.facts["law"] = sound
        return passed(f"{text}: {sound}", Measured(f"{sound}", "a sound law", tolerance="2 %"))
    far = max(CLEARLY * faulty.error, FAR)
    if faulty.fault and faulty.error < explains and sound.error > far:
        return failed(
            f"{text}: explained within {100 * faulty.error:.2g} % by {faulty}; no sound law is "
            f"nearer than {100 * sound.error:.2g} %",
            faulty.fault.remedy,
            Measured(f"{faulty}", "a sound law", tolerance="2 %"),
            link=faulty.fault.link,
        )
    return _another_stiffness(series) or inconclusive(
        f"{text}: no known law explains them", Measured(f"nearest: {sound}", "a sound law")
    )


def _measured(lab: Lab, ratio: float) -> list[PairForces]:
    """Return forces of pairs; of triangles or of pairs in motion if nothing pushes otherwise."""
    states = ((ratio, H, C0), (ratio, H / 2, 0.6 * C0))
    series = [_series(lab, *each) for each in states]
    series += [_series(lab, each, H, C0) for each in (1.3, 2.0, SUPPORT)]
    if _pushed(series):
        return series
    # a kernel that is too wide, or a missing share of their own, leaves pairs below rho0
    series.append(_series(lab, ratio, H, C0, 2))
    if takes(lab, 0.5):
        series += [_series(lab, 0.5, *each) for each in ((H, C0), (H / 2, 0.6 * C0), (H, C0, 2))]
    if _pushed(series):
        return series
    return [_closing_series(lab, *each) for each in states]


def _pushed(series: list[PairForces]) -> bool:
    return max(float(np.abs(one.force).max()) for one in series) > _NONE


def _series(lab: Lab, ratio: float, h: float, c0: float, partners: int = 1) -> PairForces:
    settings = fluid(h, ratio, c0)
    probe = pairs if partners == 1 else triangles
    found = probe(lab, DISTANCES, **settings)
    density = found.rho.mean(axis=1) / RHO0 if "rho" in lab.shown else None
    push = found.push.mean(axis=1) * h / c0**2
    return PairForces(ratio, h, c0, found.q, push, density, partners=partners)


def _closing_series(lab: Lab, ratio: float, h: float, c0: float) -> PairForces:
    """Return forces that arise while pairs approach each other."""
    first, *later = closing(lab, DISTANCES, (1, 20, 50), 0.3, **fluid(h, ratio, c0))
    # of a stiff fluid, the half step between x and a would count when pairs rebound
    last = later[-1] if later[-1].closing.min() > 0.5 * first.closing.max() else later[0]
    push = (last.push - first.push).mean(axis=1) * h / c0**2
    return PairForces(ratio, h, c0, last.q, push, None, DISTANCES, first.q)


def _another_stiffness(series: list[PairForces]) -> Result | None:
    """Return that forces are as if sound had another speed, None if that doesn't explain them."""
    if series[0].start is not None or not _pushed(series):
        return None
    law = scaled_law(series)
    ignored = scaled_law([one._replace(force=one.force * (one.c0 / C0) ** 2) for one in series])
    cause = "B = rho0 c0^2 / gamma goes with the square of case.c0; here it does not."
    if law.error < ignored.error:
        ignored = law
        cause = f"All forces are {law.scale:.3g} times what B = rho0 c0^2 / gamma makes them."
    if ignored.error > EXPLAINS or 0.4 < ignored.scale < 1.3:
        return None
    return failed(
        "forces of pairs at 28 distances, in several cases: those of another speed of sound",
        cause + " Take the stiffness from case.c0, case.rho0 and case.gamma.",
        Measured(C0 * abs(ignored.scale) ** 0.5, C0, unit="m/s"),
        link="pressure",
    )


@check("density", step=4, needs=("isolated", "pair_law"), may_refuse=True)
def rest_spacing(lab: Lab) -> Result:
    """Set up lattices at rest, close and wide: is it near dx that they begin to push?"""
    if "rho" in lab.shown:
        return skipped("rho is shown: other checks have measured it")
    if "law" in lab.facts:
        return skipped("forces of pairs tell that densities are right")
    for h in (H, H / 2):
        out = {each: _outward(lab, h, each) for each in (0.3, 0.75, 1.3)}
        if out[0.3] < _PUSH:
            return inconclusive("no lattice at rest pushes: densities don't react on positions")
        if out[0.75] < _PUSH:
            what, limit = "does not push: densities are too small by a factor of 2 or more", 0.75
        elif out[1.3] > _PUSH:
            what, limit = "pushes: densities are too large by a factor of 1.7 or more", 1.3
        else:
            continue
        far = pairs(lab, np.array([0.3, 0.5, 0.7]), **fluid(h))
        if far.push.max() * h / C0**2 > _PUSH:
            return inconclusive(
                "pairs far apart push each other: density or pressure", Measured(limit, 1.0)
            )
        return failed(
            f"a lattice of 7 x 7 at rest with {limit:g} of the spacing dx {what}",
            "Check the mass, rho0 dx^2 in 2D, the constant of the kernel, and that h is its "
            "support radius.",
            Measured(f"{'below' if limit < 1 else 'above'} {limit:g}", "about 1", "dx"),
        )
    return passed(
        "lattices push from about the spacing dx on", Measured("0.75 to 1.3", "about 1", "dx")
    )


def _outward(lab: Lab, h: float, spacing: float) -> float:
    """Return the mean push outwards [c0^2/h] in a lattice at rest with `spacing` dx."""
    settings = fluid(h)
    x = lattice(7, 7, spacing * settings["dx"], center=(1.0, 1.1))
    arm = x - x.mean(axis=0)
    a = fields(lab, case(x, **settings)).a
    return float((a * arm).sum() / np.linalg.norm(arm, axis=1).sum()) * h / C0**2


@check("force", step=4, needs=("isolated", "momentum_in_motion", "pair_law"), may_refuse=True)
def push_in_time(lab: Lab) -> Result:
    """Let pairs collide: are they pushed by the densities and pressures of where they are?"""
    law = lab.facts.get("law")
    if not isinstance(law, FittedPairLaw):
        return skipped("the law of the forces is not known")
    ratio = gentle(lab, lambda each: density(law, _at(lab, each, COLLIDING)))
    found, n = collide(lab, **fluid(H, ratio)), len(COLLIDING)
    d = found.x[:, :n] - found.x[:, n : 2 * n]
    r = np.linalg.norm(d, axis=2)
    along = d[-1] / r[-1][:, None]
    push, settled = ((a[:n] * along).sum(axis=1) * H / C0**2 for a in (found.a, found.settled))
    first, _, last, now = r / H
    # a scheme may evaluate in the middle of a step
    moments = (_at(lab, ratio, each) for each in (now, first, last, (now + last) / 2))
    return _in_time(law, push, settled, *moments)


def _at(lab: Lab, ratio: float, q: Array) -> PairForces:
    """Return pairs at the distances q, with their densities if these are shown."""
    one = PairForces(ratio, H, C0, q, q)
    if "rho" not in lab.shown:
        return one
    return one._replace(density=pairs(lab, q, **fluid(H, ratio)).rho.mean(axis=1) / RHO0)


def _in_time(
    law: FittedPairLaw,
    push: Array,
    settled: Array,
    now: PairForces,
    start: PairForces,
    *lasts: PairForces,
) -> Result:
    """Return of which moment the densities are that made the push (k,) of colliding pairs.

    settled: the push when they stand still; lasts: moments of the step before.
    """

    def errors(*models: Array) -> float:
        return min(float(np.abs(push - each).max()) for each in models) / size

    right, first, *late = (force(law, each, now.q) for each in (now, start, *lasts))
    size = float(np.abs(right).max())
    need(size, "colliding pairs came under no pressure")
    # the density in p / rho^2 may be the new one, and a leapfrog's push is half of the old one
    late += [
        force(law, each, now.q) * (density(law, each) / density(law, now)) ** 2 for each in lasts
    ]
    # where slopes are as old as densities, accelerations are late: the check of the scheme judges
    before = (force(law, each, each.q) for each in (start, *lasts))
    off, whole = errors(right), errors(*before)
    lagging = errors(*late, *((each + right) / 2 for each in late))
    frozen = errors(first, (first + right) / 2)
    numbers = Measured(off, 0.0, "of the push", "5 %")
    if off < 0.05:
        return passed("colliding pairs: densities act in time", numbers)
    best = min(lagging if np.abs(settled - right).max() < 0.05 * size else np.inf, frozen)
    if best > min(0.02, whole) or off < 0.1:
        return inconclusive("colliding pairs: the push is no known one", numbers)
    what = "colliding pairs are pushed by the densities of "
    if frozen == best:
        return failed(what + "the start", RENEW, numbers, link="density")
    return failed(what + "one step before", _IN_ORDER, numbers, link="pressure")
