"""Actions and the controls that they ask for: settings, steps, or one of 27 choices.

All modes share the same coordinates in [-1, 1]^3:

    0  log of the Courant multiple dt c / h, COURANT from -1 to +1
    1  log of the sound speed c, SOUND times the scene's nominal c0; the stiffness is rho0 c^2/gamma
    2  XSPH epsilon, XSPH, linear

The seconds of dt follow from the multiple and the stiffness chosen with it.
"""

import math
import operator
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sph_gym.controllers.rules import viscous_rate
from sph_gym.solver.checks import known
from sph_gym.solver.scene import Scene
from sph_gym.solver.state import Controls

# Version of what actions mean, for networks: a change of any range below, of FRICTION or of the
# viscous rate needs a new one.
VERSION = 2
COURANT = (0.2, 1.25)
SOUND = (0.1, 1.25)
XSPH = (0.0, 1.0)
# Share of the viscous rate that a stable action makes room for, as the tuned rule does.
FRICTION = 0.75
LOG_COURANT, LOG_SOUND = ((math.log(low), math.log(high)) for low, high in (COURANT, SOUND))
# How far an action may be beyond its bounds. `RescaleAction` of Gymnasium computes in single
# precision: of 40,000 ends of random spaces within [-5, 6], 0.5 % are off by more than 1e-6, none
# by more than 4.7e-6.
ROUNDING = 5e-6
# Largest change of a coordinate in one step of the modes "delta" and "discrete".
STEP = 0.25
# (27, 3) change of every coordinate by a discrete action, in multiples of STEP.
MOVES = np.array(np.unravel_index(np.arange(27), (3, 3, 3))).T - 1


class Coordinate(NamedTuple):
    """Meaning of a coordinate: the quantity that is `low` at -1 and `high` at +1."""

    name: str
    quantity: str
    low: float
    high: float
    scale: str
    meaning: str


COORDINATES = (
    Coordinate(
        "log dt", "dt c / h", *COURANT, "log",
        "time step as a multiple of the time a sound wave takes across the support radius h; "
        "c is the sound speed chosen with it",
    ),
    Coordinate(
        "log stiffness", "c / c0", *SOUND, "log",
        "sound speed in multiples of the scene's nominal one; the stiffness is rho0 c^2 / gamma",
    ),
    Coordinate(
        "xsph", "epsilon", *XSPH, "linear",
        "how much of the difference to its neighbours' velocities a particle moves with, besides "
        "its own; does nothing in a scene without XSPH",
    ),
)  # fmt: skip
NAMES = tuple(coordinate.name for coordinate in COORDINATES)

Coordinates = NDArray[np.float64]


def encode(scene: Scene, controls: Controls) -> Coordinates:
    """Return the coordinates of controls, cut off at -1 and 1."""
    c = scene.fluid.sound_speed(controls.stiffness)
    return locate(controls.dt * c / scene.h, c / scene.fluid.c0, controls.xsph)


def locate(courant: float, sound: float, xsph: float) -> Coordinates:
    """Return the coordinates of dt c / h, c / c0 and epsilon, cut off at -1 and 1."""
    numbers = (
        _position(math.log(courant), *LOG_COURANT),
        _position(math.log(sound), *LOG_SOUND),
        _position(xsph, *XSPH),
    )
    return np.array([min(max(number, -1.0), 1.0) for number in numbers])


def decode(scene: Scene, coordinates: Coordinates) -> Controls:
    """Return the controls at coordinates in [-1, 1]^3."""
    courant, sound, xsph = _numbers(coordinates)
    c = scene.fluid.c0 * sound
    return Controls(courant * scene.h / c, scene.fluid.stiffness(c), xsph)


def _numbers(coordinates: Coordinates) -> tuple[float, float, float]:
    """Return dt c / h, c / c0 and epsilon of coordinates."""
    dt, sound, xsph = coordinates.tolist()
    return (
        math.exp(_value(dt, *LOG_COURANT)),
        math.exp(_value(sound, *LOG_SOUND)),
        _value(xsph, *XSPH),
    )


def limit(wanted: Coordinates, present: Coordinates, factor: float | None) -> Coordinates:
    """Return `wanted` with a sound speed within `factor` and 1 / factor times the present one.

    None is no limit.
    """
    if factor is None:
        return wanted
    reach = 2 * math.log(factor) / math.log(SOUND[1] / SOUND[0])
    held = wanted.copy()
    held[1] = min(max(wanted[1], present[1] - reach), present[1] + reach)
    return held


def useful(scene: Scene, factor: float | None) -> tuple[bool, bool, bool]:
    """Return True for coordinates that do anything in a scene; factor: of `limit`, or None."""
    return True, factor != 1.0, scene.effects.xsph


def _position(value: float, low: float, high: float) -> float:
    return 2 * (value - low) / (high - low) - 1


def _value(position: float, low: float, high: float) -> float:
    return low + (position + 1) / 2 * (high - low)


def _box_action(action: Any) -> Coordinates:
    """Return an action as coordinates; what is a rounding beyond the bounds is cut off."""
    try:
        numbers = np.asarray(action)
    except (TypeError, ValueError):
        numbers = np.array(None)
    # numpy would take texts and booleans for numbers
    usable = numbers.shape == (3,) and numbers.dtype.kind in "fiu"
    a, b, c = numbers.tolist() if usable else (math.nan,) * 3
    end = 1.0 + ROUNDING
    if not (-end <= a <= end and -end <= b <= end and -end <= c <= end):
        raise ValueError(
            f"action: expected 3 finite numbers in [-1, 1] ({', '.join(NAMES)}), got {action!r}"
        )
    # for three numbers, calls of numpy are what takes time
    return np.array([min(max(value, -1.0), 1.0) for value in (a, b, c)])


def _choice(action: Any) -> int:
    try:
        number = -1 if isinstance(action, bool) else operator.index(action)
    except TypeError:
        number = -1
    if not 0 <= number < 27:
        raise ValueError(f"action: expected an integer from 0 to 26, got {action!r}")
    return number


class Absolute:
    """The action is the coordinates."""

    def space(self) -> spaces.Space[Any]:
        """Return Box(-1, 1, (3,), float32)."""
        return spaces.Box(-1.0, 1.0, (3,), np.float32)

    def act(
        self, action: Any, present: Coordinates, scene: Scene, rate_limit: float | None = None
    ) -> Coordinates:
        """Return the coordinates that the action asks for, within the limit of the sound speed."""
        return limit(_box_action(action), present, rate_limit)

    def toward(self, wanted: Coordinates, present: Coordinates, scene: Scene) -> Any:
        """Return the action that comes closest to wanted coordinates."""
        return wanted.astype(np.float32)


class Stable(Absolute):
    """Absolute, but entry 0 is the multiple m in dt = m / (c / h + f), where f is for friction.

    So a number asks for an equally safe step in every fluid. f is 0.75 times the viscous rate of
    the scene (`sph_gym.controllers.rules.viscous_rate`): the tuned rule plays m = 0.75.
    """

    def act(
        self, action: Any, present: Coordinates, scene: Scene, rate_limit: float | None = None
    ) -> Coordinates:
        """Return the coordinates that the action asks for, within the limit of the sound speed.

        The multiple dt c / h can't be below its range. So where friction asks for less, c rises as
        far as m needs, for m below twice the end of the range as far as that would need. Where the
        limit holds c back, the step is longer than m asks for, until c has risen.
        """
        multiple, sound, xsph = _numbers(_box_action(action))
        friction, lowest = _friction(scene), COURANT[0]
        softest = friction * lowest / (max(multiple, 2 * lowest) - lowest)
        sound = min(max(sound, softest), SOUND[1])
        if rate_limit is not None:
            within = limit(locate(lowest, sound, xsph), present, rate_limit)
            _, sound, _ = _numbers(within)
        return locate(max(multiple / (1 + friction / sound), lowest), sound, xsph)

    def toward(self, wanted: Coordinates, present: Coordinates, scene: Scene) -> Any:
        """Return the action that comes closest to wanted coordinates."""
        courant, sound, xsph = _numbers(wanted)
        return locate(courant * (1 + _friction(scene) / sound), sound, xsph).astype(np.float32)


def _friction(scene: Scene) -> float:
    """Return what friction adds to c / h in the step of a stable action, in multiples of c0 / h."""
    return FRICTION * viscous_rate(scene) * scene.h / scene.fluid.c0


class Delta:
    """The action moves the present coordinates by up to STEP."""

    def space(self) -> spaces.Space[Any]:
        """Return Box(-1, 1, (3,), float32)."""
        return spaces.Box(-1.0, 1.0, (3,), np.float32)

    def act(
        self, action: Any, present: Coordinates, scene: Scene, rate_limit: float | None = None
    ) -> Coordinates:
        """Return the coordinates that the action asks for, within the limit of the sound speed."""
        wanted = np.clip(present + STEP * _box_action(action), -1.0, 1.0)
        return limit(wanted, present, rate_limit)

    def toward(self, wanted: Coordinates, present: Coordinates, scene: Scene) -> Any:
        """Return the action that comes closest to wanted coordinates."""
        return np.clip((wanted - present) / STEP, -1.0, 1.0).astype(np.float32)


class Discrete:
    """27 actions: each coordinate down, as it is, or up by STEP; 13 changes nothing."""

    def space(self) -> spaces.Space[Any]:
        """Return Discrete(27): 9 a + 3 b + c with a, b, c in 0, 1, 2 for the three coordinates."""
        return spaces.Discrete(27)

    def act(
        self, action: Any, present: Coordinates, scene: Scene, rate_limit: float | None = None
    ) -> Coordinates:
        """Return the coordinates that the action asks for, within the limit of the sound speed."""
        wanted = np.clip(present + STEP * MOVES[_choice(action)], -1.0, 1.0)
        return limit(wanted, present, rate_limit)

    def masks(
        self, present: Coordinates, useful: tuple[bool, bool, bool] = (True, True, True)
    ) -> NDArray[np.bool_]:
        """Return (27,) True for actions that do something that no other one does.

        A coordinate at its end can't be moved beyond it, and one that isn't `useful` does
        nothing: moving it and leaving it are the same.
        """
        beyond = (MOVES > 0) & (present >= 1.0) | (MOVES < 0) & (present <= -1.0)
        idle = (MOVES != 0) & ~np.array(useful)
        return np.asarray(~(beyond | idle).any(axis=1))

    def toward(self, wanted: Coordinates, present: Coordinates, scene: Scene) -> Any:
        """Return the action that comes closest to wanted coordinates."""
        moves = np.clip(np.rint((wanted - present) / STEP), -1, 1).astype(int) + 1
        return np.int64(np.ravel_multi_index(tuple(moves), (3, 3, 3)))


MODES: dict[str, type[Absolute] | type[Delta] | type[Discrete]] = {
    "absolute": Absolute,
    "stable": Stable,
    "delta": Delta,
    "discrete": Discrete,
}


def make(mode: str) -> Absolute | Delta | Discrete:
    """Return an action type by its name. Raises ValueError that lists the known ones."""
    return MODES[known("action_mode", mode, MODES)]()
