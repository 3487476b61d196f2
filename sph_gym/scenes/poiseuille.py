"""Start-up of plane Poiseuille flow: a body force sets a fluid in motion between two walls."""

import math

import numpy as np

from sph_gym.scenes.shared import channel
from sph_gym.scenes.shared.channel import Array
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation


def poiseuille(
    dx: float = 1 / 40, height: float = 1.0, speed: float = 1.0, reynolds: float = 10.0
) -> Scene:
    """A fluid at rest between two walls, pushed along them from the start on.

    height: between the walls [m], rounded to a multiple of dx; speed: on the centre line in the
    end [m/s]; reynolds: speed height / nu. Periodic along the channel.
    """
    return channel.build("poiseuille", dx, height, speed, reynolds, pushed=True)


def velocity(y: Array, tau: float) -> Array:
    """Return u / Umax at y / d, tau = nu t / d^2.

    4 y (1 - y) - sum over odd n of 32 / (n pi)^3 sin(n pi y) exp(-n^2 pi^2 tau).
    Source: Morris, Fox & Zhu 1997, in units of d and Umax.
    """
    k = math.pi * (2 * np.arange(channel.TERMS) + 1)
    missing = 32 / k**3 * np.exp(-(k**2) * tau)
    return 4 * y * (1 - y) - np.sin(np.multiply.outer(y, k)) @ missing


def _top(sim: Simulation) -> float:
    """Return Umax = F d^2 / (8 nu) [m/s]."""
    effects = sim.scene.effects
    assert effects.laminar_viscosity is not None
    force = float(effects.gravity_at(0.0)[0])
    return force * channel.height_of(sim) ** 2 / (8 * effects.laminar_viscosity)


REFERENCE = channel.reference(velocity, _top)

REFINEMENT = Refinement(
    "poiseuille", "height", (10, 14, 20, 28, 40, 57), 28,
    "largest velocity error at the tabulated times", "of Umax",
    "Between first and second order, slower when fine, where the late times are left, which "
    "converge with first order. Single precision takes longer, as in the Couette flow.",
    order=1.35, others=({"reynolds": 6.0}, {"reynolds": 30.0}), widest=3.0, joined=2,
)  # fmt: skip
