"""What an agent sees: 20 dimensionless numbers from the running solver, none from the reference."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sph_gym.env.actions import Coordinates
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.stepping import COURANT, FORCE


class Glance(NamedTuple):
    """All that a feature may look at.

    now, before: diagnostics after and before the step; speed, size: scales [m/s], [m]; elevation:
    of the centre of mass above the lowest particle [m]; falling, surface: shares of the particles;
    force_limit: force limit of dt / CFL limit of dt.
    """

    now: dict[str, float]
    before: dict[str, float]
    coordinates: Coordinates
    progress: float
    n_substeps: int
    speed: float
    size: float
    elevation: float
    falling: float
    surface: float
    force_limit: float


class Feature(NamedTuple):
    """One entry: bounds, meaning, and how it is computed."""

    name: str
    low: float
    high: float
    meaning: str
    value: Callable[[Glance], float]


def _squash(x: float) -> float:
    """[0, inf) -> [0, 1); 1 where x isn't finite."""
    return x / (1 + x) if math.isfinite(x) else 1.0


FEATURES = (
    Feature("progress", 0, 1, "share of the episode that is over", lambda g: g.progress),
    Feature("log_dt", -1, 1, "present action coordinate 0", lambda g: g.coordinates[0]),
    Feature("log_stiffness", -1, 1, "present action coordinate 1", lambda g: g.coordinates[1]),
    Feature("xsph", -1, 1, "present action coordinate 2", lambda g: g.coordinates[2]),
    Feature(
        "substeps", 0, 1, "ln n / (1 + ln n), n the substeps of the last step",
        lambda g: _squash(math.log(max(g.n_substeps, 1))),
    ),
    Feature("mach", 0, 1, "s(10 v_max / c)", lambda g: _squash(10 * g.now["mach"])),
    Feature("max_speed", 0, 1, "s(v_max / U)", lambda g: _squash(g.now["max_speed"] / g.speed)),
    Feature(
        "mean_speed", 0, 1, "s(4 v_rms / U)",
        lambda g: _squash(4 * math.sqrt(g.now["speed2"]) / g.speed),
    ),
    Feature(
        "force_limit", 0, 1, "s(force limit of dt / CFL limit of dt)",
        lambda g: _squash(g.force_limit),
    ),
    Feature(
        "compression", 0, 1, "s(mean of max(rho/rho0 - 1, 0) / 1 %)",
        lambda g: _squash(100 * g.now["density_error"]),
    ),
    Feature(
        "compression_p99", 0, 1, "s(99th percentile of the same / 4 %)",
        lambda g: _squash(25 * g.now["density_error_p99"]),
    ),
    Feature(
        "compression_rate", -1, 1, "tanh(change of the mean in the last step / 1 %)",
        lambda g: math.tanh(100 * (g.now["density_error"] - g.before["density_error"])),
    ),
    Feature("clumping", 0, 1, "share closer than 0.6 dx", lambda g: g.now["clumping"]),
    Feature(
        "spacing", 0, 1, "median distance of nearest neighbours / 2 dx",
        lambda g: min(g.now["median_spacing"] / 2, 1.0),
    ),
    Feature(
        "kinetic_rate", -1, 1, "tanh(10 x change of v_rms^2 in the last step / U^2)",
        lambda g: math.tanh(10 * (g.now["speed2"] - g.before["speed2"]) / g.speed**2),
    ),
    Feature(
        "sinking", -1, 1, "tanh(4 x vertical velocity of the centre of mass / U)",
        lambda g: math.tanh(4 * g.now["com_v"] / g.speed),
    ),
    Feature(
        "height", 0, 1, "s(height of the centre of mass above the lowest particle / size)",
        lambda g: _squash(max(g.elevation, 0.0) / g.size),
    ),
    Feature(
        "energy_excess", -1, 1, "tanh(energy from nowhere / energy at stake)",
        lambda g: math.tanh(g.now["energy_excess"]),
    ),
    Feature("surface", 0, 1, "share of particles below 0.9 rho0", lambda g: g.surface),
    Feature(
        "free_fall", 0, 1, "share of particles with |a - g| < 0.1 g (0 without gravity)",
        lambda g: g.falling,
    ),
)  # fmt: skip


class Features:
    """A bounded float32 vector with one entry per row of FEATURES; s(x) = x / (1 + x).

    U is the scene's velocity scale c0 / 10, its size the square root of the fluid's area.
    """

    def __init__(self) -> None:
        low, high = ([getattr(feature, side) for feature in FEATURES] for side in ("low", "high"))
        self._low, self._high = np.array(low, np.float32), np.array(high, np.float32)

    def space(self) -> spaces.Box:
        """Box((20,), float32)."""
        return spaces.Box(self._low, self._high, dtype=np.float32)

    def look(self, sim: Simulation) -> dict[str, float]:
        """The diagnostics and what the features need besides."""
        numbers = sim.diagnostics()
        mass = sim.mass * sim.n_fluid
        numbers["speed2"] = 2 * numbers["kinetic_energy"] / mass
        numbers["com_v"] = numbers["momentum_y"] / mass
        return numbers

    def observe(
        self,
        sim: Simulation,
        now: dict[str, float],
        before: dict[str, float],
        coordinates: Coordinates,
        progress: float,
        n_substeps: int,
    ) -> NDArray[np.float32]:
        """The vector for the present state."""
        scene, n = sim.scene, sim.n_fluid
        acceleration, rho = sim.a[:n], sim.rho[:n]
        g = scene.effects.gravity_at(sim.time)
        pull = float(np.hypot(*g))
        adrift = np.hypot(*(acceleration - g).T) < 0.1 * pull
        limit = FORCE * math.sqrt(scene.h / max(now["max_acceleration"], 1e-12))
        glance = Glance(
            now,
            before,
            coordinates,
            progress,
            n_substeps,
            speed=scene.fluid.c0 / 10,
            size=math.sqrt(n) * scene.dx,
            elevation=now["com_y"] - float(sim.x[:n, 1].min()),
            falling=float(adrift.mean()) if pull > 0 else 0.0,
            surface=float(np.mean(rho < 0.9 * scene.fluid.rho0)),
            force_limit=limit * sim.sound_speed / (COURANT * scene.h),
        )
        values = np.array([feature.value(glance) for feature in FEATURES], np.float32)
        return np.clip(values, self._low, self._high)
