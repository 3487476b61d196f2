"""A round drop falls onto a shallow pool: free fall, a violent impact, then calm sloshing."""

import math

import numpy as np

from sph_gym.solver.checks import in_range, positive
from sph_gym.solver.geometry import lattice, snap, tank_particles
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.walls import Walls


def drop_impact(
    dx: float = 0.02,
    diameter: float = 0.3,
    drop_height: float = 0.4,
    pool_depth: float = 0.12,
    width: float = 1.2,
    gravity: float = 9.81,
) -> Scene:
    """A drop at rest, its lowest point `drop_height` above the pool, in the middle of the tank.

    diameter, drop_height, pool_depth, width (of the tank): [m], the last two
    rounded to multiples of dx; gravity: downwards [m/s^2].
    Lasts for the fall and three times the time of a wave across half the tank.
    """
    dx, gravity = positive("dx", dx), positive("gravity", gravity)
    diameter, width = in_range("diameter", diameter, 3 * dx), in_range("width", width, 6 * dx)
    drop_height = in_range("drop_height", drop_height, dx)
    pool_depth = in_range("pool_depth", pool_depth, dx)
    width, pool_depth = snap(width, dx), snap(pool_depth, dx)
    if diameter > width - 6 * dx:
        raise ValueError(f"diameter: expected at most width - 6 dx, got {diameter:g} m")
    centre = np.array([width / 2, pool_depth + drop_height + diameter / 2])
    radius = diameter / 2
    square = centre + lattice(-radius, radius, -radius, radius, dx)
    drop = square[np.hypot(*(square - centre).T) <= radius]
    # the centre of the drop falls to the floor
    v_max = math.sqrt(2 * gravity * centre[1])
    fall = math.sqrt(2 * drop_height / gravity)
    return Scene(
        "drop_impact",
        x=np.concatenate([lattice(0.0, width, 0.0, pool_depth, dx), drop]),
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=sound_speed(v_max)),
        effects=Effects(gravity=(0.0, -gravity), xsph=True, artificial_viscosity=0.02),
        walls=Walls(
            particles=tank_particles(width, centre[1], dx),
            box=(0.0, width, 0.0, math.inf),
        ),
        duration=fall + 1.5 * width / math.sqrt(gravity * pool_depth),
        frame=0.06 * math.sqrt(centre[1] / gravity),
    )
