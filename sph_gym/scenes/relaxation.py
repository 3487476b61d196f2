"""The article's isolation test: no gravity, no walls, a jittered blob in empty space."""

import math

import numpy as np

from sph_gym.solver.checks import in_range, positive, whole
from sph_gym.solver.geometry import lattice
from sph_gym.solver.scene import Effects, Fluid, Scene


def relaxation(
    dx: float = 0.025, diameter: float = 0.5, jitter: float = 0.05, seed: int = 0
) -> Scene:
    """A round blob whose particles are off their lattice by `jitter` dx (normal deviate).

    diameter: [m]. It settles only because the scene names a laminar viscosity: pressure that is
    clamped can push but not pull, so that without viscosity the stored energy of the jitter
    drives the blob apart for ever, and artificial viscosity acts only on pairs that approach.
    """
    dx, diameter = positive("dx", dx), positive("diameter", diameter)
    square = lattice(-diameter / 2, diameter / 2, -diameter / 2, diameter / 2, dx)
    x = square[np.hypot(*square.T) <= diameter / 2]
    if len(x) == 0:
        raise ValueError(f"diameter: expected at least dx = {dx:g} m, got {diameter:g}")
    rng = np.random.default_rng(whole("seed", seed))
    x = x + rng.normal(0.0, in_range("jitter", jitter, 0.0) * dx, x.shape)
    c0 = 10.0
    return Scene(
        "relaxation",
        x=x - x.mean(axis=0),
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=c0),
        effects=Effects(laminar_viscosity=0.1 * diameter / 0.5),
        duration=2.0,
        frame=0.04 * math.sqrt(diameter / 0.5),
    )
