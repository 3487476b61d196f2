"""The effect of XSPH: the velocities that it adds where particles are moved."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import C0, DX, Array, Case, case, lattice
from sph_gym.doctor.drag import middle_first
from sph_gym.doctor.lab import Lab

EPSILON = 0.5
# Largest velocity in a direction, and speed of sound [m/s]: so soft a fluid that its pressure
# moves little, even where it is wrong.
SPEED, SOFT = 0.2, 0.1 * C0
# Steps, short enough that velocities hardly change, long enough that 32 bits see displacements:
# their length [h / C0], the number that is left out first, and the number that counts.
STEP, BEFORE, COUNTED = 0.01, 2, 4
# Velocities that pressure changes by more than this share meanwhile tell nothing of XSPH.
CALM = 0.2


class Drift(NamedTuple):
    """Motion of particles in some steps of a solver.

    moved: displacement a time (n, 2) [m/s]; mean: of the velocities before and after (n, 2) [m/s];
    v: velocities (n, 2) [m/s] after BEFORE and after all steps.
    """

    moved: Array
    mean: Array
    v: tuple[Array, Array]


def drift(lab: Lab, start: Case, epsilon: float, step: float = STEP) -> Drift:
    """Return how particles are moved with this epsilon, in steps of `step` h / C0."""
    dt = step * start.h / C0
    subject = lab.make(replace(start, xsph=epsilon)).step(dt, BEFORE)
    x, v = subject.x, subject.v
    subject.step(dt, COUNTED)
    after = subject.v
    return Drift((subject.x - x) / (COUNTED * dt), (v + after) / 2, (v, after))


def added(lab: Lab, start: Case, epsilon: float = EPSILON, step: float = STEP) -> Array:
    """Return the velocities (n, 2) [m/s] that XSPH adds to displacements."""
    return drift(lab, start, epsilon, step).moved - drift(lab, start, 0.0, step).moved


def added_by_motion(lab: Lab, start: Case) -> Array:
    """Return the same, less what it is without velocities: edges that fly off are smoothed too."""
    return added(lab, start) - added(lab, replace(start, v=np.zeros_like(start.v)))


def share(velocity: Array, start: Case) -> float:
    """Return how much of its own velocity a particle inside loses by `velocity` (n, 2) [m/s].

    With random velocities, the mean of the neighbours is about 0, and XSPH takes a share of
    epsilon times the weight of all neighbours: 0.6 to 0.9 epsilon.
    """
    inside = np.abs(start.x).max(axis=1) < 2.5 * DX
    v = start.v[inside]
    return float(-(velocity[inside] * v).sum() / (v * v).sum())


def random_motion(lab: Lab) -> Case:
    """Return a lattice of 9 x 9 at rest spacing with random velocities; once a diagnosis."""
    if "xsph_motion" not in lab.facts:
        lab.facts["xsph_motion"] = SPEED * lab.rng.uniform(-1, 1, (81, 2))
    return case(lattice(9, 9), lab.facts["xsph_motion"], c0=SOFT)


def uniform_motion() -> Case:
    """Return the same lattice with one velocity for all."""
    return case(lattice(9, 9), SPEED * np.array([1.0, -0.7]), c0=SOFT)


def one_in_motion() -> Case:
    """Return a lattice of 9 x 9 at rest except for the particle in its middle.

    See `middle_first`.
    """
    return case(*middle_first(SPEED), h=2 * DX, c0=SOFT)


def smooths(lab: Lab) -> float:
    """Return the share that XSPH of EPSILON takes from random velocities; once a diagnosis."""
    if "xsph_share" not in lab.facts:
        start = random_motion(lab)
        lab.facts["xsph_share"] = share(added(lab, start), start)
    return float(lab.facts["xsph_share"])


def carried(lab: Lab) -> float:
    """Return what share of a uniform velocity moves particles, without XSPH; 1 if all is well."""
    if "xsph_carried" not in lab.facts:
        start = uniform_motion()
        u = start.v[0]
        moved = drift(lab, start, 0.0).moved.mean(axis=0)
        lab.facts["xsph_carried"] = float(moved @ u / (u @ u))
    return float(lab.facts["xsph_carried"])


def disturbed(lab: Lab) -> str:
    """Return why displacements tell nothing of XSPH, "" if they do."""
    if not abs(carried(lab) - 1) < 0.02:
        return f"particles move by {carried(lab):.3g} of their velocities: integration"
    start = random_motion(lab)
    before, after = drift(lab, start, 0.0).v
    inside = np.abs(start.x).max(axis=1) < 2.5 * DX
    if not np.abs(after - before)[inside].max() < CALM * np.abs(start.v).max():
        return "a lattice at rest spacing doesn't keep calm: density, pressure or force"
    return ""
