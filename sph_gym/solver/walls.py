"""The walls that a scene names: boundary particles, a box, plates, motion, periodic directions."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sph_gym.solver.checks import finite_array, in_range, known
from sph_gym.solver.confinement import Stroke
from sph_gym.solver.state import Floats

SIDES = ("left", "right", "bottom", "top")
PRESSURES = ("like fluid", "extrapolated")
SLIPS = ("no-slip", "free-slip")


@dataclass(frozen=True, eq=False)
class Motion:
    """Walls that move: by velocity t + amplitude sin(2 pi frequency t) from where they began.

    velocity: (u, v) [m/s]; amplitude: (x, y) [m]; frequency [Hz]; particles: (n,) which boundary
    particles move, by default all; sides: of the box, any of "left", "right", "bottom", "top".

    Raises ValueError for wrong shapes, unknown sides and a motion that is none.
    """

    velocity: tuple[float, float] = (0.0, 0.0)
    amplitude: tuple[float, float] = (0.0, 0.0)
    frequency: float = 0.0
    particles: ArrayLike | None = None
    sides: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("velocity", "amplitude"):
            vector = finite_array(f"walls.motion.{name}", getattr(self, name), (2,))
            object.__setattr__(self, name, tuple(map(float, vector)))
        frequency = in_range("walls.motion.frequency", self.frequency, 0.0)
        object.__setattr__(self, "frequency", frequency)
        if not any(self.velocity) and not (any(self.amplitude) and frequency):
            raise ValueError("walls.motion: expected a velocity, or an amplitude and a frequency")
        if isinstance(self.sides, str) or not isinstance(self.sides, Iterable):
            raise ValueError(f"walls.motion.sides: expected a tuple, got {self.sides!r}")
        sides = tuple(known("walls.motion.sides", side, SIDES) for side in self.sides)
        object.__setattr__(self, "sides", sides)
        if self.particles is not None:
            try:
                moves = np.array(self.particles)
            except ValueError:
                moves = np.array(self.particles, dtype=object)
            if moves.dtype != bool or moves.ndim != 1:
                raise ValueError(
                    "walls.motion.particles: expected (n,) True or False, one for every boundary "
                    f"particle, got an array of {moves.dtype} of shape {moves.shape}"
                )
            object.__setattr__(self, "particles", moves)

    def stroke(self) -> Stroke:
        """The numbers that the compiled loop takes."""
        sides = (float(side in self.sides) for side in SIDES)
        return Stroke(*self.velocity, *self.amplitude, 2 * math.pi * self.frequency, *sides)

    @property
    def top_speed(self) -> float:
        """The largest speed [m/s] that the walls reach."""
        return math.hypot(*self.velocity) + 2 * math.pi * self.frequency * math.hypot(
            *self.amplitude
        )


@dataclass(frozen=True, eq=False)
class Walls:
    """The walls of a scene; what is left out costs nothing.

    particles: (n, 2) positions of boundary particles [m]; they take part in density and pressure,
    and in viscosity unless they are "free-slip", but not in XSPH.
    pressure: of boundary particles, "like fluid" (the article's: they have a density and a pressure
    of their own), or "extrapolated" from the fluid (Adami, Hu, Adams 2012, eq. 27), which also
    mirrors the velocity that viscosity sees at "no-slip" walls (eq. 23).
    slip: of boundary particles, "no-slip" or "free-slip". velocity: (2,) or (n, 2) [m/s] of walls
    that slide along themselves, as a lid or a belt. motion: of walls that move, as a piston.
    box: (x_min, x_max, y_min, y_max) [m], infinite where a side is open: a particle that passes
    a side is clamped to it, and the normal part of its velocity is reflected; without boundary
    particles behind it, a side also mirrors the fluid, and clamps dx / 10 before itself.
    plates: ((x0, y0, x1, y1), ...) segments [m] that no path crosses, however fast; not even one
    that a moving side of the box pushes along: what is between the two stays before the plate.
    Those that enclose the fluid, without boundary particles, mirror it (`mirroring_plates`).
    restitution: share of the normal speed that is left after a reflection, 0 to 1.
    period_x, period_y: (low, high) [m] where space closes upon itself; at least 4 h long, and
    farther than anything moves in a step. Boundary particles and plates begin within them.

    Raises ValueError for positions that are not finite and of shape (n, 2), n >= 1, for a box
    that isn't four numbers in order, for plates without length, for unknown names, for a
    restitution outside [0, 1], for boundary particles and plates outside a periodic domain, and
    for what would do nothing: pressure and slip without particles, a side across a periodic axis.
    """

    particles: ArrayLike | None = None
    box: tuple[float, float, float, float] | None = None
    restitution: float = 0.0
    pressure: str = "like fluid"
    slip: str = "no-slip"
    velocity: ArrayLike | None = None
    motion: Motion | None = None
    plates: ArrayLike | None = None
    period_x: tuple[float, float] | None = None
    period_y: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        known("walls.pressure", self.pressure, PRESSURES)
        known("walls.slip", self.slip, SLIPS)
        restitution = in_range("walls.restitution", self.restitution, 0.0, 1.0)
        object.__setattr__(self, "restitution", restitution)
        if self.particles is not None:
            self._set_array("particles", ("n", 2))
            if len(np.asarray(self.particles)) == 0:
                raise ValueError("walls.particles: expected at least one position, got none")
        self._check_velocity()
        self._check_motion()
        if self.box is not None:
            object.__setattr__(self, "box", _checked_box(self.box))
        if self.plates is not None:
            self._set_array("plates", ("n", 4))
            _check_plates(np.asarray(self.plates))
        for name in ("period_x", "period_y"):
            if getattr(self, name) is not None:
                ends = finite_array(f"walls.{name}", getattr(self, name), (2,))
                if not ends[0] < ends[1]:
                    raise ValueError(f"walls.{name}: expected (low, high), got {tuple(ends)}")
                object.__setattr__(self, name, tuple(map(float, ends)))
        self._check_use()
        self._check_periods()

    def _check_use(self) -> None:
        """Refuse what would do nothing without boundary particles."""
        if self.particles is not None:
            return
        for name, default in (("pressure", PRESSURES[0]), ("slip", SLIPS[0])):
            value = getattr(self, name)
            if value != default:
                raise ValueError(
                    f"walls.{name}: expected walls.particles that are {value!r}, got none"
                )

    def _check_periods(self) -> None:
        """Refuse what is outside a periodic domain, or would bound it."""
        for axis, name in enumerate(("period_x", "period_y")):
            ends = getattr(self, name)
            if ends is None:
                continue
            if self.box is not None and any(map(math.isfinite, self.box[2 * axis : 2 * axis + 2])):
                raise ValueError(
                    f"walls.box: expected infinite sides across walls.{name}, got {self.box}"
                )
            if self.particles is not None:
                place = np.asarray(self.particles)[:, axis]
                if place.min() < ends[0] or place.max() >= ends[1]:
                    raise ValueError(
                        f"walls.particles: expected positions in walls.{name} = [{ends[0]:g}, "
                        f"{ends[1]:g}), got {place.min():g} to {place.max():g}"
                    )
            if self.plates is not None:
                place = np.asarray(self.plates)[:, axis::2]
                if place.min() < ends[0] or place.max() > ends[1]:
                    raise ValueError(
                        f"walls.plates: expected ends in walls.{name} = [{ends[0]:g}, "
                        f"{ends[1]:g}], got {place.min():g} to {place.max():g}"
                    )

    def _set_array(self, name: str, shape: tuple[Any, ...]) -> None:
        array = finite_array(f"walls.{name}", getattr(self, name), shape)
        array.flags.writeable = False
        object.__setattr__(self, name, array)

    def _check_velocity(self) -> None:
        if self.velocity is None:
            return
        if self.particles is None:
            raise ValueError("walls.velocity: expected walls.particles that have it, got none")
        n = len(np.asarray(self.particles))
        if np.shape(np.asarray(self.velocity, dtype=object)) == (2,):
            velocity = finite_array("walls.velocity", self.velocity, (2,))
            object.__setattr__(self, "velocity", np.tile(velocity, (n, 1)))
        self._set_array("velocity", (n, 2))

    def _check_motion(self) -> None:
        if self.motion is None:
            return
        if not isinstance(self.motion, Motion):
            raise ValueError(f"walls.motion: expected Motion(...), got {self.motion!r}")
        if self.particles is None and not self.motion.sides:
            raise ValueError("walls.motion: expected walls.particles or sides that move, got none")
        if self.motion.sides and self.box is None:
            raise ValueError("walls.motion.sides: expected a walls.box that has them, got none")
        chosen = self.motion.particles
        if chosen is not None:
            n = 0 if self.particles is None else len(np.asarray(self.particles))
            if np.shape(chosen) != (n,):
                raise ValueError(
                    f"walls.motion.particles: expected shape ({n},), got {np.shape(chosen)}"
                )

    @property
    def is_periodic(self) -> bool:
        """True if space closes upon itself in any direction."""
        return self.period_x is not None or self.period_y is not None

    def mirrored_sides(self, h: float) -> tuple[float, ...] | None:
        """Return the sides of the box [m] that no boundary particle stands for; None if none.

        x_min, x_max, y_min, y_max, infinite where one stands within h [m] behind the side.
        """
        if self.box is None:
            return None
        sides = np.array(self.box)
        if self.particles is not None:
            x, low, high = np.asarray(self.particles), sides[::2], sides[1::2]
            within = (x > low) & (x < high)
            for axis in range(2):
                beside = x[within[:, 1 - axis], axis]
                for k, beyond in ((0, low[axis] - beside), (1, beside - high[axis])):
                    if ((beyond > 0) & (beyond < h)).any():
                        sides[2 * axis + k] = (-1, 1)[k] * math.inf
        return tuple(sides.tolist()) if np.isfinite(sides).any() else None

    def unbacked(self, dx: float, h: float) -> NDArray[np.bool_]:
        """Return (n,) which particles, dx [m] apart, have neither a plate nor the box before them.

        An obstacle within a box has neither, unless plates are within h [m] of all its particles.
        """
        if self.particles is None:
            return np.zeros(0, bool)
        x = np.asarray(self.particles)
        unbacked = np.ones(len(x), bool)
        if self.box is not None:
            low, high = np.array(self.box[::2]), np.array(self.box[1::2])
            # those at the box stand half a spacing behind it
            unbacked &= ((x > low + dx / 4) & (x < high - dx / 4)).all(axis=1)
        for plate in () if self.plates is None else np.asarray(self.plates):
            unbacked &= _distance(x, plate[:2], plate[2:]) > h
        return unbacked

    @property
    def moves(self) -> Floats:
        """(n,) 1 for boundary particles that move, else 0."""
        n = 0 if self.particles is None else len(np.asarray(self.particles))
        if self.motion is None:
            return np.zeros(n)
        chosen = self.motion.particles
        return np.ones(n) if chosen is None else np.asarray(chosen, float)

    @property
    def velocities(self) -> Floats:
        """(n, 2) [m/s] of boundary particles, without their motion."""
        n = 0 if self.particles is None else len(np.asarray(self.particles))
        return np.zeros((n, 2)) if self.velocity is None else np.asarray(self.velocity)

    @property
    def top_speed(self) -> float:
        """The largest speed [m/s] of any boundary particle."""
        sliding = float(np.hypot(*self.velocities.T).max(initial=0.0))
        return sliding + (0.0 if self.motion is None else self.motion.top_speed)


def _checked_box(box: Any) -> tuple[float, ...]:
    try:
        sides = tuple(float(side) for side in box)
    except (TypeError, ValueError, OverflowError):
        sides = ()
    if len(sides) != 4 or not (sides[0] < sides[1] and sides[2] < sides[3]):
        raise ValueError(
            "walls.box: expected (x_min, x_max, y_min, y_max) with x_min < x_max and "
            f"y_min < y_max, got {box!r}"
        )
    return sides


def _check_plates(plates: Floats) -> None:
    if len(plates) == 0:
        raise ValueError("walls.plates: expected at least one segment, got none")
    lengths = np.hypot(*(plates[:, 2:] - plates[:, :2]).T)
    if not (lengths > 0).all():
        bad = int(np.argmin(lengths))
        raise ValueError(f"walls.plates: expected segments with a length, got {plates[bad]}")


def _distance(x: Floats, start: Floats, end: Floats) -> Floats:
    """(n,) of the points x (n, 2) from the segment between two others [m]."""
    along = end - start
    share = np.clip((x - start) @ along / (along @ along), 0.0, 1.0)
    gap = x - start - share[:, None] * along
    return np.hypot(*gap.T)
