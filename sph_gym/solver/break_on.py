"""Conditions on which a run is to stop: what is looked for in a running simulation, and how."""

import math
from collections.abc import Sequence

import numpy as np

from sph_gym.solver.checks import known
from sph_gym.solver.offender import (
    Box,
    Offender,
    State,
    escaped,
    neighborhood,
    not_finite,
    odd_density,
)
from sph_gym.solver.simulation import Simulation

CONDITIONS = ("nan", "density", "escape")
# Largest sane density [rho0]: Tait's pressure is then 127 B.
DENSEST = 2.0
# A particle has escaped if it is so far beyond the walls [dx].
BEYOND = 1.0


class BreakOn:
    """Looks for the first particle that can't be in a simulation.

    conditions: any of "nan": the run blew up, or a value isn't finite; "density": zero or less, or
    above 2 rho0; "escape": more than dx outside the rectangle of the box and the boundary particles
    at the present time. Above the walls only a side of the box counts: open tanks may splash.

    Raises ValueError for unknown conditions, and for "escape" without walls that could hold.
    """

    def __init__(self, sim: Simulation, conditions: Sequence[str]) -> None:
        self._sim = sim
        self.conditions = [known("break-on", each, CONDITIONS) for each in conditions]
        if "escape" in self.conditions and not np.isfinite(_rectangle(sim)).any():
            raise ValueError(
                "break-on: expected a scene with a box or boundary particles for 'escape', got "
                f"{sim.scene.name!r}"
            )

    def find(self) -> Offender | None:
        """Return the first offender of the present state, in the order of the conditions."""
        sim, state = self._sim, self._state()
        report = sim.last_report
        for condition in self.conditions:
            found = None
            if condition == "density":
                found = odd_density(state, DENSEST * sim.scene.fluid.rho0)
            elif condition == "escape":
                found = escaped(state, _rectangle(sim))
            elif report.diverged:
                i = report.bad_particle
                limit = f"no blow-up; it was caused by {report.cause}"
                return Offender(i, report.link, "x", state.x[i], limit)
            else:
                found = not_finite(state)
            if found is not None:
                return found
        return None

    def describe(self, offender: Offender) -> list[str]:
        """Return lines about the offender and its neighbours within the support, walls too."""
        sim = self._sim
        ends = sim.scene.periods
        periods = [math.inf if each is None else each[1] - each[0] for each in ends]
        state = State(*(np.asarray(each, float) for each in (sim.x, sim.v, sim.rho, sim.p, sim.a)))
        lines = [f"break: t = {sim.time:.6g} s, {offender}"]
        lines += neighborhood(state, offender.particle, sim.scene.h, periods)
        if sim.n_particles > sim.n_fluid:
            lines.append(f"particles from {sim.n_fluid} on are walls")
        return lines

    def _state(self) -> State:
        n, sim = self._sim.n_fluid, self._sim
        return State(sim.x[:n], sim.v[:n], sim.rho[:n], sim.p[:n])


def _rectangle(sim: Simulation) -> Box:
    """Return x_min, x_max, y_min, y_max [m] beyond which a particle has escaped."""
    walls = sim.scene.walls
    inf = math.inf
    if walls is None:
        return -inf, inf, -inf, inf
    low, high = np.array([-inf, -inf]), np.array([inf, inf])
    if walls.box is not None:
        low, high = np.array(walls.box[::2]), np.array(walls.box[1::2])
        if walls.motion is not None and walls.motion.sides:
            low, high = _moved(sim, low, high)
    if walls.particles is not None:
        x = sim.x[sim.n_fluid :]
        low = np.minimum(np.where(np.isinf(low), inf, low), x.min(axis=0))
        high = np.maximum(np.where(np.isinf(high), -inf, high), x.max(axis=0))
        if walls.box is None or math.isinf(walls.box[3]):
            high[1] = inf
    for axis, period in enumerate((walls.period_x, walls.period_y)):
        if period is not None:
            low[axis], high[axis] = -inf, inf
    room = BEYOND * sim.scene.dx
    return low[0] - room, high[0] + room, low[1] - room, high[1] + room


def _moved(sim: Simulation, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the box where its moving sides are now."""
    assert sim.scene.walls is not None
    motion = sim.scene.walls.motion
    assert motion is not None
    swing = math.sin(2 * math.pi * motion.frequency * sim.time)
    way = np.array(motion.velocity) * sim.time + np.array(motion.amplitude) * swing
    sides = motion.sides
    low = low + way * [side in sides for side in ("left", "bottom")]
    high = high + way * [side in sides for side in ("right", "top")]
    return low, high
