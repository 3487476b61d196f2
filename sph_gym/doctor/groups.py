"""Groups of particles that stand at several places, and what a solver does to them there."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor.case import Array, Case, case
from sph_gym.doctor.lab import TINY, Lab
from sph_gym.doctor.subject import SolverUnderTest

# Responses below this share of the natural scale are none.
SILENT = 1e-6
# A step in which particles move by more than this [h] was not tiny.
_MOVED = 1e-3
# How fast a group contracts where only motion makes a solver respond [c0 / h], and for how long.
CONTRACTION, CONTRACTING_STEPS, CONTRACTING_DT = 0.1, 8, 0.02


class Response(NamedTuple):
    """Response of particles to their neighbours.

    rho: (n,) densities [kg/m^3], None if the solver shows none; a: (n, 2) accelerations [m/s^2];
    moved: (n, 2) displacements [m] that the velocities don't explain.
    """

    rho: Array | None
    a: Array
    moved: Array

    @property
    def finite(self) -> bool:
        """Return whether all of it is."""
        return all(np.isfinite(each).all() for each in self if each is not None)

    def take(self, indices: NDArray[np.intp]) -> "Response":
        """Return the response of some particles, in another order or shape."""
        rho = None if self.rho is None else self.rho[indices]
        return Response(rho, self.a[indices], self.moved[indices])


def at_rest(lab: Lab, start: Case) -> Response:
    """Return what a new solver does in a few tiny steps, in which nothing moves."""
    response = present(lab, lab.make(start))
    if np.abs(response.moved).max() > _MOVED * start.h:
        # densities that are wrong by far make pressures that are wrong by far more
        response = present(lab, lab.make(start), 1e-4 * TINY)
    return response


def present(lab: Lab, subject: SolverUnderTest, share: float = TINY) -> Response:
    """Return what a solver does in a few tiny steps of this share of h / c0.

    Several, as some solvers know the densities or accelerations of the step before only.
    """
    dt = share * subject.case.h / subject.case.c0
    x, v = subject.x, subject.v
    a = subject.step(dt).change(dt, 2)
    moved = subject.x - x - 3 * dt * v
    if "evaluate" in lab.shown:
        subject.evaluate()
    rho = subject.get("rho") if "rho" in lab.shown else None
    if "a" in lab.shown:
        a = subject.get("a")
    return Response(rho, a, moved)


def in_motion(lab: Lab, start: Case, center: Array) -> Response:
    """Return what a new solver does to particles that move towards `center`, (2,) or (n, 2) [m].

    For densities by continuity, which don't know of positions but of velocities.
    """
    h, c0 = start.h, start.c0
    v = -CONTRACTION * c0 / h * (start.x - center)
    dt = CONTRACTING_DT * h / c0
    time = CONTRACTING_STEPS * dt
    moving = case(start.x, v, dx=start.dx, h=h)
    subject = lab.make(moving).step(dt, CONTRACTING_STEPS)
    rho = subject.get("rho") if "rho" in lab.shown else None
    return Response(rho, (subject.v - v) / time, subject.x - start.x - time * v)


def respond(lab: Lab, start: Case, center: Array) -> Response:
    """Return the response at rest, or in motion towards `center` where there is none at rest."""
    response = at_rest(lab, start)
    if not response.finite or felt(response, start):
        return response
    return in_motion(lab, start, center)


def felt(response: Response, start: Case) -> bool:
    """Return whether particles felt each other: by different densities, or by accelerations."""
    if np.abs(response.a).max() > SILENT * start.c0**2 / start.h:
        return True
    rho = response.rho
    return rho is not None and bool(np.ptp(rho) > SILENT * np.abs(rho).max())


def disc(rng: np.random.Generator, n: int, radius: float, nearest: float) -> Array:
    """Return (n, 2) positions in a disc around 0, no two nearer than `nearest` [m]."""
    found: list[Array] = []
    while len(found) < n:
        new = rng.uniform(-radius, radius, 2)
        if np.hypot(*new) < radius and all(np.hypot(*(new - old)) > nearest for old in found):
            found.append(new)
        elif rng.random() < 0.01:  # a bad beginning: once more
            found = []
    return np.array(found)


def spread(values: Array, reference: Array, floor: float = 1e-300) -> Array:
    """Return by how much each of k rows of values differs from the reference, (k,), as a share.

    values: (k, ...); reference: (...); the share is of the largest number in both, which is taken
    for `floor` where it is less.
    """
    rows = values.reshape(len(values), -1)
    scale = np.maximum(np.abs(rows).max(axis=1), max(float(np.abs(reference).max()), floor))
    return np.asarray(np.abs(rows - reference.reshape(-1)).max(axis=1) / scale)


def difference(response: Response, reference: Response, start: Case) -> Array:
    """Return by how much responses in k places (k, m, ...) differ from that in one (m, ...).

    The larger share of densities and of accelerations, (k,).
    """
    a = spread(response.a, reference.a, 1e-4 * start.c0**2 / start.h)
    if response.rho is None or reference.rho is None:
        return a
    return np.maximum(a, spread(response.rho, reference.rho))
