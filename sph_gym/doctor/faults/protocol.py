"""Faults of the link "setup": solvers that don't do what the protocol asks for."""

import time

import numpy as np

from sph_gym.doctor.case import Array, Case
from sph_gym.doctor.faults.registry import fault
from sph_gym.doctor.plain import Plain


class Wrapped:
    """A solver behind an adapter, which shows positions and velocities."""

    def __init__(self, case: Case) -> None:
        self.solver = Plain(case)

    @property
    def x(self) -> Array:
        """Return positions [m]."""
        return self.solver.x

    @property
    def v(self) -> Array:
        """Return velocities [m/s]."""
        return self.solver.v

    def step(self, dt: float) -> None:
        """Do a time step of dt seconds."""
        self.solver.step(dt)


@fault("no_velocities", "setup")
class NoVelocities:
    """The adapter shows no v."""

    def __init__(self, case: Case) -> None:
        self.solver = Plain(case)
        self.x, self.step = self.solver.x, self.solver.step


@fault("transposed", "setup")
class Transposed(Wrapped):
    """The adapter shows x as (2, n) instead of (n, 2)."""

    @property
    def x(self) -> Array:
        return self.solver.x.T


@fault("fixed_time_step", "setup")
class FixedTimeStep(Wrapped):
    """The adapter's step() takes no dt."""

    def step(self) -> None:  # type: ignore[override]
        self.solver.step(self.solver.case.dt)


@fault("sorted_particles", "setup")
class SortedParticles(Plain):
    """Particles are sorted by cell in every step, all columns alike, and shown in that order."""

    def step(self, dt: float) -> None:
        super().step(dt)
        order = np.lexsort(self.cells().T)
        self.x, self.v = self.x[order], self.v[order]
        self.evaluate()


@fault("deleted_particles", "setup")
class DeletedParticles(Plain):
    """Particles that have lost all their neighbours are deleted as spray."""

    def step(self, dt: float) -> None:
        super().step(dt)
        kept = self.total(np.ones(len(self.i))) > 0
        self.x, self.v, self.n = self.x[kept], self.v[kept], int(kept.sum())
        self.evaluate()


@fault("lonely_crash", "setup")
class LonelyCrash(Plain):
    """A particle without neighbours ends in an IndexError."""

    def density(self) -> Array:
        for i in range(self.n):
            self.neighbors(i)[0]
        return super().density()


@fault("nan_from_start", "setup")
class NanFromStart(Plain):
    """Velocities are never set and begin as NaN."""

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        self.v = np.full_like(case.v, np.nan)


@fault("endless_step", "setup")
class EndlessStep(Plain):
    """A step searches on and on for something that is not there."""

    def step(self, dt: float) -> None:
        while (self.r < self.h).all():
            time.sleep(0.01)
