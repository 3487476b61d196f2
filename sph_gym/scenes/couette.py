"""Start-up of plane Couette flow: a wall that moves along itself draws a fluid with it."""

import math

import numpy as np

from sph_gym.scenes.shared import channel
from sph_gym.scenes.shared.channel import Array
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation


def couette(
    dx: float = 1 / 40, height: float = 1.0, speed: float = 1.0, reynolds: float = 10.0
) -> Scene:
    """A fluid at rest between two walls, the upper of which moves from the start on.

    height: between the walls [m], rounded to a multiple of dx; speed: of the upper wall [m/s];
    reynolds: speed height / nu. Periodic along the channel.
    """
    return channel.build("couette", dx, height, speed, reynolds, pushed=False)


def velocity(y: Array, tau: float) -> Array:
    """Return u / Umax at y / d, tau = nu t / d^2.

    y + sum over n of 2 / (n pi) (-1)^n sin(n pi y) exp(-n^2 pi^2 tau); at rest at the start,
    where the series converges too slowly. Source: Morris, Fox & Zhu 1997.
    """
    if tau <= 0:
        return np.where(y < 1, 0.0, 1.0)
    n = np.arange(1, channel.TERMS + 1)
    missing = 2 / (n * math.pi) * (-1.0) ** n * np.exp(-((n * math.pi) ** 2) * tau)
    return y + np.sin(np.multiply.outer(y, n * math.pi)) @ missing


def _top(sim: Simulation) -> float:
    """Return the speed of the moving wall [m/s]."""
    assert sim.scene.walls is not None
    return sim.scene.walls.top_speed


REFERENCE = channel.reference(velocity, _top)

REFINEMENT = Refinement(
    "couette", "height", (10, 14, 20, 28, 40, 57), 28,
    "largest velocity error at the tabulated times", "of U",
    "Better than second order while coarse (1.6 % at 10 across), slower from 28 on (0.06, 0.04 "
    "and 0.03 %), where the late times are left, which converge with first order. Single "
    "precision takes longer: with h = 3 dx, what the kernel gives to neighbours three spacings "
    "away is probably below the normal numbers of float32.",
    order=2.5, until=28, others=({"reynolds": 6.0}, {"reynolds": 30.0}), widest=3.0, joined=2,
)  # fmt: skip
