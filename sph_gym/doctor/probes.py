"""Pairs and small groups of particles, and what a solver does with them.

All probes lie in the positive quadrant and not far from the origin, so that a neighbour search
that fails elsewhere doesn't spoil what is measured of the laws.
"""

from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import C0, GAMMA, RHO0, SUPPORT, Array, Case, case
from sph_gym.doctor.lab import Fields, Lab
from sph_gym.doctor.subject import Crash, Subject

# Time steps in which nothing moves, as a share of h / c0: pressures of close pairs may be 10^5
# times as large as those at rest, and even then a step is to move nobody by more than 1e-5 h.
STILL = 1e-6
# Distances of pairs in support radii: dense where kernels differ, and some beyond the support.
DISTANCES = np.array([*np.linspace(0.03, 0.98, 24), 1.03, 1.2, 1.5, 1.9])
# Between pairs, in support radii; a kernel of twice the support must not join two of them.
_APART = 6.0
_N_LONELY = 2
_GOLDEN = np.pi * (3 - 5**0.5)


class Pairs(NamedTuple):
    """What a solver shows of pairs, each alone in empty space.

    q: (k,) distances in support radii; rho, p: (k, 2) of both partners, None if not shown;
    push: (k, 2) accelerations of both, positive away from the partner [m/s^2]; across: the same
    at right angles; lone: (m,) densities of particles without a partner, None if not shown.
    """

    case: Case
    q: Array
    rho: Array | None
    p: Array | None
    push: Array
    across: Array
    lone: Array | None


def fluid(h: float, ratio: float = SUPPORT, c0: float = C0) -> dict[str, float]:
    """Return the settings of a case with support radius h [m] and h / dx = ratio."""
    return {"h": h, "dx": h / ratio, "c0": c0, "rho0": RHO0, "gamma": GAMMA}


def spread(n: int, h: float) -> Array:
    """Return (n, 2) places so far from each other that what is put there does not touch."""
    side = int(np.ceil(np.sqrt(n)))
    i, j = np.divmod(np.arange(n), side)
    # odd fractions of h, so that places lie differently in the cells of a grid
    step = (_APART + 0.37) * h
    return np.stack([i, j], axis=1) * step + np.array([2.61, 2.17]) * h


def axes(n: int) -> Array:
    """Return (n, 2) unit vectors in all directions."""
    angle = _GOLDEN * np.arange(n) + 0.3
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def pairs_case(q: Array, speed: float = 0.0, **settings: float) -> Case:
    """Return pairs at distances q h, and two lone particles as the last rows.

    speed: with which the partners of a pair approach each other, in c0; settings: see `fluid`.
    Rows: first partners, second partners, lone ones.
    """
    h, n = settings["h"], len(q)
    places, along = spread(n + _N_LONELY, h), axes(n)
    half = along * (q[:, None] * h / 2)
    x = np.concatenate([places[:n] + half, places[:n] - half, places[n:]])
    v = np.concatenate([-along, along, np.zeros((_N_LONELY, 2))]) * speed * settings["c0"] / 2
    return case(x, v, **settings)


def settle(subject: Subject, lab: Lab, still: float) -> None:
    """Have a solver renew rho, p and a at its positions; twice, for one that lags behind."""
    if "evaluate" in lab.shown:
        subject.evaluate().evaluate()
    else:
        subject.step(still, 3)


def look(subject: Subject, lab: Lab) -> Fields:
    """Return rho, p and a that a solver shows now; a from two short steps if it isn't shown."""
    still = STILL * subject.case.h / subject.case.c0
    settle(subject, lab, still)
    rho, p, a = (subject.get(name) if name in lab.shown else None for name in ("rho", "p", "a"))
    if a is None:
        if "evaluate" in lab.shown:
            subject.step(still)
        before = subject.v
        a = (subject.step(still, 2).v - before) / (2 * still)
    return Fields(rho, p, a)


def fields(lab: Lab, start: Case) -> Fields:
    """Return rho, p and a of a new solver at the case's positions; a is never None."""
    return look(lab.make(start), lab)


def _pairs(start: Case, q: Array, x: Array, found: Fields) -> Pairs:
    n = len(q)
    assert found.a is not None
    d = x[:n] - x[n : 2 * n]
    along = d / np.linalg.norm(d, axis=1)[:, None]
    first, second = found.a[:n], found.a[n : 2 * n]
    push = np.stack([(first * along).sum(1), -(second * along).sum(1)], axis=1)
    turned = np.stack([-along[:, 1], along[:, 0]], axis=1)
    across = np.stack([(first * turned).sum(1), -(second * turned).sum(1)], axis=1)
    rho, p = (None if f is None else f[: 2 * n].reshape(2, n).T for f in (found.rho, found.p))
    lone = None if found.rho is None else found.rho[2 * n :]
    distance = np.linalg.norm(d, axis=1) / start.h
    return Pairs(start, distance, rho, p, push, across, lone)


def pairs(lab: Lab, q: Array, **settings: float) -> Pairs:
    """Return what a new solver shows of pairs at rest at the distances q h."""
    start = pairs_case(q, **settings)
    return _pairs(start, q, start.x, fields(lab, start))


def closing(lab: Lab, q: Array, moments: tuple[int, ...], **settings: float) -> list[Pairs]:
    """Return what a solver shows of pairs that approach each other, after so many steps.

    In 30 steps they come nearer by 0.006 h: densities by continuity rise by some percent.
    """
    start = pairs_case(q, speed=0.02, **settings)
    subject, dt, seen = lab.make(start), 0.01 * start.h / start.c0, []
    for moment in moments:
        subject.step(dt, moment - subject.n_steps)
        seen.append(_pairs(start, q, subject.x, _moving(subject, lab, dt)))
    return seen


def _moving(subject: Subject, lab: Lab, dt: float) -> Fields:
    rho, p, a = (subject.get(name) if name in lab.shown else None for name in ("rho", "p", "a"))
    if a is None:
        before = subject.v
        a = (subject.step(dt).v - before) / dt
    return Fields(rho, p, a)


def squeezing(lab: Lab) -> float | None:
    """Return the smallest h / dx that the solver takes, None if it takes none below 2.

    At h = dx a single particle has about the density rho0 or more, so that pairs are under
    pressure although pressures below zero may be cut off.
    """
    if "squeezing" not in lab.facts:
        lab.facts["squeezing"] = None
        for ratio in (1.0, 1.05, 1.3, 1.6):
            try:
                start = pairs_case(np.array([0.5]), **fluid(0.12, ratio))
                lab.make(start).step(STILL * start.h / start.c0)
            except Crash:
                continue
            lab.facts["squeezing"] = ratio
            break
    ratio = lab.facts["squeezing"]
    return None if ratio is None else float(ratio)


def cluster(n: int, h: float, rng: np.random.Generator, least: float = 0.25) -> Array:
    """Return (n, 2) positions within a circle of diameter 0.95 h, at least `least` h apart."""
    chosen: list[Array] = []
    while len(chosen) < n:
        new = rng.uniform(-0.475, 0.475, 2)
        if np.hypot(*new) > 0.475:
            continue
        if all(np.hypot(*(new - old)) >= least for old in chosen):
            chosen.append(new)
        elif rng.random() < 0.02:
            chosen.clear()
    return np.array(chosen) * h


def groups(shapes: list[Array], h: float) -> Array:
    """Return (n groups, n, 2) positions: each shape (n, 2) around a place of its own."""
    return np.stack(shapes) + spread(len(shapes), h)[:, None] + 0.71 * h


def pressed(lab: Lab, x: Array, **settings: float) -> tuple[Array, Fields]:
    """Return positions (n groups, n, 2), and rho, p and a, of groups that are under pressure.

    x: (n groups, n, 2). Groups at rest are looked at first; where nothing pushes, as densities by
    continuity do not know that particles are close, the groups contract by 3 % before.
    """
    n_groups, n, _ = x.shape
    found = fields(lab, case(x, **settings))
    assert found.a is not None
    h, c0 = settings["h"], settings["c0"]
    if np.abs(found.a).max() > 1e-4 * c0**2 / h:
        return x, found
    v = -0.1 * c0 / h * (x - x.mean(axis=1, keepdims=True))
    subject = lab.make(case(x, v.reshape(-1, 2), **settings)).step(0.01 * h / c0, 30)
    # the accelerations are those of the last evaluation, a step ago at most
    where = subject.x.reshape(n_groups, n, 2)
    return where, _moving(subject, lab, 0.01 * h / c0)
