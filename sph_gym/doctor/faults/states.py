"""Faults of the links "density" and "pressure"."""

import numpy as np

from sph_gym.doctor.case import Array, Case
from sph_gym.doctor.faults.registry import fault, replaces
from sph_gym.doctor.plain import Plain


class UsualMass(Plain):
    """A healthy solver whose mass doesn't follow the kernel, and so doesn't hide its mistakes."""

    def calibrated_mass(self) -> float:
        return self.case.rho0 * self.case.dx**2


@replaces("density", "density", 4)
def no_own_share(solver: Plain) -> Array:
    """A particle doesn't count for its own density."""
    return solver.mass * solver.total(solver.weight(solver.r))


@replaces("density", "density", 4)
def own_share_twice(solver: Plain) -> Array:
    """A particle counts twice for its own density: it is in its own list, too."""
    return Plain.density(solver) + solver.mass * solver.weight(np.zeros(solver.n))


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


@replaces("weight", "density", 8)
def half_the_support(solver: Plain, r: Array) -> Array:
    """The density kernel ends at h / 2."""
    h = solver.h / 2
    return 4 / (np.pi * h**8) * np.maximum(h**2 - r**2, 0) ** 3


@fault("r_for_its_square", "density", 8)
class RForItsSquare(UsualMass):
    """The density kernel is given r where it expects the square of r."""

    def weight(self, r: Array) -> Array:
        return 4 / (np.pi * self.h**8) * np.maximum(self.h**2 - r, 0) ** 3


@replaces("calibrated_mass", "density", 4)
def twice_the_mass(solver: Plain) -> float:
    """Particles have twice the mass that belongs to their spacing."""
    return 2 * Plain.calibrated_mass(solver)


@replaces("calibrated_mass", "density", 4)
def mass_of_one(solver: Plain) -> float:
    """Particles have the mass 1, whatever rho0 and dx are."""
    return 1.0


@replaces("density", "density", 4)
def density_of_the_start(solver: Plain) -> Array:
    """Densities are computed at the start and never again."""
    return solver.rho if hasattr(solver, "rho") else Plain.density(solver)


@replaces("density", "density", 4)
def density_piles_up(solver: Plain) -> Array:
    """Densities are not set to zero before the sum."""
    return Plain.density(solver) + getattr(solver, "rho", 0.0)


@replaces("tait_stiffness", "pressure", 6)
def no_gamma_in_b(solver: Plain) -> float:
    """Tait's B is rho0 c0^2, without the division by gamma."""
    return solver.case.rho0 * solver.case.c0**2


@replaces("pressure", "pressure", 6)
def gas_law(solver: Plain) -> Array:
    """The textbook gas law, c0^2 (rho - rho0), instead of Tait's equation."""
    return np.maximum(solver.c0**2 * (solver.rho - solver.case.rho0), 0.0)


@replaces("pressure", "pressure", 6)
def soft_gas_law(solver: Plain) -> Array:
    """The textbook gas law with a constant that somebody else's fluid had, 20 J/kg."""
    return np.maximum(20.0 * (solver.rho - solver.case.rho0), 0.0)


@replaces("pressure", "pressure", 6)
def gamma_of_three(solver: Plain) -> Array:
    """The exponent of Tait's equation is 3, with the B of 7."""
    return np.maximum(solver.stiffness * ((solver.rho / solver.case.rho0) ** 3 - 1), 0.0)


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


@replaces("pressure", "pressure", 6)
def no_minus_one(solver: Plain) -> Array:
    """Tait's equation without its - 1: fluid at rest is under pressure."""
    return solver.stiffness * (solver.rho / solver.case.rho0) ** solver.case.gamma


@replaces("pressure", "pressure", 6)
def ratio_upside_down(solver: Plain) -> Array:
    """rho0 / rho instead of rho / rho0: thin fluid pushes, dense fluid doesn't."""
    ratio = solver.case.rho0 / solver.rho
    return np.maximum(solver.stiffness * (ratio**solver.case.gamma - 1), 0.0)


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
