"""Sound solvers that differ from `Plain` in kernels, masses, sums, forces and neighbour search."""

import numpy as np

from sph_gym.doctor.case import Array
from sph_gym.doctor.plain import Indices, Plain

# --- Kernels and masses ---------------------------------------------------------------------


class Wendland(Plain):
    """Wendland's C2 for densities and its derivative for pressure."""

    def weight(self, r: Array) -> Array:
        q = np.minimum(r / self.h, 1)
        return 7 / (np.pi * self.h**2) * (1 - q) ** 4 * (1 + 4 * q)

    def slope(self, r: Array) -> Array:
        q = np.minimum(r / self.h, 1)
        return -140 / (np.pi * self.h**3) * q * (1 - q) ** 3


class UsualMass(Plain):
    """The article's kernels with the mass rho0 dx^2."""

    def calibrated_mass(self) -> float:
        return self.case.rho0 * self.case.dx**2


class Cubic(UsualMass):
    """The cubic spline of smoothing length h / 2, with the mass rho0 dx^2."""

    def weight(self, r: Array) -> Array:
        q = 2 * r / self.h
        shape = np.maximum(2 - q, 0) ** 3 / 4 - np.maximum(1 - q, 0) ** 3
        return 10 / (7 * np.pi * (self.h / 2) ** 2) * shape

    def slope(self, r: Array) -> Array:
        q = 2 * r / self.h
        shape = -3 / 4 * np.maximum(2 - q, 0) ** 2 + 3 * np.maximum(1 - q, 0) ** 2
        return 10 / (7 * np.pi * (self.h / 2) ** 3) * shape


class Gaussian(UsualMass):
    """A Gaussian, cut at three smoothing lengths."""

    def weight(self, r: Array) -> Array:
        s = self.h / 3
        return np.where(r < self.h, np.exp(-((r / s) ** 2)) / (np.pi * s**2), 0.0)

    def slope(self, r: Array) -> Array:
        return -2 * r / (self.h / 3) ** 2 * self.weight(r)


class Spiky(Plain):
    """The spiky kernel for densities, too, with a calibrated mass."""

    def weight(self, r: Array) -> Array:
        return 10 / (np.pi * self.h**5) * np.maximum(self.h - r, 0) ** 3


# --- Density and forces ---------------------------------------------------------------------


class Continuity(Wendland):
    """Densities by the continuity equation, and pressures that may be negative."""

    def density(self) -> Array:
        return getattr(self, "rho", np.full(self.n, self.case.rho0))

    def pressure(self) -> Array:
        return self.stiffness * ((self.rho / self.case.rho0) ** self.case.gamma - 1)

    def advance(self, dt: float) -> None:
        super().advance(dt)
        difference = self.v[self.i] - self.v[self.j]
        along = (difference * self.direction).sum(axis=1)
        self.rho = self.rho + dt * self.mass * self.total(along * self.slope(self.r))


class MuellerForce(Plain):
    """Mueller's mean of pressures, in a form that conserves momentum."""

    def force(self) -> Array:
        mean = (self.p[self.i] + self.p[self.j]) / (2 * self.rho[self.i] * self.rho[self.j])
        push = -2 * self.mass * mean * self.slope(self.r)
        return self.total_vector(push[:, None] * self.direction)


class Monaghan(Wendland):
    """Monaghan's artificial viscosity; `case.viscosity` is its alpha."""

    def viscosity(self) -> Array:
        v = self.v[self.i] - self.v[self.j]
        approach = np.minimum((v * self.direction).sum(axis=1), 0.0) * self.r
        mu = self.h / 2 * approach / (self.r**2 + 0.01 * (self.h / 2) ** 2)
        mean = (self.rho[self.i] + self.rho[self.j]) / 2
        push = self.mass * self.case.viscosity * self.c0 * mu / mean * self.slope(self.r)
        return self.total_vector(push[:, None] * self.direction)


class Inviscid(Wendland):
    """No viscosity and no XSPH, whatever the case asks for."""

    def viscosity(self) -> Array:
        return np.zeros_like(self.x)

    xsph = viscosity


class ArticleXsph(Plain):
    """XSPH as the article has it: the neighbour's density, not the mean."""

    def xsph(self) -> Array:
        share = self.case.xsph * self.mass * self.weight(self.r) / self.rho[self.j]
        return self.total_vector(share[:, None] * (self.v[self.j] - self.v[self.i]))


# --- Neighbours -----------------------------------------------------------------------------


class Brute(Plain):
    """No grid: all pairs are looked at."""

    def candidates(self, cells: Indices) -> tuple[Indices, Indices]:
        i, j = np.meshgrid(np.arange(self.n), np.arange(self.n), indexing="ij")
        return i.ravel(), j.ravel()


class Skin(Plain):
    """Lists with a margin of h / 4, made anew before anybody can have come through it."""

    def candidates(self, cells: Indices) -> tuple[Indices, Indices]:
        margin = self.h / 4
        way = np.inf
        if hasattr(self, "listed"):
            way = np.linalg.norm(self.x - self.listed, axis=1).max()
        if not way < margin / 2:
            self.listed = self.x
            d = np.linalg.norm(self.x[:, None] - self.x[None], axis=2)
            self.near = np.nonzero(d < self.h + margin)
        return self.near
