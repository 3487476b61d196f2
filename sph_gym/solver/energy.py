"""The energy ledger: how much energy a run may hold, and how much of it is spurious."""

import math
from typing import Any

import numpy as np

from sph_gym.solver.diagnostics import Totals
from sph_gym.solver.gravity import Gravity
from sph_gym.solver.scene import Scene


class Ledger:
    """The energy that a run may hold: the start, plus the work of gravity and of the controls.

    The energy that is neither is an error of the time stepping. It counts as a blow-up when it
    exceeds `TOLERANCE` times the energy at stake: what was there at the start, what gravity and
    the controls brought in, and the weight of the fluid times its own size. Friction, clamped
    pressure and clamping walls only take energy away, so there is no bound from below. A kernel
    pair that isn't matched makes energy of its own, at any time step; the tolerance leaves room
    for that as long as it is clamped or damped.

    A burst may fly apart before it gets there. So it counts as well when more than `HALF` of the
    energy at stake is spurious, `SUDDEN` of it from the last chunk alone, which is at most a
    frame. Measured in the study `stability`: of the runs of its maps, 576 came to more than half,
    all with 0.4 or more at once, and without this rule 9 of them were never reported; the other
    523 meet no part of it. Of its cases at the stable step, one comes to 0.36, and one to more: a
    fluid at rest whose kernels pair, 3e-5 m c0^2 in a frame, against 1e-4 in the least of those
    that fly apart, patches that collide at Mach 0.025; anything slower than `FLOW` is no burst.
    Bursts are not judged where walls move, whose work is not booked.
    """

    TOLERANCE, HALF, SUDDEN = 2.0, 0.5, 0.25
    # Shares of c0: slower than all the fluid moving at this speed, no energy is a burst; and rest.
    FLOW, REST = 0.012, 1e-4

    def __init__(self, totals: Totals, at_stake: float, rest: float, driven: bool = False) -> None:
        """Begin with the totals of the start.

        at_stake: energy at stake besides them; rest: energy that counts as none [J/m]; driven:
        whether walls do work.
        """
        self.expected = totals.kinetic + totals.internal
        self.at_stake = self.expected + at_stake + rest
        quiet = 0.5 * (self.FLOW / self.REST) ** 2 * rest
        self._least_burst = math.inf if driven else quiet
        self.gravity_work = self.deepest = self.control_work = 0.0

    def add_gravity(self, work: float) -> None:
        """Book the work [J/m] that gravity did."""
        self.gravity_work += work
        self.deepest = max(self.deepest, abs(self.gravity_work))

    def add_control(self, work: float) -> None:
        """Book the energy [J/m] that a change of stiffness put into the compressed fluid."""
        self.expected += work
        self.control_work += work
        self.at_stake += abs(work)

    @property
    def stake(self) -> float:
        """The energy at stake so far [J/m]."""
        return self.at_stake + self.deepest

    def surplus(self, totals: Totals) -> float:
        """Return the spurious energy [J/m], negative where friction took more."""
        held = totals.kinetic + totals.internal
        return held - self.expected - self.gravity_work

    def excess(self, totals: Totals) -> float:
        """Return the surplus as a share of the energy at stake."""
        return float(self.surplus(totals) / self.stake)

    def blown(self, totals: Totals, before: float) -> bool:
        """Return whether the surplus is more than can be; before: [J/m] a chunk ago."""
        surplus, stake = self.surplus(totals), self.stake
        excess = surplus / stake
        least_burst = max(self.SUDDEN * stake, self._least_burst)
        burst = excess > self.HALF and surplus - before > least_burst
        return burst or not (math.isfinite(excess) and excess <= self.TOLERANCE)

    def state(self) -> list[float]:
        """Return the numbers of the ledger, for a snapshot."""
        return [self.expected, self.at_stake, self.gravity_work, self.deepest, self.control_work]

    def set_state(self, numbers: list[float]) -> None:
        """Take back the numbers that `state` gave."""
        self.expected, self.at_stake, self.gravity_work, self.deepest, self.control_work = numbers


def make_ledger(scene: Scene, mass: float, totals: Totals) -> Ledger:
    """Return the ledger of a scene with particles of this mass [kg/m].

    At stake are the weight times the size of the fluid, its motion with the speed of the walls,
    and the surface that it may lose.
    """
    fluid_mass = mass * len(np.asarray(scene.x))
    top_speed = 0.0 if scene.walls is None else scene.walls.top_speed
    size = float(np.ptp(np.asarray(scene.x), axis=0).sum()) + scene.dx
    reach = float(np.abs(np.asarray(scene.x)).max()) + size
    weight = 0.0 if scene.effects.field is None else scene.effects.field.strongest(reach)
    surface = 4 * size * (scene.effects.surface_tension or 0.0)
    at_stake = fluid_mass * (weight * size + top_speed**2) + surface
    rest = fluid_mass * (Ledger.REST * scene.fluid.c0) ** 2
    return Ledger(totals, at_stake, rest, driven=top_speed > 0)


class GravityWork:
    """The work of gravity on the fluid of a scene, chunk by chunk.

    power: [W/m] on the state that was looked at last; it belongs to a snapshot. uniform: gravity
    whose work depends on the path of the centre of mass alone, else None.
    """

    def __init__(self, scene: Scene, mass: float) -> None:
        self._field, self._mass, self._n = scene.effects.field, mass, len(np.asarray(scene.x))
        periodic = scene.walls is not None and scene.walls.is_periodic
        is_uniform = isinstance(self._field, Gravity) and not periodic
        self.uniform = self._field if is_uniform else None
        self.power = 0.0

    def look(self, time: float, x: Any, v: Any) -> None:
        """Compute the power on particles at x [m] with velocities v [m/s], (n, 2) each."""
        if self._field is not None:
            x, v = x[: self._n].astype(np.float64), v[: self._n].astype(np.float64)
            self.power = self._mass * float((self._field.on(time, x, v) * v).sum())

    def along_path(self, began: float, now: float, before: Totals, after: Totals) -> float:
        """Return the exact work [J/m] of uniform gravity between two times [s]."""
        assert isinstance(self.uniform, Gravity)
        mean_x, mean_y = self.uniform.mean(began, now)
        path_x, path_y = after.com_x - before.com_x, after.com_y - before.com_y
        return self._mass * self._n * (mean_x * path_x + mean_y * path_y)

    def trapezoidal(self, began: float, now: float, x: Any, v: Any) -> float:
        """Return the work [J/m] since the last look at time `began` [s]; takes another look."""
        power = self.power
        self.look(now, x, v)
        return (now - began) * (power + self.power) / 2
