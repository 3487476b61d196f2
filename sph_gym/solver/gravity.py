"""Forces on the whole body of the fluid: uniform, central, shaken, recorded, and a rolling tank's.

Each kind is a dataclass that a scene names, the numbers that the compiled loop takes, and the
term. Time-dependent kinds are functions of the simulation's time alone, so that a restored run
feels what the first one felt.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sph_gym.solver.checks import finite_array, in_range, number, positive
from sph_gym.solver.jit import dispatch, jitable
from sph_gym.solver.lanes import like

Array = NDArray[np.float64]


class UniformField(NamedTuple):
    """gx, gy [m/s^2], raised from zero over 1 / inv_ramp seconds (0: all at once)."""

    gx: float
    gy: float
    inv_ramp: float


class CentralField(NamedTuple):
    """omega2 [1/s^2], the centre x, y [m]."""

    omega2: float
    x: float
    y: float


class ShakenField(NamedTuple):
    """gx, gy and amplitudes ax, ay [m/s^2], angular frequency omega [1/s]."""

    gx: float
    gy: float
    ax: float
    ay: float
    omega: float


class RecordedField(NamedTuple):
    """per_second: samples per second; table: (n, 2) [m/s^2]."""

    per_second: float
    table: Any


class RollingField(NamedTuple):
    """g [m/s^2], amplitude [rad], angular frequency omega [1/s], the pivot x, y [m]."""

    g: float
    amplitude: float
    omega: float
    x: float
    y: float


@dispatch
def acceleration(kind: Any, time: Any, x: Any, y: Any, u: Any, v: Any) -> Any:
    """(ax, ay) [m/s^2] at a time [s], a place [m] and a velocity [m/s]."""


@acceleration.member(UniformField)
def _uniform(kind, time, x, y, u, v):
    share = min(time * kind.inv_ramp, 1.0) if kind.inv_ramp > 0.0 else 1.0
    return like(x, kind.gx * share), like(x, kind.gy * share)


@acceleration.member(CentralField)
def _central(kind, time, x, y, u, v):
    strength = like(x, kind.omega2)
    return strength * (like(x, kind.x) - x), strength * (like(x, kind.y) - y)


@acceleration.member(ShakenField)
def _shaken(kind, time, x, y, u, v):
    phase = math.sin(kind.omega * time)
    return like(x, kind.gx + kind.ax * phase), like(x, kind.gy + kind.ay * phase)


@acceleration.member(RecordedField)
def _recorded(kind, time, x, y, u, v):
    last = kind.table.shape[0] - 1
    place = min(max(time * kind.per_second, 0.0), float(last))
    k = min(int(place), last - 1)
    share = place - k
    gx = (1.0 - share) * kind.table[k, 0] + share * kind.table[k + 1, 0]
    gy = (1.0 - share) * kind.table[k, 1] + share * kind.table[k + 1, 1]
    return like(x, gx), like(x, gy)


@acceleration.member(RollingField)
def _rolling(kind, time, x, y, u, v):
    swing = kind.amplitude * math.sin(kind.omega * time)
    rate = kind.amplitude * kind.omega * math.cos(kind.omega * time)
    change = like(x, -kind.omega * kind.omega * swing)
    spin, spin2 = like(x, 2.0 * rate), like(x, rate * rate)
    rx, ry = x - like(x, kind.x), y - like(x, kind.y)
    ax = like(x, -kind.g * math.sin(swing)) + spin * v + spin2 * rx + change * ry
    ay = like(x, -kind.g * math.cos(swing)) - spin * u + spin2 * ry - change * rx
    return ax, ay


@jitable
def add_gravity(effect, time, x, y, u, v, ax, ay):
    """ax, ay and the acceleration by the field, where there is one."""
    if effect is None:
        return ax, ay
    gx, gy = acceleration(effect, time, x, y, u, v)
    return ax + gx, ay + gy


# --- What a scene names ---------------------------------------------------------------------


class _Field:
    """Base of all kinds: their formula, read in Python."""

    def compiled(self) -> Any:
        """The numbers that the compiled loop takes."""
        raise NotImplementedError

    def on(self, time: float, x: Array, v: Array) -> Array:
        """(n, 2) accelerations [m/s^2] of particles at x [m] with velocities v [m/s], (n, 2)."""
        columns = acceleration(self.compiled(), time, *np.asarray(x).T, *np.asarray(v).T)
        return np.stack([np.broadcast_to(column, len(x)) for column in columns], axis=-1)

    def at(self, time: float) -> Array:
        """(2,) the part that is the same everywhere [m/s^2]."""
        return np.array(acceleration(self.compiled(), time, 0.0, 0.0, 0.0, 0.0))

    def lasting(self) -> Array:
        """(2,) average of `at` over a long time [m/s^2]."""
        raise NotImplementedError

    def strongest(self, reach: float) -> float:
        """A bound of its size [m/s^2] within `reach` [m] of the origin."""
        raise NotImplementedError


@dataclass(frozen=True)
class Gravity(_Field):
    """Uniform gravity x, y [m/s^2], raised linearly from zero over the first `ramp` seconds."""

    x: float
    y: float
    ramp: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "x", number("gravity[0]", self.x))
        object.__setattr__(self, "y", number("gravity[1]", self.y))
        object.__setattr__(self, "ramp", in_range("gravity.ramp", self.ramp, 0.0))

    def compiled(self) -> UniformField:
        """See `UniformField`."""
        return UniformField(self.x, self.y, 1 / self.ramp if self.ramp > 0 else 0.0)

    def at(self, time: float) -> Array:
        """(2,) the part that is the same everywhere: all of it [m/s^2]."""
        return super().at(time) if self.ramp > 0 else self.lasting()

    def mean(self, began: float, ended: float) -> tuple[float, float]:
        """Return the mean of the vectors [m/s^2] between two times [s]."""
        if self.ramp == 0:
            return self.x, self.y
        x, y = ((self.at(began) + self.at(ended)) / 2).tolist()
        return x, y

    def lasting(self) -> Array:
        """The vector, once the ramp is over."""
        return np.array([self.x, self.y])

    def strongest(self, reach: float) -> float:
        """Its size once the ramp is over."""
        return math.hypot(self.x, self.y)


@dataclass(frozen=True)
class CentralGravity(_Field):
    """- omega^2 (r - centre): a spring to a point. omega [1/s]; x, y: the centre [m].

    Source: Monaghan & Rafiee 2013, section 6, the oscillating drop.
    """

    omega: float
    x: float = 0.0
    y: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "omega", positive("gravity.omega", self.omega))
        for name in ("x", "y"):
            object.__setattr__(self, name, number(f"gravity.{name}", getattr(self, name)))

    def compiled(self) -> CentralField:
        """See `CentralField`."""
        return CentralField(self.omega**2, self.x, self.y)

    def at(self, time: float) -> Array:
        """Zero: nothing of it is the same everywhere."""
        return np.zeros(2)

    def lasting(self) -> Array:
        """Zero as well."""
        return np.zeros(2)

    def strongest(self, reach: float) -> float:
        """omega^2 times the distance from the centre."""
        return self.omega**2 * (reach + math.hypot(self.x, self.y))


@dataclass(frozen=True)
class ShakenGravity(_Field):
    """x, y + amplitude sin(2 pi frequency t): a tank that is shaken, seen from the tank.

    x, y: gravity [m/s^2]; amplitude: (ax, ay) [m/s^2]; frequency [Hz].
    """

    x: float
    y: float
    amplitude: tuple[float, float]
    frequency: float

    def __post_init__(self) -> None:
        for name in ("x", "y"):
            object.__setattr__(self, name, number(f"gravity.{name}", getattr(self, name)))
        amplitude = finite_array("gravity.amplitude", self.amplitude, (2,))
        object.__setattr__(self, "amplitude", tuple(map(float, amplitude)))
        object.__setattr__(self, "frequency", positive("gravity.frequency", self.frequency))

    def compiled(self) -> ShakenField:
        """See `ShakenField`."""
        return ShakenField(self.x, self.y, *self.amplitude, 2 * math.pi * self.frequency)

    def lasting(self) -> Array:
        """Gravity alone."""
        return np.array([self.x, self.y])

    def strongest(self, reach: float) -> float:
        """Gravity and amplitude, should they point the same way."""
        return math.hypot(self.x, self.y) + math.hypot(*self.amplitude)


@dataclass(frozen=True, eq=False)
class RecordedGravity(_Field):
    """Any history: vectors (n, 2) [m/s^2], n >= 2, one every `interval` [s], linear in between.

    The last one stays in force when the record is over.
    """

    vectors: ArrayLike
    interval: float

    def __post_init__(self) -> None:
        vectors = finite_array("gravity.vectors", self.vectors, ("n", 2))
        if len(vectors) < 2:
            raise ValueError(f"gravity.vectors: expected at least two, got {len(vectors)}")
        vectors.flags.writeable = False
        object.__setattr__(self, "vectors", vectors)
        object.__setattr__(self, "interval", positive("gravity.interval", self.interval))

    def compiled(self) -> RecordedField:
        """See `RecordedField`."""
        # one order in memory, since simulations of one kind share their machine code
        return RecordedField(1 / self.interval, np.array(self.vectors, order="C"))

    def lasting(self) -> Array:
        """The mean of the record."""
        return np.asarray(self.vectors).mean(axis=0)

    def strongest(self, reach: float) -> float:
        """The largest of the record."""
        return float(np.hypot(*np.asarray(self.vectors).T).max())


@dataclass(frozen=True)
class RollingTank(_Field):
    """A tank that rolls by amplitude sin(2 pi frequency t), seen from the tank.

    g: gravity [m/s^2]; amplitude [rad]; frequency [Hz]; pivot: the axis in the tank's
    coordinates [m]. Gravity turns, and the turning frame adds the centrifugal, the Coriolis and
    the Euler acceleration; the walls stand still.
    """

    g: float
    amplitude: float
    frequency: float
    pivot: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "g", in_range("gravity.g", self.g, 0.0))
        object.__setattr__(
            self, "amplitude", in_range("gravity.amplitude", self.amplitude, -math.pi, math.pi)
        )
        object.__setattr__(self, "frequency", positive("gravity.frequency", self.frequency))
        pivot = finite_array("gravity.pivot", self.pivot, (2,))
        object.__setattr__(self, "pivot", tuple(map(float, pivot)))

    def compiled(self) -> RollingField:
        """See `RollingField`."""
        return RollingField(self.g, self.amplitude, 2 * math.pi * self.frequency, *self.pivot)

    def lasting(self) -> Array:
        """Gravity in the tank at rest."""
        return np.array([0.0, -self.g])

    def at(self, time: float) -> Array:
        """Gravity alone, as the tank sees it."""
        swing = self.amplitude * math.sin(2 * math.pi * self.frequency * time)
        return self.g * np.array([-math.sin(swing), -math.cos(swing)])

    def strongest(self, reach: float) -> float:
        """Gravity, and the Euler and centrifugal acceleration at their largest."""
        omega = 2 * math.pi * self.frequency
        arm = reach + math.hypot(*self.pivot)
        turning = abs(self.amplitude) * (1 + abs(self.amplitude)) * omega**2
        return self.g + turning * arm


AnyGravity = Gravity | CentralGravity | ShakenGravity | RecordedGravity | RollingTank
