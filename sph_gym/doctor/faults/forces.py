"""Faults of the links "force" (gravity included) and "viscosity"."""

import numpy as np

from sph_gym.doctor.case import Array
from sph_gym.doctor.faults.registry import fault, replaces
from sph_gym.doctor.plain import Plain


@replaces("force", "force", 3)
def attracts(solver: Plain) -> Array:
    """The gradient has the wrong sign: compressed particles pull at each other."""
    return -Plain.force(solver)


@replaces("force", "force", 3)
def one_sided(solver: Plain) -> Array:
    """The force takes p_i alone: what i does to j is not what j does to i."""
    share = solver.p / solver.rho**2
    push = -2 * solver.mass * share[solver.i] * solver.slope(solver.r)
    return solver.total_vector(push[:, None] * solver.direction)


@replaces("force", "force", 3)
def difference_of_pressures(solver: Plain) -> Array:
    """p_j / rho_j^2 - p_i / rho_i^2 where there should be a sum: pairs push in one direction."""
    share = solver.p / solver.rho**2
    push = -solver.mass * (share[solver.j] - share[solver.i]) * solver.slope(solver.r)
    return solver.total_vector(push[:, None] * solver.direction)


@replaces("slope", "force", 8)
def poly6_gradient(solver: Plain, r: Array) -> Array:
    """The gradient of poly6 for pressure: it vanishes where particles touch, and they pair."""
    return -24 / (np.pi * solver.h**8) * r * np.maximum(solver.h**2 - r**2, 0) ** 2


@replaces("slope", "force", 8)
def spiky_10(solver: Plain, r: Array) -> Array:
    """The spiky gradient has the constant -10 / (pi h^5), a third of what it should be."""
    return Plain.slope(solver, r) / 3


@replaces("slope", "force", 8)
def spiky_of_3d(solver: Plain, r: Array) -> Array:
    """The spiky gradient has the constant of three dimensions, -45 / (pi h^6)."""
    return -45 / (np.pi * solver.h**6) * np.maximum(solver.h - r, 0) ** 2


@replaces("directions", "force", 4)
def coincident_nan(solver: Plain, d: Array, r: Array) -> Array:
    """Directions are divided by r without a look whether it is zero."""
    with np.errstate(invalid="ignore"):
        return d / r[:, None]


@replaces("directions", "force", 3)
def not_normalized(solver: Plain, d: Array, r: Array) -> Array:
    """The direction is not divided by the distance."""
    return d


@replaces("force", "force", 4)
def undivided(solver: Plain) -> Array:
    """The force on a volume is taken for an acceleration: the division by rho is missing."""
    return Plain.force(solver) * solver.rho[:, None]


@replaces("force", "force", 3)
def along_x_only(solver: Plain) -> Array:
    """The y component of the force is lost."""
    return Plain.force(solver) * np.array([1.0, 0.0])


@replaces("force", "force", 3)
def force_twice(solver: Plain) -> Array:
    """A loop over all i and j adds each force to both of them, so that it acts twice."""
    return 2 * Plain.force(solver)


@fault("one_loop", "force", 4)
class OneLoop(Plain):
    """One loop does all for a particle after the other: later ones push with old pressures."""

    def force(self) -> Array:
        share = self.p / self.rho**2
        before = getattr(self, "share", share)
        self.share = share
        of_partner = np.where(self.j > self.i, before[self.j], share[self.j])
        push = -self.mass * (share[self.i] + of_partner) * self.slope(self.r)
        return self.total_vector(push[:, None] * self.direction)


@replaces("gravity", "force", 3)
def gravity_twice(solver: Plain) -> Array:
    """Gravity is in the forces twice."""
    return 2 * solver.case.gravity


@replaces("gravity", "force", 3)
def gravity_upwards(solver: Plain) -> Array:
    """Gravity has the wrong sign."""
    return -solver.case.gravity


@replaces("gravity", "force", 3)
def gravity_downwards(solver: Plain) -> Array:
    """Only the size of gravity is looked at: it always acts downwards."""
    return np.array([0.0, -np.hypot(*solver.case.gravity)])


@replaces("gravity", "force", 3)
def gravity_times_mass(solver: Plain) -> Array:
    """Gravity is multiplied by the mass, but never divided by it."""
    return solver.mass * solver.case.gravity


@replaces("viscosity", "viscosity", 7)
def negative_viscosity(solver: Plain) -> Array:
    """v_i - v_j instead of v_j - v_i: differences of velocity grow."""
    return -Plain.viscosity(solver)


@replaces("viscosity", "viscosity", 7)
def absolute_velocity(solver: Plain) -> Array:
    """Viscosity takes -v_i for v_j - v_i: it brakes what moves as a whole."""
    drag = solver.case.viscosity * solver.case.rho0 * solver.mass * solver.laplacian(solver.r)
    drag /= solver.rho[solver.i] * solver.rho[solver.j]
    return -solver.total_vector(drag[:, None] * solver.v[solver.i])


@replaces("laplacian", "viscosity", 8)
def laplacian_of_3d(solver: Plain, r: Array) -> Array:
    """The Laplacian has the constant of three dimensions, 45 / (pi h^6)."""
    return 45 / (np.pi * solver.h**6) * np.maximum(solver.h - r, 0)


@replaces("viscosity", "viscosity", 7)
def viscosity_twice(solver: Plain) -> Array:
    """Viscosity acts twice, and the fluid is like jelly."""
    return 2 * Plain.viscosity(solver)


@replaces("viscosity", "viscosity", 7)
def undivided_viscosity(solver: Plain) -> Array:
    """Viscosity is a force on a volume that isn't divided by rho."""
    return Plain.viscosity(solver) * solver.rho[:, None]


@replaces("viscosity", "viscosity", 7)
def jelly(solver: Plain) -> Array:
    """A viscosity of 0.5 c0 h that can't be turned off."""
    drag = 0.5 * solver.c0 * solver.h * solver.case.rho0 * solver.mass * solver.laplacian(solver.r)
    drag /= solver.rho[solver.i] * solver.rho[solver.j]
    return solver.total_vector(drag[:, None] * (solver.v[solver.j] - solver.v[solver.i]))
