"""Do particles that come from afar find each other, or are lists of neighbours out of date?"""

from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import C0, DX, SUPPORT, Array, Case, all_finite, case, lattice
from sph_gym.doctor.checks.neighbours import listed
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, need, passed
from sph_gym.doctor.groups import at_rest, difference, felt, present, spread
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import check
from sph_gym.doctor.remedies import BRUTE_FORCE
from sph_gym.doctor.subject import SolverUnderTest

# Speed [c0] with which two groups approach each other, and with which both drift aside.
SPEED, DRIFT = 0.2, 0.1
# A step [h / c0]: two groups come nearer by 0.04 h.
STEP = 0.2
# Gap between the groups at the start [h], beyond the margin of lists; steps after which they are
# looked at, from 0.74 h to next to each other. Not evenly, as lists may be renewed at intervals.
GAP = 1.3
LOOKS = (14, 17, 19, 22, 25, 27, 30, 33)
# A running solver may differ from a new one by so much, as a share of the largest: a group that
# was together from the start; two that came from afar, for a pass; and for no fault, as lists with
# a margin that are renewed at intervals get there in such long steps.
KNOWN, NEWCOMERS, LATE = 0.02, 0.06, 0.2
# The long way: speed [c0], and steps of `Case.dt`, which make 10 h.
_FAST, _LONG_STEPS = 0.5, 200
# Pairs nearer than this [h] must be listed, by such lists too.
CLOSE = 0.75


class FreshComparison(NamedTuple):
    """Comparison of a running solver with a new one of the same positions and velocities.

    step, now: shares by which changes of v in a usual step and in tiny steps differ, the latter
    with the densities; felt: whether particles feel anything; unlisted: pairs missing in lists.
    """

    step: float
    now: float
    felt: bool
    unlisted: int


@check("neighbours", step=2, needs=("order", "flight"))
def long_way(lab: Lab) -> Result:
    """Let lone particles fly far from where they began: the search must follow them."""
    angle = 2 * np.pi * np.arange(8) / 8 + 0.2
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    start = case(3 * SUPPORT * DX * along, _FAST * C0 * along)
    way = _FAST * C0 * start.dt * _LONG_STEPS
    subject = lab.make(start).step(start.dt, _LONG_STEPS)
    share = float(((subject.x - start.x) * along).sum(axis=1).mean() / way)
    told = f"eight lone particles fly {way / start.h:.0f} h outwards"
    numbers = Measured(share, 1.0)
    if not np.isfinite(share) or abs(share - 1) > 0.02:
        return inconclusive(f"{told}: not all arrive, which other checks judge", numbers)
    return passed(told, numbers)


@check("neighbours", step=2, needs=("order",))
def newcomers(lab: Lab) -> Result:
    """Let two groups fly into each other: does a running solver feel what a new one feels?"""
    known = [_look(lab, _huddle(), n_steps) for n_steps in (2, 4, 6)]
    met = []
    for n_steps in LOOKS:
        met.append(_look(lab, _meeting(GAP), n_steps))
        if met[-1].unlisted:
            return _out_of_date(met[-1].unlisted, 0, "pairs missing")
    need(
        np.isfinite([each[:2] for each in known + met]).all(),
        "two groups that meet: some numbers are not finite",
    )
    worst = []
    for way in (0, 1):
        # densities may have a memory, so that a new solver tells nothing
        if max(look[way] for look in known) < KNOWN:
            worst.append(max(look[way] for look in met))
    if not (worst and any(look.felt for look in known) and any(look.felt for look in met)):
        return _passing_through(lab)
    if max(worst) > LATE:
        return _out_of_date(max(worst), 0.0, "of the largest")
    text = "two groups that fly into each other feel what a new solver makes them feel"
    if max(worst) > NEWCOMERS:
        return inconclusive(f"{text}, but some of it late", Measured(max(worst), 0.0))
    return passed(text, Measured(max(worst), 0.0, tolerance=f"{NEWCOMERS} of the largest"))


def _huddle() -> Case:
    """Return nine particles that contract; all are neighbours of each other from the start."""
    x = lattice(3, 3)
    return case(x, -SPEED / 2 * C0 * x / np.abs(x).max())


def _meeting(gap: float) -> Case:
    """Return two groups of nine that fly towards each other, with a gap [h] between them."""
    start = case(lattice(3, 3))
    half = np.array([DX + gap * start.h / 2, 0.0])
    velocity = np.array([-SPEED / 2, DRIFT]) * start.c0
    x = np.concatenate([start.x + half, start.x - half])
    v = np.repeat([velocity, velocity * [-1, 1]], 9, axis=0)
    return case(x, v)


def _look(lab: Lab, start: Case, n_steps: int) -> FreshComparison:
    """Return how a solver after so many steps compares with a new one; NaN if it can't be told."""
    dt = STEP * start.h / start.c0
    subject = lab.make(start).step(dt, n_steps)
    missing = _unlisted(subject, dt) if "neighbors" in lab.shown else 0
    before = case(subject.x, subject.v)
    if not _finite(before):
        return FreshComparison(np.nan, np.nan, False, missing)
    new, old = (each.step(dt).v - before.v for each in (lab.make(before), subject))
    step = spread(old[None], new, 1e-4 * dt * start.c0**2 / start.h)[0]
    now = case(subject.x, subject.v)
    if not _finite(now):
        return FreshComparison(np.nan, np.nan, False, missing)
    fresh, running = at_rest(lab, now), present(lab, subject)
    if not (fresh.finite and running.finite):
        return FreshComparison(np.nan, np.nan, False, missing)
    share = difference(running.take(np.arange(now.n)[None]), fresh, now)[0]
    return FreshComparison(
        float(step), float(share), felt(fresh, now) or felt(running, now), missing
    )


def _finite(now: Case) -> bool:
    return all_finite(now.x, now.v)


def _unlisted(subject: SolverUnderTest, dt: float) -> int:
    """Return how many pairs are near, and were so a step ago, but are not listed."""
    near = ~np.eye(subject.case.n, dtype=bool)
    for x in (subject.x, subject.x - dt * subject.v):
        near &= np.linalg.norm(x[:, None] - x[None], axis=2) < CLOSE * subject.case.h
    counts = listed(subject)
    return int((near & (counts == 0) & (counts.T == 0)).sum())


def _out_of_date(measured: float, expected: float, unit: str) -> Result:
    what = (
        f"{measured} pairs nearer than {CLOSE} h are not in the lists"
        if unit == "pairs missing"
        else f"densities or accelerations differ by {100 * measured:.2g} % from those of a new "
        "solver at the same positions, while in a group that was together from the start they agree"
    )
    return failed(
        f"two groups fly into each other with {SPEED} c0: {what}",
        BRUTE_FORCE + "Lists are out of date: search in every step, or list pairs up to a margin "
        "beyond h and search anew as soon as a particle has moved by half of the margin.",
        Measured(measured, expected, unit=unit),
    )


def _passing_through(lab: Lab) -> Result:
    """Compare how much groups slow each other down that come from afar, and that begin near."""
    touching = DX / _meeting(GAP).h
    together, before = round(0.25 / (SPEED * STEP)), round((GAP - touching) / (SPEED * STEP))
    near, _ = _slowed(lab, touching, together)
    _, changed = _slowed(lab, GAP, before // 2)
    need(
        0.05 < near < 2.2 and changed < 0.1 * DX,
        "two groups that meet hardly react, or explode, or remember densities",
    )
    far, _ = _slowed(lab, GAP, before + together)
    numbers = Measured(far, near, unit="of the speed lost")
    if abs(far) < 0.02 * near:
        return failed(
            f"two groups that begin {touching:.2f} h apart slow each other down by "
            f"{100 * near:.2g} %, but those that begin {GAP} h apart fly through each other",
            BRUTE_FORCE + "Lists are those of the start: search in every step.",
            numbers,
        )
    return passed("two groups that come from afar meet", numbers)


def _slowed(lab: Lab, gap: float, steps: int) -> tuple[float, float]:
    """Return the share of the speed of approach that two groups lose, and how one changes [m]."""
    start = _meeting(gap)
    subject = lab.make(start).step(STEP * start.h / start.c0, steps)
    before, after = (x[:9] - x[:9].mean(axis=0) for x in (start.x, subject.x))
    lost = 1 - _approach(subject.v) / _approach(start.v)
    changed = float(np.abs(after - before).max())
    return (lost, changed) if np.isfinite(changed) else (np.nan, np.inf)


def _approach(v: Array) -> float:
    return float(v[9:, 0].mean() - v[:9, 0].mean())
