"""Pairs and small groups of particles, and what a solver does with them.

All probes lie in the positive quadrant and not far from the origin, so that a neighbour search
that fails elsewhere doesn't spoil what is measured of the laws.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import C0, DX, GAMMA, RHO0, SUPPORT, Array, Case, case
from sph_gym.doctor.diagnosis import COLUMNS, Measured, Result, failed
from sph_gym.doctor.lab import Lab, once
from sph_gym.doctor.subject import Crash, SolverUnderTest

# Time steps in which nothing moves, as a share of h / c0: pressures of close pairs may be 10^5
# times as large as those at rest, and even then a step is to move none by more than 1e-5 h.
STILL = 1e-6
MOMENT = 0.002  # the time step of particles in motion
# Distances of pairs in support radii: dense where kernels differ, and some beyond the support.
DISTANCES = np.array([*np.linspace(0.03, 0.98, 24), 1.03, 1.2, 1.5, 1.9])
# Of pairs that are to collide.
COLLIDING = np.linspace(0.6, 0.9, 6)
# Between pairs, in support radii; a kernel of twice the support must not join two of them.
_APART = 6.0
_N_LONELY = 2
_GOLDEN = np.pi * (3 - 5**0.5)


class Seen(NamedTuple):
    """Measurements of a solver: rho, p (n,) and a (n, 2); NaN for rho and p if not shown."""

    rho: Array
    p: Array
    a: Array


class Pairs(NamedTuple):
    """Measurements of pairs, each alone in empty space; NaN for what isn't shown.

    q: (k,) distances in support radii; rho, p: (k, 2) of both partners; push: (k, 2) accelerations
    of both, positive away from the partner [m/s^2]; closing: (k,) speeds at which they approach
    each other [m/s]; lone: density of a particle without a partner.
    """

    q: Array
    rho: Array
    p: Array
    push: Array
    closing: Array
    lone: float


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


def fields(lab: Lab, start: Case) -> Seen:
    """Return rho, p and a of a new solver at the case's positions.

    Raises ValueError if steps do not go with dt, so that accelerations can't be told.
    """
    for share in (1.0, 0.03, 1e-3):
        subject = lab.make(start)
        seen, double = _look(subject, lab, share * STILL * start.h / start.c0)
        moved = float(np.abs(subject.x - start.x).max()) / start.h
        if not moved > 1e-5 * (100 if lab.float32 else 1):
            break
    if moved > 1e-2:
        raise ValueError("particles move far in a step of almost no time")
    # a leapfrog that means the last two steps gives three quarters
    if np.abs(double - seen.a).max() > 0.4 * np.abs(seen.a).max() > 0:
        raise ValueError("a step of twice the time does not change velocities twice as much")
    return seen


def _look(subject: SolverUnderTest, lab: Lab, still: float) -> tuple[Seen, Array]:
    """Return what is seen, and the accelerations (n, 2) that a step of twice the time shows."""
    if "evaluate" in lab.shown:
        # twice, for a solver whose pressures lag behind
        subject.evaluate().evaluate()
    else:
        subject.step(still, 3)
    rho, p = _shown(subject, lab, "rho"), _shown(subject, lab, "p")
    if "a" in lab.shown:
        a = subject.get("a")
        return Seen(rho, p, a), a
    if "evaluate" in lab.shown:
        subject.step(still)
    return Seen(rho, p, subject.change(still, 2)), subject.change(2 * still)


def _shown(subject: SolverUnderTest, lab: Lab, name: str) -> Array:
    return subject.get(name) if name in lab.shown else np.full(subject.case.n, np.nan)


def passing(subject: SolverUnderTest, lab: Lab, dt: float) -> Seen:
    """Return rho, p and a as they were at the last evaluation of a solver in motion."""
    rho, p = _shown(subject, lab, "rho"), _shown(subject, lab, "p")
    a = subject.get("a") if "a" in lab.shown else subject.change(dt)
    return Seen(rho, p, a)


def _pairs(x: Array, v: Array, seen: Seen, n: int, h: float) -> Pairs:
    d = x[:n] - x[n : 2 * n]
    r = np.linalg.norm(d, axis=1)
    along = d / r[:, None]
    push = [(seen.a[:n] * along).sum(axis=1), -(seen.a[n : 2 * n] * along).sum(axis=1)]
    rho, p = (values[: 2 * n].reshape(2, n).T for values in (seen.rho, seen.p))
    closing = -((v[:n] - v[n : 2 * n]) * along).sum(axis=1)
    lone = float(seen.rho[2 * n :].mean())
    return Pairs(r / h, rho, p, np.stack(push, axis=1), closing, lone)


def pairs(lab: Lab, q: Array, **settings: float) -> Pairs:
    """Return what a new solver shows of pairs at rest at the distances q h."""
    start = pairs_case(q, **settings)
    return _pairs(start.x, start.v, fields(lab, start), len(q), start.h)


def triangles(lab: Lab, q: Array, **settings: float) -> Pairs:
    """Return what is seen of equilateral triangles of sides q h, told as if they were pairs.

    In each, two neighbours make the density; `push` is the share that one of them has.
    """
    h, n = settings["h"], len(q)
    corners = np.array([(np.cos(t), np.sin(t)) for t in 2 * np.pi / 3 * np.arange(3) + 0.4])
    places = spread(n + _N_LONELY, h)
    x = places[:n, None] + corners * (q[:, None, None] * h / 3**0.5)
    seen = fields(lab, case([*x.reshape(-1, 2), *places[n:]], **settings))
    out = (seen.a[: 3 * n].reshape(n, 3, 2) * corners).sum(axis=2) / 3**0.5
    rho, p = (values[: 3 * n].reshape(n, 3) for values in (seen.rho, seen.p))
    return Pairs(q, rho, p, out, np.zeros(n), float(seen.rho[3 * n :].mean()))


def closing(
    lab: Lab, q: Array, moments: tuple[int, ...], speed: float = 0.1, **settings: float
) -> list[Pairs]:
    """Return what a solver shows of pairs that approach each other, after so many steps.

    speed: in c0; with a tenth, 50 steps bring them nearer by 0.01 h, and densities by continuity
    rise by some percent. That takes a tenth of h / c0: pairs rebound soon.
    """
    start = pairs_case(q, speed=speed, **settings)
    subject, dt, seen = lab.make(start), MOMENT * start.h / start.c0, []
    for moment in moments:
        subject.step(dt, moment - subject.n_steps)
        x, v = subject.x, subject.v
        seen.append(_pairs(x, v, passing(subject, lab, dt), len(q), start.h))
    return seen


class Collision(NamedTuple):
    """Pairs that collide, at the distances `COLLIDING`; n particles.

    x: (4, n, 2) positions at the start and after each of three steps; a, settled: (n, 2)
    accelerations without friction, right then and after the particles stood still for two steps,
    when what lags behind is in time.
    """

    x: Array
    a: Array
    settled: Array


def collide(lab: Lab, **settings: float) -> Collision:
    """Return what a solver does with pairs that fly into each other; settings: see `fluid`."""
    start = pairs_case(COLLIDING, speed=2.0, **settings)
    time = start.h / start.c0
    subject = lab.make(start)
    x = [subject.x, *(subject.step(0.03 * time).x for _ in range(3))]
    rubbed = friction(lab, subject.x, subject.v, **settings)
    a, _, settled = (subject.change(100 * STILL * time, n) - rubbed for n in (1, 2, 1))
    return Collision(np.stack(x), a, settled)


def friction(lab: Lab, x: Array, v: Array, **settings: float) -> Array:
    """Return the part of accelerations (n, 2) that goes with velocities."""
    return fields(lab, case(x, v, **settings)).a - fields(lab, case(x, **settings)).a


def gentle(lab: Lab, law: Callable[[float], Array]) -> float:
    """Return the largest h / dx at which pairs are under some pressure, `squeezing` else.

    law: returns densities of pairs [rho0] for h / dx. Under much pressure, they fly apart.
    """
    for ratio in (2.5, 2.0, 1.6, 1.3):
        if float(np.min(law(ratio))) > 1.1:
            return ratio
    return squeezing(lab) or 1.0


@once
def squeezing(lab: Lab) -> float | None:
    """Return the smallest h / dx that the solver takes, None if it takes none below 2.

    At h = dx a single particle has about the density rho0 or more, so that pairs are under
    pressure although pressures below zero may be cut off.
    """
    found = [ratio for ratio in (1.0, 1.05, 1.3, 1.6) if takes(lab, ratio)]
    return found[0] if found else None


def takes(lab: Lab, ratio: float) -> bool:
    """Return whether the solver can be made for this h / dx, and stays finite."""
    start = pairs_case(np.array([0.5]), **fluid(SUPPORT * DX, ratio))
    try:
        v = lab.make(start).step(STILL * start.h / start.c0, 2).v
    except Crash:
        return False
    return bool(np.isfinite(v).all())


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


def pressed(lab: Lab, x: Array, **settings: float) -> tuple[Array, Seen]:
    """Return positions (n groups, n, 2), and rho, p and a, of groups that are under pressure.

    x: (n groups, n, 2). Groups at rest are looked at first; where nothing pushes, as densities by
    continuity do not know that particles are close, the groups contract by 3 % before.
    """
    n_groups, n, _ = x.shape
    found = fields(lab, case(x, **settings))
    h, c0 = settings["h"], settings["c0"]
    if np.abs(found.a).max() > 1e-4 * c0**2 / h:
        return x, found
    v = -0.5 * c0 / h * (x - x.mean(axis=1, keepdims=True))
    dt = MOMENT * h / c0
    subject = lab.make(case(x, v.reshape(-1, 2), **settings)).step(dt, 30)
    # the accelerations are those of the last evaluation, a step ago at most
    where = subject.x.reshape(n_groups, n, 2)
    return where, passing(subject, lab, dt)


def not_finite(lab: Lab, found: Seen, what: str, remedy: str) -> Result:
    """Return that something is not finite: densities, pressures or accelerations."""
    numbers = Measured("not finite", "finite")
    for name in ("rho", "p"):
        if name in lab.shown and not np.isfinite(getattr(found, name)).all():
            return failed(f"{what}: {name} not finite", remedy, numbers, link=COLUMNS[name])
    return failed(f"{what}: accelerations not finite", remedy, numbers)
