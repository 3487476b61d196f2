"""Measure viscosity: the accelerations that case.viscosity makes, and the nu that they mean."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import C0, DX, RHO0, Array, Case, case, lattice
from sph_gym.doctor.lab import Lab

# The viscosity that is asked for [m^2/s]; also, where nothing is seen of it, this times rho0: some
# take case.viscosity for the dynamic one.
ASKED = 0.05 * C0 * 3 * DX
# Velocities [c0]: small, so that terms in v^2, as artificial viscosity has them, stay out.
SLOW = 0.01
# The viscosity to compare with, as a share.
THIN = 1e-3
# A response below this share of what the viscosity asked for would do is none: for a kinematic
# one, and for one that was multiplied by rho0 to be seen as a dynamic one.
SEEN_KINEMATIC, SEEN_DYNAMIC = 1e-2, 1e-4


class Way(NamedTuple):
    """Where a solver's viscosity is seen: in `a`, or in changes of v; and what is asked for."""

    by_a: bool
    viscosity: float


def way_of(lab: Lab) -> Way | None:
    """Return how the solver's viscosity is seen, None if it shows none; measured once."""
    if "viscosity_way" not in lab.facts:
        lab.facts["viscosity_way"] = _found(lab)
    way = lab.facts["viscosity_way"]
    assert way is None or isinstance(way, Way)
    return way


def _found(lab: Lab) -> Way | None:
    probe = random_motion(lab)
    usual = ASKED * SLOW * C0 / DX**2
    for viscosity, seen in ((ASKED, SEEN_KINEMATIC), (ASKED * RHO0, SEEN_DYNAMIC)):
        for by_a in (True, False) if "a" in lab.shown else (False,):
            drag = response(lab, probe, Way(by_a, viscosity))
            if not np.abs(drag).max() < seen * usual * viscosity / ASKED:
                return Way(by_a, viscosity)
    return None


def random_motion(lab: Lab) -> Case:
    """Return a lattice of 9 x 9 at rest spacing with random velocities."""
    x = lattice(9, 9)
    return case(x, SLOW * C0 * lab.rng.uniform(-1, 1, x.shape))


def response(lab: Lab, start: Case, way: Way) -> Array:
    """Return the accelerations (n, 2) [m/s^2] that the viscosity of `way` adds."""
    thick = replace(start, viscosity=way.viscosity)
    # not 0, for which some solvers have another kind of damping
    thin = replace(start, viscosity=THIN * way.viscosity)
    added = acceleration(lab, thick, way.by_a) - acceleration(lab, thin, way.by_a)
    return added / (1 - THIN)


def acceleration(lab: Lab, start: Case, by_a: bool) -> Array:
    """Return the accelerations (n, 2) [m/s^2], as `a` or as changes of v."""
    return lab.acceleration(start) if by_a else lab.change_of_velocity(start)


def shear(c0: float = C0, scale: float = 1.0) -> Case:
    """Return a lattice of 9 x 9, `scale` times as large, with v_x = A y^2.

    Its Laplacian, 2 A, is the same for any kernel, without errors of higher order.
    """
    x = lattice(9, 9, scale * DX)
    v = np.stack([curvature(scale) * x[:, 1] ** 2, np.zeros(len(x))], axis=1)
    return case(x, v, dx=scale * DX, h=3 * scale * DX, c0=c0)


def curvature(scale: float = 1.0) -> float:
    """Return A [1/(m s)] of the shear, with which the fastest have the speed SLOW * C0."""
    return SLOW * C0 / (4 * scale * DX) ** 2


def middle_first(speed: float) -> tuple[Array, Array]:
    """Return x and v of a lattice of 9 x 9 in which the one in the middle moves, others don't.

    For h up to 2 dx: then all its neighbours are surrounded on all sides. It is the first, so that
    it is on one side of all its pairs.
    """
    x = lattice(9, 9)
    x = x[np.argsort(np.abs(x).max(axis=1), kind="stable")]
    return x, np.where(np.arange(81)[:, None] == 0, speed * np.array([1.0, 0.3]), 0.0)


def middle(start: Case) -> Array:
    """Return which particles of the shear are at rest and have all their neighbours, (n,)."""
    near = np.abs(start.x) < 1.5 * start.dx
    return np.asarray(near[:, 0] & (np.abs(start.x[:, 1]) < 0.5 * start.dx))


def effective(lab: Lab, way: Way, c0: float = C0, scale: float = 1.0) -> float:
    """Return the kinematic viscosity [m^2/s] that the shear feels."""
    start = shear(c0, scale)
    drag = response(lab, start, way)[middle(start), 0]
    return float(drag.mean() / (2 * curvature(scale)))


def built_in(lab: Lab) -> float:
    """Return the kinematic viscosity [m^2/s] that is there although case.viscosity is 0."""
    start = shear()
    still = replace(start, v=np.zeros_like(start.v))
    by_a = False
    drag = acceleration(lab, start, by_a) - acceleration(lab, still, by_a)
    return float(drag[middle(start), 0].mean() / (2 * curvature()))


def kick(lab: Lab) -> float:
    """Return what share of gravity's acceleration arrives in v; 1 in a sound solver."""
    start = case(lattice(3, 3, 1.1 * DX))
    g = 0.1 * C0**2 / start.h
    pulled = replace(start, gravity=np.array([g, 0.0]))
    gained = lab.change_of_velocity(pulled) - lab.change_of_velocity(start)
    return float(gained[:, 0].mean() / g)
