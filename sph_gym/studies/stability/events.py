"""What must have happened by the end of a case, so that nobody passes by standing still."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from sph_gym.scenes import hydrostatic_tank
from sph_gym.solver.simulation import Simulation


class Event(NamedTuple):
    """Something that must have happened, and how much of it.

    title, unit: of its row; measure: of a simulation at the start and of the one that has run;
    full, quick: the least of it by the end of the whole run and of the quick one.
    """

    title: str
    unit: str
    measure: Callable[[Simulation, Simulation], float]
    full: float
    quick: float


def _state(sim: Simulation) -> tuple[Any, Any]:
    """(n, 2) places [m] and velocities [m/s] of the fluid, in double precision."""
    n = sim.n_fluid
    return sim.x[:n].astype(np.float64), sim.v[:n].astype(np.float64)


def _path(start: Simulation, sim: Simulation) -> float:
    (before, _), (after, _) = _state(start), _state(sim)
    return float(np.hypot(*(after - before).T).mean()) / sim.scene.dx


def _straight(start: Simulation, sim: Simulation) -> float:
    (x, v), (after, _) = _state(start), _state(sim)
    # where no force acts, in the time that has passed or, if none has, would have to
    path = v * (sim.time or sim.scene.frame)
    off = np.hypot(*(after - x - path).T)
    return 1.0 - float(off.max() / np.hypot(*path.T).mean())


def _size(sim: Simulation) -> float:
    numbers = sim.diagnostics()
    return math.hypot(numbers["extent_x"], numbers["extent_y"])


def _growth(start: Simulation, sim: Simulation) -> float:
    return _size(sim) / _size(start) - 1.0


def _turn(start: Simulation, sim: Simulation) -> float:
    (_, before), (_, after) = _state(start), _state(sim)
    return float(np.hypot(*(after - before).T).mean())


def _angle(start: Simulation, sim: Simulation) -> float:
    (before, _), (after, _) = _state(start), _state(sim)
    one, other = (x - x.mean(axis=0) for x in (before, after))
    # of complex numbers: the one conjugated, times the other
    cross = (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]).sum()
    return abs(math.atan2(float(cross), float((one * other).sum())))


def _difference(name: str, start: Simulation, sim: Simulation) -> float:
    return sim.diagnostics()[name] - start.diagnostics()[name]


def _fall(start: Simulation, sim: Simulation) -> float:
    return -_difference("com_y", start, sim)


def _mean_speed(start: Simulation, sim: Simulation) -> float:
    return float(np.hypot(*_state(sim)[1].T).mean())


def _floor_pressure(start: Simulation, sim: Simulation) -> float:
    if not sim.time > 0:
        return 0.0
    return 1.0 + hydrostatic_tank.bottom_pressure_error(sim)


# full, quick -> Event
Demand = Callable[[float, float], Event]
moved: Demand = partial(Event, "mean way of a particle", "dx", _path)
straight: Demand = partial(Event, "straightness of the ways", "of them", _straight)
grew: Demand = partial(Event, "growth of the fluid's size", "the start's", _growth)
turned: Demand = partial(Event, "mean change of velocity", "m/s", _turn)
rotated: Demand = partial(Event, "angle turned", "rad", _angle)
fell: Demand = partial(Event, "fall of the centre of mass", "m", _fall)
rose: Demand = partial(Event, "rise of the centre of mass", "m", partial(_difference, "com_y"))
ran: Demand = partial(Event, "way of the front", "m", partial(_difference, "front"))
flowed: Demand = partial(Event, "mean speed", "m/s", _mean_speed)
pressed: Demand = partial(Event, "pressure at the floor", "rho0 g H", _floor_pressure)
