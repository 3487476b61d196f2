"""Faults of the link "setup": solvers that don't do what the protocol asks for."""

import time

import numpy as np

from sph_gym.doctor.case import Array, Case
from sph_gym.doctor.faults.registry import fault, replaces
from sph_gym.doctor.plain import Plain
from sph_gym.doctor.subject import Factory


class Wrapped:
    """A solver behind an adapter, which shows positions and velocities and nothing else."""

    def __init__(self, case: Case, make: Factory = Plain) -> None:
        self.solver = make(case)

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


@replaces("step", "setup")
def sorted_particles(solver: Plain, dt: float) -> None:
    """Particles are sorted by cell in every step, all columns alike, and shown in that order."""
    Plain.step(solver, dt)
    order = np.lexsort(solver.cells().T)
    solver.x, solver.v = solver.x[order], solver.v[order]
    solver.evaluate()


@replaces("step", "setup")
def deleted_particles(solver: Plain, dt: float) -> None:
    """Particles that have lost all their neighbours are deleted as spray."""
    Plain.step(solver, dt)
    kept = solver.total(np.ones(len(solver.i))) > 0
    solver.x, solver.v, solver.n = solver.x[kept], solver.v[kept], int(kept.sum())
    solver.evaluate()


@replaces("density", "setup")
def lonely_crash(solver: Plain) -> Array:
    """A particle without neighbours ends in an IndexError."""
    for i in range(solver.n):
        solver.neighbors(i)[0]
    return Plain.density(solver)


@fault("nan_from_start", "setup")
class NanFromStart(Plain):
    """Velocities are never set and begin as NaN."""

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        self.v = np.full_like(case.v, np.nan)


@replaces("step", "setup")
def endless_step(solver: Plain, dt: float) -> None:
    """A step searches on and on for something that is not there."""
    while (solver.r < solver.h).all():
        time.sleep(0.01)
