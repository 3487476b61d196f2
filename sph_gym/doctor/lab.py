"""The instruments: what the checks measure of a solver that they can't look into."""

import time
import zlib
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import numpy as np

from sph_gym.doctor.case import Array, Case
from sph_gym.doctor.diagnosis import COLUMNS
from sph_gym.doctor.subject import Factory, SolverUnderTest

# A step so short that nothing moves: this share of the time that sound takes across the support.
TINY = 1e-4
OPTIONAL = (*COLUMNS, "evaluate", "neighbors", "c0", "stiffness")


Subject = TypeVar("Subject")
Measurement = TypeVar("Measurement")


def once(measure: Callable[[Subject], Measurement]) -> Callable[[Subject], Measurement]:
    """Let a function be called once for each lab, or survey: the outcome stays in its `facts`."""
    name = f"{measure.__module__}.{measure.__name__}"

    @wraps(measure)
    def kept(subject: Any) -> Measurement:
        if name not in subject.facts:
            subject.facts[name] = measure(subject)
        return subject.facts[name]

    return kept


class Lab:
    """Makes solvers and measures them; one for all checks of a diagnosis.

    shown: names of `OPTIONAL` that the solver shows, known after the check `adapter`;
    float32: whether it keeps single precision, known after the same; facts: what earlier checks
    have measured, by name, for later ones (such as the measured kernel); broken_clock: the check
    that has found that steps do not take dt seconds, "" if none has.
    """

    def __init__(self, factory: Factory, seed: int = 0) -> None:
        self._factory, self._seed = factory, seed
        self._deadline = float("inf")
        self.shown: frozenset[str] = frozenset()
        self.float32 = False
        self.facts: dict[str, Any] = {}
        self.broken_clock = ""

    def start(self, check: str, seconds: float) -> None:
        """Begin a check: its random numbers, and the time that it has."""
        self.rng = np.random.default_rng([self._seed, zlib.crc32(check.encode())])
        self._deadline = time.monotonic() + seconds

    def make(self, case: Case) -> SolverUnderTest:
        """Return a new solver for the case; its steps raise Waits if the clock is broken."""
        started = time.monotonic()
        subject = SolverUnderTest(self._factory, case, self._deadline, self.broken_clock)
        # a solver that is compiled for the case must not use up the time of the check
        self._deadline += time.monotonic() - started
        return subject

    def course(self, case: Case, dt: float, n_steps: int) -> tuple[Array, Array]:
        """Return x and v (n_steps + 1, n, 2) of a new solver, from the start on."""
        subject = self.make(case)
        states = [(subject.x, subject.v)]
        for _ in range(n_steps):
            subject.step(dt)
            states.append((subject.x, subject.v))
        x, v = zip(*states, strict=True)
        return np.stack(x), np.stack(v)

    def evaluated(self, case: Case) -> SolverUnderTest:
        """Return a new solver that has computed all that it shows for the case's positions."""
        subject = self.make(case)
        if "evaluate" in self.shown:
            return subject.evaluate()
        return subject.step(TINY * case.h / case.c0)

    def seen(self, subject: SolverUnderTest) -> dict[str, Array]:
        """Return all columns that a solver shows: those of the chain, then x and v."""
        found = {name: subject.get(name) for name in COLUMNS if name in self.shown}
        return found | {"x": subject.x, "v": subject.v}

    def density(self, case: Case) -> Array:
        """Return the densities (n,) [kg/m^3] at the case's positions; the solver must show rho."""
        return self.evaluated(case).get("rho")

    def acceleration(self, case: Case) -> Array:
        """Return the accelerations (n, 2) [m/s^2] at the case's positions and velocities.

        Taken from `a` if the solver shows it, else from the change of v.
        """
        return self.evaluated(case).get("a") if "a" in self.shown else self.change_of_velocity(case)

    def change_of_velocity(self, case: Case) -> Array:
        """Return dv/dt (n, 2) [m/s^2] over two tiny steps, after a first one.

        The first step is left out: some solvers know no acceleration yet when they begin.
        """
        dt = TINY * case.h / case.c0
        return self.make(case).step(dt).change(dt, 2)
