"""A passive guard for runs of any length: `watch(solver)` behaves like the solver.

Before the first step and after every step it looks at what the solver shows, keeps the last states,
and stops at the first value that can't be, while the trace is still warm.
"""

import math
import os
import warnings
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym.blowups import explain
from sph_gym.files import atomic_write, target_path
from sph_gym.provenance import VERSION
from sph_gym.solver.offender import Limits, Offender, State, find, neighborhood
from sph_gym.solver.simulation import Simulation
from sph_gym.trajectory import stored_parameters

# Number of states that are kept.
KEPT = 100
# The most bytes that they may take; of large states fewer are kept.
ROOM = 2**30
# Defaults of the limits: speeds of sound, [m/s] if it isn't known, largest densities of the start.
MACH, TOP_SPEED, DENSE = 10.0, 5000.0, 10.0
# Neighbours within so many distances of the nearest ones.
AROUND = 3.0
NAMES = ("x", "v", "rho", "p", "a")
# Numbers of a solver that help whoever looks at the states: they are written down if it has them.
CONSTANTS = ("dx", "h", "rho0", "c0", "gamma", "stiffness")


class WatchedMoment(NamedTuple):
    """A state, and when it was.

    step: 0 is the start; time: [s]; controls: dt [s], stiffness [Pa] and xsph, NaN where the solver
    doesn't tell.
    """

    step: int
    time: float
    controls: tuple[float, float, float]
    state: State


class Told(Offender):
    """An offender whose `limit` says all of it in words."""

    __slots__ = ()

    def __str__(self) -> str:
        return self.limit


class Tripped(Exception):
    """A value that can't be.

    offender: particle, link, quantity and value; step: the first is 1, 0 stands for the start;
    time: [s] since the watch began; around: lines about the particle and its neighbours, one step
    before where positions aren't finite any more; moments: the last states, the bad one last,
    unless it has another number of particles.
    """

    def __init__(
        self, offender: Offender, moments: list[WatchedMoment], step: int, time: float
    ) -> None:
        self.offender, self.moments, self.step, self.time = offender, moments, step, time
        self.around = _around(offender, moments)
        self.parameters: dict[str, Any] = {}
        when = f"step {step}" if step else "before the first step"
        head = f"{when} (t = {time:.6g} s): {offender}"
        super().__init__("\n".join([head, *self.around]))

    def __reduce__(self) -> Any:
        return type(self), (self.offender, self.moments, self.step, self.time), self.__dict__

    @property
    def particle(self) -> int:
        """Return the index of the particle."""
        return self.offender.particle

    @property
    def link(self) -> str:
        """Return the link of the chain in which it showed."""
        return self.offender.link

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the states to a .npz that `sph_gym.trajectory.read` opens.

        Raises ValueError for another suffix.
        """
        with atomic_write(_npz(path)) as draft:
            np.savez_compressed(draft, **_arrays(self))


def watch(
    solver: Any,
    path: str | os.PathLike[str] | None = None,
    limits: Limits | None = None,
    callback: Callable[[Tripped], None] | None = None,
) -> Any:
    """Return an object that behaves like the solver, and looks at it before and after steps.

    What the solver shows before its first step is looked at when that is called for, so that a bad
    start isn't laid to the step.

    solver: one of the doctor's protocol (x, v, step(dt), and rho, p, a if it shows them), or a
    `Simulation`, which is looked at after every `advance`.
    path: of a .npz with the last 100 states, written when something is found; `trajectory.read`
    opens it. limits: what is sane; by default 10 times the speed of sound if the solver tells it
    (`c0`), else 5000 m/s; 10 times the largest density after the first step; no box. Densities of
    zero and less, and values that are not finite, never are.
    callback: is given the `Tripped`, once, and the run goes on; by default, it is raised.

    Raises ValueError for a path that doesn't end with .npz, for limits that are none, and for what
    has no step, x or v; FileNotFoundError if the folder of the path is missing.
    """
    if path is not None:
        target_path("path", _npz(path))
    if limits is not None and not isinstance(limits, Limits):
        raise ValueError(f"limits: expected Limits, got {limits!r}")
    if not any(callable(getattr(solver, name, None)) for name in ("step", "advance")):
        raise ValueError(f"solver: expected one with step(dt), got {type(solver).__name__}")
    return _Watched(solver, _Guard(solver, path, limits, callback))


class _Watched:
    """Passes everything on to the solver; `step` and `advance` look at it before and after."""

    def __init__(self, solver: Any, guard: "_Guard") -> None:
        object.__setattr__(self, "_solver", solver)
        object.__setattr__(self, "_guard", guard)

    def step(self, *arguments: Any, **named: Any) -> Any:
        self._guard.look_at_start()
        result = self._solver.step(*arguments, **named)
        given = arguments[0] if arguments else named.get("dt")
        self._guard.look(math.nan if given is None else given)
        return result

    def advance(self, seconds: float, *rest: Any, **named: Any) -> Any:
        self._guard.look_at_start()
        result = self._solver.advance(seconds, *rest, **named)
        self._guard.look(seconds, result)
        return result

    def __getattr__(self, name: str) -> Any:
        # copy and pickle ask before there is a solver
        if name in ("_solver", "_guard"):
            raise AttributeError(name)
        return getattr(self._solver, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._solver, name, value)

    def __dir__(self) -> list[str]:
        return dir(self._solver)


class _Guard:
    """The memory of a watched solver, and all that it is asked."""

    def __init__(self, solver: Any, path: Any, limits: Limits | None, callback: Any) -> None:
        self._solver, self._path, self._callback = solver, path, callback
        self._limits, self._given = limits or Limits(), limits is not None
        self._step, self._time, self._alert = 0, 0.0, True
        start = self._state()
        size = sum(column.nbytes for column in start if column is not None)
        self._moments: deque[WatchedMoment] = deque(maxlen=max(2, min(KEPT, ROOM // max(size, 1))))
        self._moments.append(WatchedMoment(0, 0.0, self._controls(math.nan), start))

    def look_at_start(self) -> None:
        """Look at the solver before its first step; later, do nothing."""
        if self._step > 0 or not self._alert:
            return
        # it may have been changed since the watch began
        start = self._state()
        self._moments[0] = WatchedMoment(0, 0.0, self._controls(math.nan), start)
        offender = find(_computed(start), self._limits)
        if offender is not None:
            self._trip(offender._replace(link="setup"))

    def look(self, dt: float, report: Any = None) -> None:
        """Look at the solver after a step of dt seconds; report: what a Simulation returned."""
        self._step, self._time = self._step + 1, self._time + float(dt)
        if not self._alert:
            return
        state = self._state()
        if self._step == 1 and not self._given:
            self._limits = _limits(self._solver, state)
        offender = _another_number(self._moments[-1].state, state)
        if offender is None:
            offender = self._reported(state, report)
            self._moments.append(WatchedMoment(self._step, self._time, self._controls(dt), state))
            offender = offender or find(state, self._limits)
        if offender is not None:
            self._trip(offender)

    def _state(self) -> State:
        n = self._solver.n_fluid if isinstance(self._solver, Simulation) else None
        # the acceleration of a Simulation would have to be computed
        names = NAMES[:4] if n is not None else NAMES
        columns = {name: _column(getattr(self._solver, name, None), name, n) for name in names}
        if columns["x"] is None or columns["v"] is None:
            raise ValueError("solver: expected one with positions x and velocities v")
        if columns["rho"] is not None and not columns["rho"].any():
            columns["rho"] = None  # not computed yet
        return State(**columns)

    def _controls(self, dt: float) -> tuple[float, float, float]:
        if isinstance(self._solver, Simulation):
            dt, stiffness, xsph = self._solver.controls
            return dt, stiffness, xsph
        return float(dt), math.nan, math.nan

    def _reported(self, state: State, report: Any) -> Offender | None:
        """Return what a Simulation says about a blow-up; its state is then the last finite one."""
        if report is None or not getattr(report, "diverged", False):
            return None
        i = report.bad_particle
        text = f"{explain(report)}. The last states are the finite ones before it"
        return Told(i, report.link, "x", state.x[i], text)

    def _trip(self, offender: Offender) -> None:
        self._alert = False
        tripped = Tripped(offender, list(self._moments), self._step, self._time)
        tripped.parameters = _parameters(self._solver)
        if self._path is not None:
            try:
                tripped.save(self._path)
            except OSError as error:
                # what was found must not be lost with it
                warnings.warn(f"the last states were not written: {error}", stacklevel=3)
        if self._callback is None:
            raise tripped
        self._callback(tripped)


def _column(value: Any, name: str, n: int | None) -> Any:
    """Return a copy of a column as numbers, None if the solver doesn't show it."""
    if value is None or callable(value):
        return None
    array = np.array(value)
    if array.dtype.kind != "f":
        array = array.astype(np.float64)
    if name in ("rho", "p") and array.ndim == 2:
        array = array[:, 0]
    return array if n is None else array[:n]


def _limits(solver: Any, state: State) -> Limits:
    c = getattr(solver, "sound_speed", None) or getattr(solver, "c0", None)
    speed = MACH * float(c) if isinstance(c, int | float | np.number) else TOP_SPEED
    density = math.inf
    if state.rho is not None and np.isfinite(state.rho).all() and len(state.rho):
        density = DENSE * float(state.rho.max())
    return Limits(speed, density)


def _another_number(before: State, state: State) -> Offender | None:
    if state.x.shape == before.x.shape:
        return None
    text = (
        f"the solver shows {len(state.x)} particles, one step before it showed {len(before.x)}. "
        "It has to show the same particles in the same order at all times: let those that leave "
        "stay in the arrays, and leave out those that come in later"
    )
    return Told(-1, "setup", "x", float("nan"), text)


def _computed(state: State) -> State:
    """Return the state without columns of which no value is a number: those aren't computed yet."""

    def numbers(column: Any) -> Any:
        return None if column is None or np.isnan(column).all() else column

    return state._replace(rho=numbers(state.rho), p=numbers(state.p), a=numbers(state.a))


def _around(offender: Offender, moments: list[WatchedMoment]) -> list[str]:
    if offender.particle < 0:
        return []
    state, lines = moments[-1].state, []
    if not np.isfinite(state.x).all() and len(moments) > 1:
        state, lines = moments[-2].state, ["one step before:"]
    distance = np.hypot(*(state.x - state.x[offender.particle]).T)
    distance = np.sort(distance[np.isfinite(distance)])[1:7]
    reach = AROUND * float(np.median(distance)) if len(distance) else math.inf
    return lines + neighborhood(state, offender.particle, reach)


# --- the file -------------------------------------------------------------------------------


def _npz(path: str | os.PathLike[str]) -> Path:
    if Path(path).suffix != ".npz":
        raise ValueError(f"path: expected one that ends with .npz, got {str(path)!r}")
    return Path(path)


def _parameters(solver: Any) -> dict[str, Any]:
    found: dict[str, Any] = {"solver": type(solver).__name__}
    if isinstance(solver, Simulation):
        return found | {"scene": solver.scene, "dtype": solver.dtype, "mass": solver.mass}
    for name in CONSTANTS:
        value = getattr(solver, name, None)
        if isinstance(value, int | float | np.number) and math.isfinite(value):
            found[name] = float(value)
    return found


def _arrays(tripped: Tripped) -> dict[str, Any]:
    """Return the arrays of the file, as `sph_gym.trajectory` reads them."""
    states = [moment.state for moment in tripped.moments]
    n = len(states[-1].x)
    arrays: dict[str, Any] = {
        "times": np.array([moment.time for moment in tripped.moments]),
        "controls": np.array([moment.controls for moment in tripped.moments]),
    }
    for name in NAMES:
        columns = [getattr(state, name) for state in states]
        if columns[-1] is not None:
            empty = np.full_like(columns[-1], math.nan)
            arrays[f"fields/{name}"] = np.stack([empty if c is None else c for c in columns])
    parameters = tripped.parameters | {
        "n_fluid": n,
        "n_particles": n,
        "kind": np.zeros(n, np.uint8),
        "tripped": {
            "step": tripped.step,
            "particle": tripped.particle,
            "link": tripped.link,
            "quantity": tripped.offender.quantity,
            "message": str(tripped),
        },
        "sph_gym": VERSION,
    }
    return arrays | stored_parameters(parameters)
