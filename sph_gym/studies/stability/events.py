"""Events that must have happened by the end of a case, so that none passes by standing still."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from sph_gym.scenes import hydrostatic_tank
from sph_gym.solver.simulation import Simulation


class RunMoment(NamedTuple):
    """A simulation at one moment: positions x and velocities v (n, 2) [m, m/s], diagnostics."""

    sim: Simulation
    x: Any
    v: Any
    numbers: dict[str, float]


def see(sim: Simulation) -> RunMoment:
    """Return the fluid of a simulation as it is now, in double precision."""
    x, v = (column[: sim.n_fluid].astype(np.float64) for column in (sim.x, sim.v))
    return RunMoment(sim, x, v, sim.diagnostics())


class Event(NamedTuple):
    """Something that must have happened, so that no case passes by standing still.

    title, unit: of its row; measure: of the start and the end to how much of it has happened;
    full, quick: the least of it by the end of the whole run and of the quick one.
    """

    title: str
    unit: str
    measure: Callable[[RunMoment, RunMoment], float]
    full: float
    quick: float


def _length(vectors: Any) -> Any:
    return np.hypot(*vectors.T)


def _straightness(start: RunMoment, end: RunMoment) -> float:
    # where no force acts, in the time that has passed or, if none has, would have to
    path = start.v * (end.sim.time or end.sim.scene.frame)
    return 1.0 - float(_length(end.x - start.x - path).max() / _length(path).mean())


def _growth(start: RunMoment, end: RunMoment) -> float:
    both = (each.numbers for each in (start, end))
    before, after = (math.hypot(each["extent_x"], each["extent_y"]) for each in both)
    return after / before - 1.0


def _angle(start: RunMoment, end: RunMoment) -> float:
    one, other = (each.x - each.x.mean(axis=0) for each in (start, end))
    # of complex numbers: the one conjugated, times the other
    cross = (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]).sum()
    return abs(math.atan2(float(cross), float((one * other).sum())))


def _floor_pressure(start: RunMoment, end: RunMoment) -> float:
    return 1.0 + hydrostatic_tank.bottom_pressure_error(end.sim) if end.sim.time > 0 else 0.0


def _gain(name: str, sign: int = 1) -> Callable[[RunMoment, RunMoment], float]:
    return lambda start, end: sign * (end.numbers[name] - start.numbers[name])


# Take the bounds `full` and `quick`, and return the event.
moved = partial(
    Event, "mean way of a particle", "dx",
    lambda start, end: float(_length(end.x - start.x).mean()) / end.sim.scene.dx,
)  # fmt: skip
straight = partial(Event, "straightness of the ways", "of them", _straightness)
grew = partial(Event, "growth of the fluid's size", "the start's", _growth)
turned = partial(
    Event, "mean change of velocity", "m/s",
    lambda start, end: float(_length(end.v - start.v).mean()),
)  # fmt: skip
rotated = partial(Event, "angle turned", "rad", _angle)
fell = partial(Event, "fall of the centre of mass", "m", _gain("com_y", -1))
rose = partial(Event, "rise of the centre of mass", "m", _gain("com_y"))
ran = partial(Event, "way of the front", "m", _gain("front"))
flowed = partial(Event, "mean speed", "m/s", lambda start, end: float(_length(end.v).mean()))
pressed = partial(Event, "pressure at the floor", "rho0 g H", _floor_pressure)
