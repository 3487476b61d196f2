"""Start-up of plane Couette flow: a wall that moves along itself draws a fluid with it."""

import math
from typing import Any

import numpy as np

from sph_gym.scenes import channel
from sph_gym.scenes.channel import Array
from sph_gym.scenes.reference import Chart, Reference, Run
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation


def couette(
    dx: float = 1 / 40, height: float = 1.0, speed: float = 1.0, reynolds: float = 10.0
) -> Scene:
    """A fluid at rest between two walls, the upper of which moves from the start on.

    height: between the walls [m], rounded to a multiple of dx; speed: of the upper wall [m/s];
    reynolds: speed height / nu. Periodic along the channel.
    """
    return channel.channel("couette", dx, height, speed, reynolds, pushed=False)


def velocity(y: Array, tau: float) -> Array:
    """u / Umax at y / d, tau = nu t / d^2.

    y + sum over n of 2 / (n pi) (-1)^n sin(n pi y) exp(-n^2 pi^2 tau); at rest at the start,
    where the series converges too slowly. Source: Morris, Fox & Zhu 1997.
    """
    if tau <= 0:
        return np.where(y < 1, 0.0, 1.0)
    n = np.arange(1, channel.TERMS + 1)
    missing = 2 / (n * math.pi) * (-1.0) ** n * np.exp(-((n * math.pi) ** 2) * tau)
    return y + np.sin(np.multiply.outer(y, n * math.pi)) @ missing


def _top(sim: Simulation) -> float:
    """Of the moving wall [m/s]."""
    assert sim.scene.walls is not None
    return sim.scene.walls.top_speed


def error(sim: Simulation) -> float:
    """max |u - u_exact| over all fluid particles [% of Umax]."""
    return channel.deviation(sim, velocity, _top(sim))


def observe(sim: Simulation) -> dict[str, Any]:
    """See `channel.look`."""
    return channel.look(sim, velocity, _top(sim))


def chart(run: Run) -> Chart:
    """Profiles at the tabulated times."""
    return channel.chart(run, velocity)


REFERENCE = Reference(
    source=f"series solution, {channel.SOURCE}",
    unit="% of Umax",
    error=error,
    observe=observe,
    judge=channel.judge,
    chart=chart,
    resolutions=channel.RESOLUTIONS,
    quick=2,
)
