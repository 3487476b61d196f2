"""Sound solvers that choose otherwise than `plain.Plain`: the doctor must not accuse any of them.

`HEALTHY` has a factory for each choice, by name. Here are those that differ in what becomes of
accelerations, and in what is shown; the others are in `healthy_sums.py`.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from sph_gym.doctor.case import Array, Case
from sph_gym.doctor.plain import Plain
from tests.doctor.healthy_sums import (
    ArticleXsph,
    Brute,
    Continuity,
    Cubic,
    Gaussian,
    Inviscid,
    Monaghan,
    MuellerForce,
    Skin,
    Spiky,
    UsualMass,
    Wendland,
)
from tests.doctor.solvers.shared import showing

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
