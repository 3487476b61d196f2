"""Faults of the links "xsph", "integration" and "walls": what becomes of accelerations."""

import numpy as np

from sph_gym.doctor.case import Array
from sph_gym.doctor.faults.registry import fault
from sph_gym.doctor.plain import Plain


@fault("xsph_kicks", "xsph", 7)
class XsphKicks(Plain):
    """XSPH changes the velocities themselves, not only what moves the particles."""

    def advance(self, dt: float) -> None:
        self.v = self.v + dt * self.a
        self.v = self.v + self.xsph()
        self.x = self.x + dt * self.v


@fault("xsph_away", "xsph", 7)
class XsphAway(Plain):
    """XSPH has the wrong sign: it moves a particle away from what its neighbours do."""

    def xsph(self) -> Array:
        return -super().xsph()


@fault("xsph_undivided", "xsph", 7)
class XsphUndivided(Plain):
    """XSPH doesn't divide by the density."""

    def xsph(self) -> Array:
        share = self.case.xsph * self.mass * self.weight(self.r)
        return self.total_vector(share[:, None] * (self.v[self.j] - self.v[self.i]))


@fault("xsph_full", "xsph", 7)
class XsphFull(Plain):
    """XSPH doesn't look at epsilon: it is 1 at all times."""

    def xsph(self) -> Array:
        share = 2 * self.mass * self.weight(self.r) / (self.rho[self.i] + self.rho[self.j])
        return self.total_vector(share[:, None] * (self.v[self.j] - self.v[self.i]))


@fault("xsph_absolute", "xsph", 7)
class XsphAbsolute(Plain):
    """XSPH adds the neighbours' velocities instead of the differences from them."""

    def xsph(self) -> Array:
        share = self.case.xsph * self.mass * self.weight(self.r) / self.rho[self.j]
        return self.total_vector(share[:, None] * self.v[self.j])


@fault("forward_euler", "integration", 3)
class ForwardEuler(Plain):
    """Old velocities move the particles: forward Euler, which feeds every oscillation."""

    def advance(self, dt: float) -> None:
        self.x = self.x + dt * (self.v + self.xsph())
        self.v = self.v + dt * self.a


@fault("late_acceleration", "integration", 3)
class LateAcceleration(Plain):
    """Velocities are changed by the accelerations of the step before."""

    def step(self, dt: float) -> None:
        late = self.a
        self.evaluate()
        present, self.a = self.a, late
        self.advance(dt)
        self.bounce()
        self.a = present


@fault("own_dt", "integration", 3)
class OwnDt(Plain):
    """dt is ignored: every step is 0.2 ms."""

    def advance(self, dt: float) -> None:
        super().advance(2e-4)


@fault("kick_dt_squared", "integration", 3)
class KickDtSquared(Plain):
    """Velocities change by dt^2 a: accelerations had been multiplied by dt already."""

    def advance(self, dt: float) -> None:
        self.v = self.v + dt**2 * self.a
        self.x = self.x + dt * (self.v + self.xsph())


@fault("half_drift", "integration", 3)
class HalfDrift(Plain):
    """Positions are moved by half a step: the second half of a leapfrog is missing."""

    def advance(self, dt: float) -> None:
        self.v = self.v + dt * self.a
        self.x = self.x + dt / 2 * (self.v + self.xsph())


@fault("fading", "integration", 7)
class Fading(Plain):
    """A hundredth of every velocity is lost in every step."""

    def advance(self, dt: float) -> None:
        super().advance(dt)
        self.v = 0.99 * self.v


@fault("gravity_again", "integration", 3)
class GravityAgain(Plain):
    """The step adds gravity, which is in the accelerations already."""

    def advance(self, dt: float) -> None:
        self.v = self.v + dt * self.case.gravity
        super().advance(dt)


@fault("speed_limit", "integration", 3)
class SpeedLimit(Plain):
    """Velocities are cut off at 0.05 c0, so that nothing explodes."""

    def advance(self, dt: float) -> None:
        super().advance(dt)
        speed = np.linalg.norm(self.v, axis=1, keepdims=True)
        self.v = self.v * np.minimum(1.0, 0.05 * self.c0 / np.maximum(speed, 1e-12))


@fault("no_walls", "walls")
class NoWalls(Plain):
    """The box is ignored."""

    def bounce(self) -> None:
        pass


@fault("velocity_kept", "walls")
class VelocityKept(Plain):
    """Walls put particles back but keep their velocities, which go on into the wall."""

    def bounce(self) -> None:
        for axis, side, outward in self.sides():
            self.x[outward * (self.x[:, axis] - side) > 0, axis] = side


@fault("trembles", "walls")
class Trembles(Plain):
    """Walls turn the velocities of all that is outside, but put no particle back."""

    def bounce(self) -> None:
        for axis, side, outward in self.sides():
            self.v[outward * (self.x[:, axis] - side) > 0, axis] *= -0.3


@fault("restitution_of_1_5", "walls")
class RestitutionOf15(Plain):
    """Particles come back from a wall faster than they came."""

    def bounce(self) -> None:
        came = self.v.copy()
        super().bounce()
        for axis, _, outward in self.sides():
            turned = (outward * came[:, axis] > 0) & (self.v[:, axis] != came[:, axis])
            self.v[turned, axis] = -1.5 * came[turned, axis]


@fault("no_right_wall", "walls")
class NoRightWall(Plain):
    """The right side of the box is forgotten."""

    def sides(self) -> list[tuple[int, float, int]]:
        return [side for side in super().sides() if side[::2] != (0, 1)]


@fault("floor_only", "walls")
class FloorOnly(Plain):
    """Only the floor of the box is there."""

    def sides(self) -> list[tuple[int, float, int]]:
        return [side for side in super().sides() if side[::2] == (1, -1)]


@fault("thin_walls", "walls")
class ThinWalls(Plain):
    """Walls are h / 50 thick: what gets farther than that in a step is through."""

    def bounce(self) -> None:
        x, v = self.x.copy(), self.v.copy()
        super().bounce()
        through = np.abs(x - self.x).max(axis=1) > 0.02 * self.h
        self.x[through], self.v[through] = x[through], v[through]


@fault("wrong_component", "walls")
class WrongComponent(Plain):
    """Walls turn the velocity along them instead of the one across."""

    def bounce(self) -> None:
        for axis, side, outward in self.sides():
            outside = outward * (self.x[:, axis] - side) > 0
            self.x[outside, axis] = side
            self.v[outside, 1 - axis] *= -1.0


@fault("all_on_a_line", "walls")
class AllOnALine(Plain):
    """A wall that one particle passes puts all particles onto its line."""

    def bounce(self) -> None:
        for axis, side, outward in self.sides():
            if (outward * (self.x[:, axis] - side) > 0).any():
                self.x[:, axis] = side


@fault("half_walled", "walls")
class HalfWalled(Plain):
    """Walls look at the first half of the particles only."""

    def bounce(self) -> None:
        x, v = self.x.copy(), self.v.copy()
        super().bounce()
        free = np.arange(self.n) >= self.n / 2
        self.x[free], self.v[free] = x[free], v[free]
