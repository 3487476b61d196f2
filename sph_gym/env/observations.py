"""Observations: dimensionless numbers or a small picture, none of it from the reference."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sph_gym.controllers.adaptive import NoiseMemory, no_memory
from sph_gym.env.actions import Coordinates
from sph_gym.env.contexts import UNMATCHED, Context
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.stepping import COURANT, FORCE

# Version of the entries, for networks: any change below needs a new one.
VERSION = 2


class Moment(NamedTuple):
    """All that an observation may depend on.

    now, before: `measure` after and before the step; coordinates: of the present controls;
    progress: share of the episode that is over; n_substeps: of the last step; rollbacks: blow-ups
    that were taken back in a row, as a share of how many may be; context: numerics of the scene.
    """

    sim: Simulation
    now: dict[str, float]
    before: dict[str, float]
    coordinates: Coordinates
    progress: float
    n_substeps: int
    rollbacks: float
    context: Context


class Feature(NamedTuple):
    """One entry: bounds and meaning."""

    name: str
    low: float
    high: float
    meaning: str


def _squash(x: float) -> float:
    """Map [0, inf) to [0, 1), and what isn't finite to 1."""
    return x / (1 + x) if math.isfinite(x) else 1.0


def unsquash(y: float) -> float:
    """Return the x of an entry y = x / (1 + x), a large one where the entry is 1."""
    return y / max(1.0 - y, 1e-9)


FEATURES = (
    Feature("progress", 0, 1, "share of the episode that is over"),
    Feature("log_dt", -1, 1, "present coordinate 0, ln(dt c / h) within its range"),
    Feature("log_stiffness", -1, 1, "present coordinate 1"),
    Feature("xsph", -1, 1, "present coordinate 2"),
    Feature("substeps", 0, 1, "ln n / (1 + ln n), n the substeps of the last step"),
    Feature("mach", 0, 1, "s(10 v_max / c)"),
    Feature("max_speed", 0, 1, "s(v_max / U)"),
    Feature("mean_speed", 0, 1, "s(4 v_rms / U)"),
    Feature("flow_speed", 0, 1, "s(99th percentile of the speed without velocity noise / U)"),
    Feature("force_limit", 0, 1, "s(force limit of dt / CFL limit of dt)"),
    Feature("compression", 0, 1, "s(mean of max(rho/rho0 - 1, 0) / 1 %)"),
    Feature("compression_p99", 0, 1, "s(99th percentile of the same / 4 %)"),
    Feature("compression_rate", -1, 1, "tanh(change of the mean in the last step / 1 %)"),
    Feature("clumping", 0, 1, "share closer than 0.6 dx"),
    Feature("spacing", 0, 1, "median distance of nearest neighbours / 2 dx"),
    Feature("kinetic_rate", -1, 1, "tanh(10 x change of v_rms^2 in the last step / U^2)"),
    Feature("sinking", -1, 1, "tanh(4 x vertical velocity of the centre of mass / U)"),
    Feature("height", 0, 1, "s(height of the centre of mass above the lowest particle / size)"),
    Feature("energy_excess", -1, 1, "tanh(spurious energy / energy at stake)"),
    Feature("surface", 0, 1, "share of particles below 0.9 rho0"),
    Feature("free_fall", 0, 1, "share of particles with |a - g| < 0.1 g (0 without gravity)"),
    Feature("noise", 0, 1, "s(mean squared velocity noise / (0.01 U^2))"),
    Feature(
        "noise_share", 0, 1,
        "s(mean squared velocity noise / mean squared velocity / 1 %), both fading sums over the "
        "past; 2 % where nothing is known yet",
    ),
)  # fmt: skip
CONTEXT = (
    Feature("alpha", 0, 1, "s(50 alpha), alpha of the artificial viscosity"),
    Feature("support", 0, 1, "h / (5 dx)"),
    Feature("matched", 0, 1, "1 for kernels that match, 0 for the article's"),
    Feature("laminar_viscosity", 0, 1, "s(100 nu / (h c0))"),
)
ROLLED_BACK = Feature(
    "rollbacks", 0, 1, "blow-ups that were just taken back in a row / how many may be"
)


def _entries(moment: Moment) -> list[float]:
    """Return the values of FEATURES, in their order: in one go, since every step needs them."""
    sim, now, before = moment.sim, moment.now, moment.before
    scene = sim.scene
    speed, size = scene.fluid.c0 / 10, math.sqrt(sim.n_fluid) * scene.dx
    force_limit = FORCE * math.sqrt(scene.h / max(now["max_acceleration"], 1e-12))
    return [
        moment.progress,
        *moment.coordinates.tolist(),
        _squash(math.log(max(moment.n_substeps, 1))),
        _squash(10 * now["mach"]),
        _squash(now["max_speed"] / speed),
        _squash(4 * math.sqrt(now["speed2"]) / speed),
        _squash(now["flow_speed"] / speed),
        _squash(force_limit * sim.sound_speed / (COURANT * scene.h)),
        _squash(100 * now["density_error"]),
        _squash(25 * now["density_error_p99"]),
        math.tanh(100 * (now["density_error"] - before["density_error"])),
        now["clumping"],
        min(now["median_spacing"] / 2, 1.0),
        math.tanh(10 * (now["speed2"] - before["speed2"]) / speed**2),
        math.tanh(4 * now["com_v"] / speed),
        _squash(max(now["com_y"] - now["lowest"], 0.0) / size),
        math.tanh(now["energy_excess"]),
        now["surface"],
        now["adrift"],
        _squash(100 * now["velocity_noise"] / speed**2),
        _squash(100 * now["noise_share"]),
    ]


def _of_context(context: Context) -> list[float]:
    """Return the values of CONTEXT."""
    matched = float(context.kernel != UNMATCHED)
    support = context.support / 5
    return [_squash(50 * context.alpha), support, matched, _squash(100 * context.viscosity)]


def measure(sim: Simulation, before: dict[str, float] | None = None) -> dict[str, float]:
    """Return the diagnostics, and what observations need besides.

    before: of the step before, None at the start.
    """
    numbers = sim.diagnostics()
    mass = sim.mass * sim.n_fluid
    numbers["speed2"] = 2 * numbers["kinetic_energy"] / mass
    numbers["com_v"] = numbers["momentum_y"] / mass
    if before is None:
        memory = no_memory(sim.scene)
    else:
        memory = NoiseMemory(before["past_noise"], before["past_motion"])
    memory = memory.after(numbers["velocity_noise"], numbers["speed2"])
    numbers["past_noise"], numbers["past_motion"] = memory
    numbers["noise_share"] = memory.share
    return numbers


class Features:
    """A bounded float32 vector with one entry per row of FEATURES; s(x) = x / (1 + x).

    U is the scene's velocity scale c0 / 10, its size the square root of the fluid's area.
    rollback: one entry more, `ROLLED_BACK`; context: four entries more, CONTEXT.
    """

    def __init__(self, rollback: bool = False, context: bool = False) -> None:
        self._rollback, self._context = rollback, context
        low, high = ([getattr(feature, side) for feature in self.rows] for side in ("low", "high"))
        self._low, self._high = np.array(low, np.float32), np.array(high, np.float32)

    @property
    def rows(self) -> tuple[Feature, ...]:
        """Bounds and meanings of the entries."""
        more = (ROLLED_BACK,) if self._rollback else ()
        return (*FEATURES, *more, *(CONTEXT if self._context else ()))

    def space(self) -> spaces.Box:
        """Return Box((23,), float32), with one entry more for `rollback`, four for `context`."""
        return spaces.Box(self._low, self._high, dtype=np.float32)

    def observe(self, moment: Moment) -> NDArray[Any]:
        """Return the vector for the present state."""
        numbers = _entries(moment)
        if self._rollback:
            numbers.append(moment.rollbacks)
        if self._context:
            numbers += _of_context(moment.context)
        values = np.array(numbers, np.float32)
        np.maximum(values, self._low, out=values)
        return np.minimum(values, self._high, out=values)


class Channel(NamedTuple):
    """One channel of a picture."""

    name: str
    meaning: str


CHANNELS = (
    Channel("density", "share of a cell that is filled, 128 for all of it"),
    Channel("velocity_x", "mean horizontal velocity v of its particles, 128 + 127 tanh(v / U)"),
    Channel("velocity_y", "the same of the vertical one, upwards positive"),
    Channel(
        "controls",
        "four bands from top to bottom, progress and the three action coordinates, 0 to 255 for "
        "their range",
    ),
)


class Field:
    """A picture for networks with convolutions: (4, 36, 36) uint8, channels, rows from the top.

    CHANNELS tells what they show, with U = c0 / 10. The picture spans the fluid's start and the
    walls; what leaves it isn't seen. rollback: progress shares its band with the blow-ups in a
    row, left and right.
    """

    SIZE = 36

    def __init__(self, rollback: bool = False) -> None:
        self._rollback = rollback

    def space(self) -> spaces.Box:
        """Return Box(0, 255, (4, 36, 36), uint8)."""
        return spaces.Box(0, 255, (len(CHANNELS), self.SIZE, self.SIZE), np.uint8)

    def observe(self, moment: Moment) -> NDArray[Any]:
        """Return the picture of the present state."""
        sim, size = moment.sim, self.SIZE
        scene, fluid, n = sim.scene, sim.engine.fluid, sim.n_fluid
        low, extent = _frame(scene)
        column = np.floor((fluid.x[:n] - low[0]) * (size / extent[0]))
        row = np.floor((low[1] + extent[1] - fluid.y[:n]) * (size / extent[1]))
        inside = (column >= 0) & (column < size) & (row >= 0) & (row < size)
        place = (row[inside] * size + column[inside]).astype(np.int64)
        count = np.bincount(place, minlength=size * size)
        picture = np.empty((len(CHANNELS), size, size))
        flat = picture.reshape(len(CHANNELS), size * size)
        flat[0] = 128 * count * scene.dx**2 / (extent[0] * extent[1] / size**2)
        for channel, velocity in ((1, fluid.u), (2, fluid.v)):
            mean = np.bincount(place, velocity[:n][inside], size * size) / np.maximum(count, 1)
            flat[channel] = 128 + 127 * np.tanh(mean / (scene.fluid.c0 / 10))
        shares = (moment.progress, *((moment.coordinates + 1) / 2))
        for band, share in enumerate(shares):
            picture[3, band * size // 4 : (band + 1) * size // 4] = 255 * share
        if self._rollback:
            picture[3, : size // 4, size // 2 :] = 255 * moment.rollbacks
        return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def _frame(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lower left corner and the size [m] of the pictures of a scene."""
    places = [np.asarray(scene.x)]
    if scene.walls is not None and scene.walls.particles is not None:
        places.append(np.asarray(scene.walls.particles))
    low = np.min([x.min(axis=0) for x in places], axis=0) - scene.dx / 2
    high = np.max([x.max(axis=0) for x in places], axis=0) + scene.dx / 2
    if len(places) == 1:
        # in empty space, the fluid may spread to twice its size
        low, high = low - (high - low) / 2, high + (high - low) / 2
    return low, high - low


TYPES: dict[str, Callable[..., Features | Field]] = {
    "features": Features,
    "field": Field,
    "features+context": partial(Features, context=True),
}
