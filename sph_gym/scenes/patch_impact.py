"""Two patches of water fly towards each other, collide and splash: no walls, no gravity.

`colliding_patches` is the same with the fluid that an exact solution asks for. This one has the
article's fluid, whose time step, stiffness and smoothing can be tuned.
"""

import numpy as np

from sph_gym.scenes.shared.family import FlowFamily
from sph_gym.solver.checks import at_least_spacings, positive
from sph_gym.solver.geometry import lattice, snap
from sph_gym.solver.scene import Effects, Fluid, Scene


def patch_impact(
    dx: float = 0.05,
    length: float = 0.7,
    height: float = 0.7,
    speed: float = 1.0,
    gap: float = 0.7,
) -> Scene:
    """Two patches that move towards each other along x, `speed` [m/s] each.

    length, height: of either [m], rounded to multiples of dx; gap: between them at the start [m].
    Lasts until they have met and for the passage of a patch.
    """
    dx, speed = positive("dx", dx), positive("speed", speed)
    length = snap(at_least_spacings("length", length, 3, dx), dx)
    height = snap(at_least_spacings("height", height, 3, dx), dx)
    gap = at_least_spacings("gap", gap, 1, dx)
    right = lattice(gap / 2, gap / 2 + length, -height / 2, height / 2, dx)
    towards = np.full_like(right, (-speed, 0.0))
    duration = gap / (2 * speed) + length / speed
    return Scene(
        "patch_impact",
        x=np.concatenate([right, right * (-1, 1)]),
        v=np.concatenate([towards, -towards]),
        dx=dx,
        h=2.6 * dx,
        # an impact compresses the water by speed / c, at first
        fluid=Fluid(c0=40 * speed, kernel="mueller"),
        effects=Effects(xsph=True, artificial_viscosity=0.02),
        duration=duration,
        frame=duration / 75,
    )


def draw(rng: np.random.Generator, dx: float) -> dict[str, float]:
    """Return the arguments of two patches, except dx [m]."""
    length = rng.uniform(10, 16) * dx
    return {
        "length": length,
        "height": rng.uniform(0.7, 1.3) * length,
        "speed": rng.uniform(0.5, 2.0),
        "gap": rng.uniform(0.5, 1.0) * length,
    }


FAMILY = FlowFamily(
    "patch_impact",
    dx=0.05,
    seed=0,
    draw=draw,
    odd=("speed", 4.0, 8.0),
    headroom=2.2,
)
