"""What can be said of density, pressure and force if only positions and velocities are shown."""

import numpy as np

from sph_gym.doctor.case import C0, DX, RHO0, SUPPORT, Array
from sph_gym.doctor.findings import Finding, failed, inconclusive, passed, skipped
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.pair_law import CLEARLY, EXPLAINS, Law, Series, density, force, laws, scaled_law
from sph_gym.doctor.probes import (
    DISTANCES,
    STILL,
    closing,
    fluid,
    pairs,
    pairs_case,
    squeezing,
    triangles,
)
from sph_gym.doctor.registry import check

H = SUPPORT * DX
# In c0^2 / h, a force that counts as none.
_NONE = 1e-6


@check("force", step=8, needs=("isolated", "push_apart", "momentum", "isotropy"))
def pair_law(lab: Lab) -> Finding:
    """Measure the force of pairs in several cases: which densities, law and kernel explain it?"""
    if {"rho", "p"} <= lab.shown:
        return skipped("rho and p are shown: other checks have measured them")
    ratio = squeezing(lab)
    if ratio is None:
        return inconclusive("the solver takes no case in which a pair is under pressure")
    series = _measured(lab, ratio)
    if not all(np.isfinite(one.force).all() for one in series):
        return inconclusive("forces of pairs are not finite")
    # accelerations of pairs in motion belong to a time that is known to half a step only
    explains = EXPLAINS if series[0].start is None else 2 * EXPLAINS
    sound, faulty = laws(series)
    text = "forces of pairs at 28 distances, in several cases"
    if sound.error < explains:
        if series[0].start is None:
            lab.facts["law"] = sound
        return passed(f"{text}: {sound}", f"{sound}", "a sound law", tolerance="2 %")
    if faulty.fault and faulty.error < explains and sound.error > CLEARLY * explains:
        return failed(
            f"{text}: explained within {100 * faulty.error:.2g} % by {faulty}; no sound law is "
            f"nearer than {100 * sound.error:.2g} %",
            faulty.fault.remedy,
            f"{faulty}",
            "a sound law",
            tolerance="2 %",
            link=faulty.fault.link,
        )
    return _another_stiffness(series) or inconclusive(
        f"{text}: no known law explains them", f"nearest: {sound}", "a sound law"
    )


def _measured(lab: Lab, ratio: float) -> list[Series]:
    """Return forces of pairs; of triangles or of pairs in motion if nothing pushes otherwise."""
    states = ((ratio, H, C0), (ratio, H / 2, 0.6 * C0))
    series = [_series(lab, *each) for each in states]
    if _pushed(series):
        return series + [_series(lab, each, H, C0) for each in (1.3, 2.0, SUPPORT)]
    # a kernel that is too wide, or a missing share of their own, leaves pairs below rho0
    series += [_series(lab, each, H, C0, 2) for each in (ratio, 0.5)]
    if _pushed(series):
        return [*series, _series(lab, 0.5, H, C0), _series(lab, 0.5, H / 2, 0.6 * C0)]
    return [_closing_series(lab, *each) for each in states]


def _pushed(series: list[Series]) -> bool:
    return max(float(np.abs(one.force).max()) for one in series) > _NONE


def _series(lab: Lab, ratio: float, h: float, c0: float, partners: int = 1) -> Series:
    settings = fluid(h, ratio, c0)
    probe = pairs if partners == 1 else triangles
    found = probe(lab, DISTANCES, **settings)
    density = found.rho.mean(axis=1) / RHO0 if "rho" in lab.shown else None
    push = found.push.mean(axis=1) * h / c0**2
    return Series(ratio, h, c0, found.q, push, density, partners=partners)


def _closing_series(lab: Lab, ratio: float, h: float, c0: float) -> Series:
    """Return forces that arise while pairs approach each other."""
    first, last = closing(lab, DISTANCES, (1, 25), **fluid(h, ratio, c0))
    push = (last.push - first.push).mean(axis=1) * h / c0**2
    return Series(ratio, h, c0, last.q, push, None, DISTANCES, first.q)


def _another_stiffness(series: list[Series]) -> Finding | None:
    """Return that forces are as if sound had another speed, None if that doesn't explain them."""
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
        C0 * abs(ignored.scale) ** 0.5,
        C0,
        unit="m/s",
        link="pressure",
    )


@check("force", step=4, needs=("isolated", "pair_law"))
def push_in_time(lab: Lab) -> Finding:
    """Let pairs collide: are they pushed by the densities and pressures of where they are?"""
    law = lab.facts.get("law")
    if not isinstance(law, Law):
        return skipped("the law of the forces is not known")
    ratio = squeezing(lab) or 1.0
    settings = fluid(H, ratio)
    still, dt = STILL * H / C0, 0.03 * H / C0
    start = pairs_case(np.linspace(0.5, 0.8, 6), speed=1.0, **settings)
    subject = lab.make(start)
    history = [_distances(subject.x)]
    for _ in range(3):
        history.append(_distances(subject.step(dt).x))
    v, x = subject.v, subject.x
    a = (subject.step(still).v - v)[:6] / still
    d = x[:6] - x[6:12]
    push = (a * d).sum(axis=1) / np.linalg.norm(d, axis=1) * H / C0**2
    return _in_time(law, ratio, history, push)


def _distances(x: Array) -> Array:
    return np.linalg.norm(x[:6] - x[6:12], axis=1) / H


def _in_time(law: Law, ratio: float, history: list[Array], push: Array) -> Finding:
    now = history[-1]

    def by(q: Array) -> Array:
        return force(law, Series(ratio, H, C0, q, push), now)

    size = float(np.abs(by(now)).max())
    if not size:
        return inconclusive("colliding pairs came under no pressure")

    def rho(q: Array) -> Array:
        return density(law, Series(ratio, H, C0, q, push))

    last, first = by(history[-2]), by(history[0])
    # the density in p / rho^2 may be the new one, and a leapfrog's push is half of the old one
    wrong = [last, last * (rho(history[-2]) / rho(now)) ** 2, first]
    wrong += [(by(now) + each) / 2 for each in wrong]
    errors = [float(np.abs(push - each).max()) / size for each in (by(now), *wrong)]
    numbers = {"unit": "of the push", "tolerance": "5 %"}
    if errors[0] < 0.05:
        return passed("colliding pairs: densities and pressures act in time", errors[0], 0.0)
    best = int(np.argmin(errors))
    if errors[best] > 0.02 or errors[0] < 0.1:
        return inconclusive("colliding pairs: the push is no known one", errors[0], 0.0, **numbers)
    frozen = best in (3, 6)
    return failed(
        "colliding pairs are pushed by the densities "
        + ("that they had at the start" if frozen else "of one step before"),
        "Renew densities in every step, before pressures and forces."
        if frozen
        else "In every step: densities of all particles first, then pressures, then forces.",
        errors[0],
        0.0,
        link="density" if frozen else "pressure",
        **numbers,
    )
