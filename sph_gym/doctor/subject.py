"""The solver on the table: every call into it is guarded, everything it shows is checked."""

import inspect
import io
import signal
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.doctor.case import Array, Case

Factory = Callable[[Case], Any]
# One call into a solver may take so long [s], and its making, which may have to compile it.
CALL_LIMIT, MAKE_LIMIT = 60.0, 300.0
_NOTHING = object()


class Misfit(Exception):
    """The solver breaks the protocol: what it did, and what the protocol asks for."""


class Crash(Exception):
    """The solver raised an exception."""


class Unsupported(Exception):
    """The solver's make raised NotImplementedError: it has nothing for this kind of case."""


class Hang(Exception):
    """A call into the solver did not return."""


class Waits(Exception):
    """A check needs steps, and they are broken: the name of the check that found that out."""


class TooSlow(Exception):
    """A check ran out of its time although every call returned."""


class _Alarm(BaseException):
    """No Exception, so that a solver's own `except Exception` lets it pass."""


class SolverUnderTest:
    """A solver that was made for one case.

    All arrays are returned as float64 copies. broken_clock: the check that has found that steps do
    not take dt seconds, after which there are none. Raises Misfit, Crash, Hang or Unsupported.
    """

    def __init__(
        self, factory: Factory, case: Case, deadline: float = float("inf"), broken_clock: str = ""
    ) -> None:
        self.case, self._deadline, self._broken_clock = case, deadline, broken_clock
        self.n_steps = 0
        self._solver = self._call("make(case)", lambda: factory(case.copy()), MAKE_LIMIT)
        if self._solver is None:
            raise Misfit("make(case) returned None; it has to return the solver")
        if not callable(self._fetch("step")):
            raise Misfit("the solver has no method step(dt)")

    @property
    def is_single(self) -> bool:
        """Return whether positions are kept in single precision; what is no array is not."""
        return getattr(self._fetch("x"), "dtype", None) == np.float32

    def step(self, dt: float, n: int = 1) -> "SolverUnderTest":
        """Advance n steps of dt seconds each, and return self."""
        if self._broken_clock:
            raise Waits(self._broken_clock)
        for _ in range(n):
            if time.monotonic() > self._deadline:
                raise TooSlow
            self._call("step(dt)", lambda: self._solver.step(float(dt)))
            self.n_steps += 1
        return self

    def change(self, dt: float, n: int = 1) -> Array:
        """Return dv/dt (n, 2) [m/s^2] over the next n steps of dt seconds each."""
        before = self.v
        return (self.step(dt, n).v - before) / (n * dt)

    @property
    def x(self) -> Array:
        """Return the positions (n, 2) [m]."""
        return self._array("x", 2)

    @property
    def v(self) -> Array:
        """Return the velocities (n, 2) [m/s]."""
        return self._array("v", 2)

    def shows(self, name: str) -> bool:
        """Return whether the solver has this optional attribute or method, and it is not None."""
        return self._fetch(name) is not None

    def get(self, name: str) -> Array:
        """Return "rho" (n,), "p" (n,) or "a" (n, 2) of the last evaluation."""
        return self._array(name, 2 if name == "a" else 1)

    def number(self, name: str) -> float | None:
        """Return "c0" or "stiffness", None if it is not shown."""
        value = self._fetch(name)
        try:
            return None if value is None else float(value)
        except (TypeError, ValueError):
            raise Misfit(f"{name}: expected a number, got {value!r:.60}") from None

    def evaluate(self) -> "SolverUnderTest":
        """Renew rho, p and a for the present positions, and return self."""
        self._call("evaluate()", self._solver.evaluate)
        return self

    def neighbors(self, i: int) -> Array:
        """Return the indices of the neighbours of particle i, as the solver lists them."""
        found = self._call(f"neighbors({i})", lambda: list(self._solver.neighbors(i)))
        try:
            indices = np.array(found if len(found) else np.empty(0, int))
            if indices.dtype.kind not in "iu":
                raise TypeError
            return indices.astype(int).reshape(-1)
        except (TypeError, ValueError):
            raise Misfit(f"neighbors({i}): expected indices, got {found!r:.60}") from None

    def _array(self, name: str, dimensions: int) -> Array:
        n = self.case.n
        wanted = (n, 2) if dimensions == 2 else (n,)
        value = self._fetch(name)
        if value is None:
            raise Misfit(f"the solver has no attribute {name}")
        if callable(value):
            raise Misfit(f"{name} is a method: make it a property (@property) or an attribute")
        try:
            if np.iscomplexobj(value):
                raise TypeError
            array = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise Misfit(f"{name}: expected numbers {wanted}, got {value!r:.60}") from None
        if dimensions == 1 and array.shape == (n, 1):
            array = array[:, 0]
        if array.shape != wanted:
            raise Misfit(
                f"{name}: expected the shape {wanted}, one row a particle of case.x, got "
                f"{array.shape}" + (f" after {self.n_steps} steps" if self.n_steps else "")
            )
        return array

    def _fetch(self, name: str) -> Any:
        """Return an attribute, None if there is none; an error inside of it is the solver's."""
        there = inspect.getattr_static(self._solver, name, _NOTHING) is not _NOTHING
        if there:
            return self._call(name, lambda: getattr(self._solver, name))
        return self._call(name, lambda: getattr(self._solver, name, None))

    def _call(self, name: str, call: Callable[[], Any], limit: float | None = None) -> Any:
        limit = limit or CALL_LIMIT
        try:
            with (
                _time_limit(limit),
                warnings.catch_warnings(),
                np.errstate(all="ignore"),
                redirect_stdout(io.StringIO()),
            ):
                warnings.simplefilter("ignore")
                return call()
        except _Alarm:
            raise Hang(f"{name} did not return within {limit:.0f} s") from None
        except (KeyboardInterrupt, GeneratorExit):
            raise
        except NotImplementedError as error:
            raise Unsupported(f"{name}: {error}".strip(" :")) from error
        except BaseException as error:  # also SystemExit, which no solver may use to leave
            if isinstance(error, Misfit | Crash | Hang | TooSlow):
                raise
            where = _place(error)
            text = f"{type(error).__name__}: {error}".strip().rstrip(":")
            raise Crash(f"{name} raised {text[:200]}{where}") from error


def _place(error: BaseException) -> str:
    """Return the file and line in which an exception was raised, in code that is no library's."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [each for each in frames if "site-packages" not in each.filename and "<" not in
           each.filename and each.filename != __file__]  # fmt: skip
    if not own:
        return ""
    return f" ({Path(own[-1].filename).name}, line {own[-1].lineno})"


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """Raise _Alarm inside the block after so many seconds; only in the main thread of POSIX."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(
        signal, "setitimer"
    ):
        yield
        return

    def ring(*_: Any) -> None:
        raise _Alarm

    before = signal.signal(signal.SIGALRM, ring)
    # again and again, for loops that catch everything
    outer, _ = signal.setitimer(signal.ITIMER_REAL, seconds, 1.0)
    started = time.monotonic()
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        if outer:
            signal.setitimer(signal.ITIMER_REAL, max(outer - (time.monotonic() - started), 1e-3))
