"""Faults of the links "force" (gravity included) and "viscosity"."""

import numpy as np

from sph_gym.doctor.case import Array
from sph_gym.doctor.faults.registry import fault
from sph_gym.doctor.plain import Plain


@fault("attracts", "force", 3)
class Attracts(Plain):
    """The gradient has the wrong sign: compressed particles pull at each other."""

    def force(self) -> Array:
        return -super().force()


@fault("one_sided", "force", 3)
class OneSided(Plain):
    """The force takes p_i alone: what i does to j is not what j does to i."""

    def force(self) -> Array:
        share = self.p / self.rho**2
        push = -2 * self.mass * share[self.i] * self.slope(self.r)
        return self.total_vector(push[:, None] * self.direction)


@fault("difference_of_pressures", "force", 3)
class DifferenceOfPressures(Plain):
    """p_j / rho_j^2 - p_i / rho_i^2 where there should be a sum: pairs push in one direction."""

    def force(self) -> Array:
        share = self.p / self.rho**2
        push = -self.mass * (share[self.j] - share[self.i]) * self.slope(self.r)
        return self.total_vector(push[:, None] * self.direction)


@fault("poly6_gradient", "force", 8)
class Poly6Gradient(Plain):
    """The gradient of poly6 for pressure: it vanishes where particles touch, and they pair."""

    def slope(self, r: Array) -> Array:
        return -24 / (np.pi * self.h**8) * r * np.maximum(self.h**2 - r**2, 0) ** 2


@fault("spiky_10", "force", 8)
class Spiky10(Plain):
    """The spiky gradient has the constant -10 / (pi h^5), a third of what it should be."""

    def slope(self, r: Array) -> Array:
        return super().slope(r) / 3


@fault("spiky_of_3d", "force", 8)
class SpikyOf3d(Plain):
    """The spiky gradient has the constant of three dimensions, -45 / (pi h^6)."""

    def slope(self, r: Array) -> Array:
        return -45 / (np.pi * self.h**6) * np.maximum(self.h - r, 0) ** 2


@fault("coincident_nan", "force", 4)
class CoincidentNan(Plain):
    """Directions are divided by r without a look whether it is zero."""

    def directions(self, d: Array, r: Array) -> Array:
        with np.errstate(invalid="ignore"):
            return d / r[:, None]


@fault("not_normalized", "force", 3)
class NotNormalized(Plain):
    """The direction is not divided by the distance."""

    def directions(self, d: Array, r: Array) -> Array:
        return d


@fault("undivided", "force", 4)
class Undivided(Plain):
    """The force on a volume is taken for an acceleration: the division by rho is missing."""

    def force(self) -> Array:
        return super().force() * self.rho[:, None]


@fault("along_x_only", "force", 3)
class AlongXOnly(Plain):
    """The y component of the force is lost."""

    def force(self) -> Array:
        return super().force() * np.array([1.0, 0.0])


@fault("force_twice", "force", 3)
class ForceTwice(Plain):
    """A loop over all i and j adds each force to both of them, so that it acts twice."""

    def force(self) -> Array:
        return 2 * super().force()


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


@fault("gravity_twice", "force", 3)
class GravityTwice(Plain):
    """Gravity is in the forces twice."""

    def gravity(self) -> Array:
        return 2 * self.case.gravity


@fault("gravity_upwards", "force", 3)
class GravityUpwards(Plain):
    """Gravity has the wrong sign."""

    def gravity(self) -> Array:
        return -self.case.gravity


@fault("gravity_downwards", "force", 3)
class GravityDownwards(Plain):
    """Only the size of gravity is looked at: it always acts downwards."""

    def gravity(self) -> Array:
        return np.array([0.0, -np.hypot(*self.case.gravity)])


@fault("gravity_times_mass", "force", 3)
class GravityTimesMass(Plain):
    """Gravity is multiplied by the mass, but never divided by it."""

    def gravity(self) -> Array:
        return self.mass * self.case.gravity


@fault("negative_viscosity", "viscosity", 7)
class NegativeViscosity(Plain):
    """v_i - v_j instead of v_j - v_i: differences of velocity grow."""

    def viscosity(self) -> Array:
        return -super().viscosity()


@fault("absolute_velocity", "viscosity", 7)
class AbsoluteVelocity(Plain):
    """Viscosity takes -v_i for v_j - v_i: it brakes what moves as a whole."""

    def viscosity(self) -> Array:
        drag = self.case.viscosity * self.case.rho0 * self.mass * self.laplacian(self.r)
        drag /= self.rho[self.i] * self.rho[self.j]
        return -self.total_vector(drag[:, None] * self.v[self.i])


@fault("laplacian_of_3d", "viscosity", 8)
class LaplacianOf3d(Plain):
    """The Laplacian has the constant of three dimensions, 45 / (pi h^6)."""

    def laplacian(self, r: Array) -> Array:
        return 45 / (np.pi * self.h**6) * np.maximum(self.h - r, 0)


@fault("viscosity_twice", "viscosity", 7)
class ViscosityTwice(Plain):
    """Viscosity acts twice, and the fluid is like jelly."""

    def viscosity(self) -> Array:
        return 2 * super().viscosity()


@fault("undivided_viscosity", "viscosity", 7)
class UndividedViscosity(Plain):
    """Viscosity is a force on a volume that isn't divided by rho."""

    def viscosity(self) -> Array:
        return super().viscosity() * self.rho[:, None]


@fault("jelly", "viscosity", 7)
class Jelly(Plain):
    """A viscosity of 0.5 c0 h that can't be turned off."""

    def viscosity(self) -> Array:
        drag = 0.5 * self.c0 * self.h * self.case.rho0 * self.mass * self.laplacian(self.r)
        drag /= self.rho[self.i] * self.rho[self.j]
        return self.total_vector(drag[:, None] * (self.v[self.j] - self.v[self.i]))
