"""Sound solvers that choose otherwise than `plain.Plain`: the doctor must not accuse any of them.

`HEALTHY` has a factory for each choice, by name.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from sph_gym.doctor.case import Array, Case
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


# --- Time -----------------------------------------------------------------------------------


class KickDriftKick(Wendland):
    """Leapfrog: half a kick, a drift, half a kick."""

    def step(self, dt: float) -> None:
        self.v = self.v + dt / 2 * self.a
        self.x = self.x + dt * (self.v + self.xsph())
        self.bounce()
        self.evaluate()
        self.v = self.v + dt / 2 * self.a


class DriftKickDrift(Wendland):
    """Leapfrog: half a drift, a kick, half a drift."""

    def step(self, dt: float) -> None:
        self.x = self.x + dt / 2 * (self.v + self.xsph())
        self.evaluate()
        self.v = self.v + dt * self.a
        self.x = self.x + dt / 2 * (self.v + self.xsph())
        self.bounce()


class Staggered(Wendland):
    """Leapfrog whose velocities are half a step ahead of the positions, but for the first step."""

    begun = False

    def advance(self, dt: float) -> None:
        self.v = self.v + (dt if self.begun else dt / 2) * self.a
        self.x = self.x + dt * (self.v + self.xsph())
        self.begun = True


class Midpoint(Wendland):
    """Runge-Kutta of second order."""

    def step(self, dt: float) -> None:
        self.evaluate()
        x, v = self.x, self.v
        self.x, self.v = x + dt / 2 * (v + self.xsph()), v + dt / 2 * self.a
        self.evaluate()
        self.x, self.v = x + dt * (self.v + self.xsph()), v + dt * self.a
        self.bounce()


class PositionsFirst(Wendland):
    """Symplectic Euler in the other order: drift, then kick with the new accelerations."""

    def step(self, dt: float) -> None:
        self.x = self.x + dt * (self.v + self.xsph())
        self.bounce()
        self.evaluate()
        self.v = self.v + dt * self.a


# --- Walls ----------------------------------------------------------------------------------


class Elastic(Wendland):
    """Walls that mirror what has passed them, and keep all of its speed."""

    def bounce(self) -> None:
        for axis, side, outward in self.sides():
            outside = outward * (self.x[:, axis] - side) > 0
            self.x[outside, axis] = 2 * side - self.x[outside, axis]
            self.v[outside, axis] *= -1


class Penalty(Wendland):
    """Walls that push back with a spring from half a spacing on."""

    def gravity(self) -> Array:
        push = np.zeros_like(self.x) + self.case.gravity
        for axis, side, outward in self.sides():
            reach = self.case.dx / 2 - outward * (side - self.x[:, axis])
            push[:, axis] -= outward * np.maximum(reach, 0.0) * (2 * self.c0 / self.case.dx) ** 2
        return push

    def bounce(self) -> None:
        pass


class Layers:
    """Four layers of boundary particles, a tail of the arrays, of which nothing is shown."""

    def __init__(self, case: Case) -> None:
        self.n = case.n
        tail = np.zeros((0, 2)) if case.box is None else self.behind(case)
        x, v = np.concatenate([case.x, tail]), np.concatenate([case.v, 0 * tail])
        self.tail, self.solver = tail, Wendland(dataclasses.replace(case, x=x, v=v, box=None))

    def behind(self, case: Case) -> Array:
        low, high = case.x.min(axis=0) - 1.0, case.x.max(axis=0) + 1.0
        sides = np.array(case.box).reshape(2, 2).T
        low, high = np.where(np.isfinite(sides), sides, [low, high])
        axes = [
            np.arange(a - 3.5 * case.dx, b + 3.6 * case.dx, case.dx)
            for a, b in zip(low, high, strict=True)
        ]
        places = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        inside = ((places > sides[0]) & (places < sides[1])).all(axis=1)
        return places[~inside]

    def step(self, dt: float) -> None:
        self.solver.step(dt)
        self.solver.x[self.n :], self.solver.v[self.n :] = self.tail, 0.0

    def evaluate(self) -> None:
        self.solver.evaluate()

    def __getattr__(self, name: str) -> Any:
        if name in ("x", "v", "rho", "p", "a"):
            return getattr(self.solver, name)[: self.n]
        raise AttributeError(name)


# --- What is shown --------------------------------------------------------------------------


class Single(Wendland):
    """Single precision, in all that is kept from one evaluation to the next."""

    def evaluate(self) -> None:
        self.x, self.v = np.float32(self.x), np.float32(self.v)
        super().evaluate()
        self.rho, self.p, self.a = np.float32(self.rho), np.float32(self.p), np.float32(self.a)

    def bounce(self) -> None:
        self.x, self.v = np.float32(self.x), np.float32(self.v)
        super().bounce()


class Shown:
    """A solver of which only some attributes are shown."""

    def __init__(self, solver: Any, names: tuple[str, ...]) -> None:
        self._solver, self._names = solver, ("x", "v", "step", *names)

    def __getattr__(self, name: str) -> Any:
        if name in self._names:
            return getattr(self._solver, name)
        raise AttributeError(name)


def showing(make: Callable[[Case], Any], *names: str) -> Callable[[Case], Shown]:
    """Return a factory of solvers that show x, v, step and these names."""
    return lambda case: Shown(make(case), names)


CHOICES = (
    Plain,
    Wendland,
    UsualMass,
    Cubic,
    Gaussian,
    Spiky,
    Continuity,
    MuellerForce,
    Monaghan,
    Inviscid,
    ArticleXsph,
    Brute,
    Skin,
    KickDriftKick,
    DriftKickDrift,
    Staggered,
    Midpoint,
    PositionsFirst,
    Elastic,
    Penalty,
    Layers,
    Single,
)
HEALTHY: dict[str, Callable[[Case], Any]] = {
    **{each.__name__: each for each in CHOICES},
    **{f"{each.__name__}_x_v": showing(each) for each in CHOICES},
    "Plain_rho": showing(Plain, "rho"),
    "Wendland_a": showing(Wendland, "a", "evaluate"),
    "Cubic_rho_p": showing(Cubic, "rho", "p"),
}
