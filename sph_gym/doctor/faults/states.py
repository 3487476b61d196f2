"""Faults of the links "density" and "pressure"."""

import numpy as np

from sph_gym.doctor.case import Array, Case
from sph_gym.doctor.faults.registry import fault
from sph_gym.doctor.plain import Plain


class UsualMass(Plain):
    """A healthy solver whose mass doesn't follow the kernel, and so doesn't hide its mistakes."""

    def calibrated_mass(self) -> float:
        return self.case.rho0 * self.case.dx**2


@fault("no_own_share", "density", 4)
class NoOwnShare(Plain):
    """A particle doesn't count for its own density."""

    def density(self) -> Array:
        return self.mass * self.total(self.weight(self.r))


@fault("own_share_twice", "density", 4)
class OwnShareTwice(Plain):
    """A particle counts twice for its own density: it is in its own list, too."""

    def density(self) -> Array:
        return super().density() + self.mass * self.weight(np.zeros(self.n))


@fault("poly6_of_3d", "density", 8)
class Poly6Of3d(UsualMass):
    """Poly6 has the constant of three dimensions, 315 / (64 pi h^9)."""

    def weight(self, r: Array) -> Array:
        return 315 / (64 * np.pi * self.h**9) * np.maximum(self.h**2 - r**2, 0) ** 3


@fault("twice_the_support", "density", 8)
class TwiceTheSupport(Plain):
    """h is taken for a smoothing length: everything reaches as far as 2 h."""

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        self.h = 2 * case.h
        self.mass = self.calibrated_mass()
        self.evaluate()


@fault("half_the_support", "density", 8)
class HalfTheSupport(Plain):
    """The density kernel ends at h / 2."""

    def weight(self, r: Array) -> Array:
        h = self.h / 2
        return 4 / (np.pi * h**8) * np.maximum(h**2 - r**2, 0) ** 3


@fault("r_for_its_square", "density", 8)
class RForItsSquare(UsualMass):
    """The density kernel is given r where it expects the square of r."""

    def weight(self, r: Array) -> Array:
        return 4 / (np.pi * self.h**8) * np.maximum(self.h**2 - r, 0) ** 3


@fault("twice_the_mass", "density", 4)
class TwiceTheMass(Plain):
    """Particles have twice the mass that belongs to their spacing."""

    def calibrated_mass(self) -> float:
        return 2 * super().calibrated_mass()


@fault("mass_of_one", "density", 4)
class MassOfOne(Plain):
    """Particles have the mass 1, whatever rho0 and dx are."""

    def calibrated_mass(self) -> float:
        return 1.0


@fault("density_of_the_start", "density", 4)
class DensityOfTheStart(Plain):
    """Densities are computed at the start and never again."""

    def density(self) -> Array:
        return self.rho if hasattr(self, "rho") else super().density()


@fault("density_piles_up", "density", 4)
class DensityPilesUp(Plain):
    """Densities are not set to zero before the sum."""

    def density(self) -> Array:
        return super().density() + getattr(self, "rho", 0.0)


@fault("no_gamma_in_b", "pressure", 6)
class NoGammaInB(Plain):
    """Tait's B is rho0 c0^2, without the division by gamma."""

    def tait_stiffness(self) -> float:
        return self.case.rho0 * self.case.c0**2


@fault("gas_law", "pressure", 6)
class GasLaw(Plain):
    """The textbook gas law, c0^2 (rho - rho0), instead of Tait's equation."""

    def pressure(self) -> Array:
        return np.maximum(self.c0**2 * (self.rho - self.case.rho0), 0.0)


@fault("soft_gas_law", "pressure", 6)
class SoftGasLaw(Plain):
    """The textbook gas law with a constant that somebody else's fluid had, 20 J/kg."""

    def pressure(self) -> Array:
        return np.maximum(20.0 * (self.rho - self.case.rho0), 0.0)


@fault("gamma_of_three", "pressure", 6)
class GammaOfThree(Plain):
    """The exponent of Tait's equation is 3, with the B of 7."""

    def pressure(self) -> Array:
        return np.maximum(self.stiffness * ((self.rho / self.case.rho0) ** 3 - 1), 0.0)


@fault("no_clamp", "pressure", 5)
class NoClamp(Plain):
    """Pressures below zero are kept, and suck particles together at the surface."""

    def pressure(self) -> Array:
        return self.stiffness * ((self.rho / self.case.rho0) ** self.case.gamma - 1)


@fault("clamp_from_above", "pressure", 5)
class ClampFromAbove(NoClamp):
    """The clamp has the wrong sign: min(0, p) leaves only the suction."""

    def pressure(self) -> Array:
        return np.minimum(super().pressure(), 0.0)


@fault("absolute_pressure", "pressure", 5)
class AbsolutePressure(NoClamp):
    """|p| instead of max(0, p): what should be torn apart is pushed apart."""

    def pressure(self) -> Array:
        return np.abs(super().pressure())


@fault("no_minus_one", "pressure", 6)
class NoMinusOne(Plain):
    """Tait's equation without its - 1: fluid at rest is under pressure."""

    def pressure(self) -> Array:
        return self.stiffness * (self.rho / self.case.rho0) ** self.case.gamma


@fault("ratio_upside_down", "pressure", 6)
class RatioUpsideDown(Plain):
    """rho0 / rho instead of rho / rho0: thin fluid pushes, dense fluid doesn't."""

    def pressure(self) -> Array:
        ratio = self.case.rho0 / self.rho
        return np.maximum(self.stiffness * (ratio**self.case.gamma - 1), 0.0)


@fault("pressure_of_the_step_before", "pressure", 4)
class PressureOfTheStepBefore(Plain):
    """Pressures are computed before the densities, from those of the step before."""

    def density(self) -> Array:
        present = super().density()
        self.before = getattr(self, "rho", present)
        return present

    def pressure(self) -> Array:
        present, self.rho = self.rho, self.before
        late, self.rho = super().pressure(), present
        return late
