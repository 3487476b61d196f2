"""A drop falls for long, bursts on a puddle or on the floor, and what is left comes to rest."""

import math

import numpy as np

from sph_gym.scenes.shared import tanks
from sph_gym.scenes.shared.family import GRAVITY, STRONG_GRAVITY, FlowFamily
from sph_gym.solver.checks import at_least_spacings, in_range, positive
from sph_gym.solver.geometry import disc, lattice, snap, tank_particles
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.walls import Walls


def long_fall(
    dx: float = 0.02,
    diameter: float = 0.3,
    drop_height: float = 2.0,
    puddle: float = 0.0,
    width: float = 1.0,
    gravity: float = 9.81,
) -> Scene:
    """A drop at rest, its lowest point `drop_height` above what it hits, in the middle of a tank.

    diameter, drop_height, width (of the tank), puddle (depth of the water on the floor, 0 for
    none): [m], the last two rounded to multiples of dx; gravity: downwards [m/s^2].
    Lasts for two and a half times the fall. Where the drop bursts on a dry floor, its jets come to
    Mach 0.36 for a moment, which `Simulation.warnings` tells.
    """
    dx, gravity = positive("dx", dx), positive("gravity", gravity)
    diameter = at_least_spacings("diameter", diameter, 3, dx)
    width = at_least_spacings("width", width, 6, dx)
    drop_height = at_least_spacings("drop_height", drop_height, 1, dx)
    width = snap(width, dx)
    tanks.check_room(diameter, width, dx)
    depth = round(in_range("puddle", puddle, 0.0, drop_height) / dx) * dx
    drop = disc(width / 2, depth + drop_height + diameter / 2, diameter / 2, dx)
    pool = lattice(0.0, width, 0.0, depth, dx) if depth > 0 else np.empty((0, 2))
    # the top of the drop falls to the floor
    v_max = math.sqrt(2 * gravity * (depth + drop_height + diameter))
    fall = math.sqrt(2 * drop_height / gravity)
    return Scene(
        "long_fall",
        x=np.concatenate([pool, drop]),
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=sound_speed(v_max), kernel="mueller"),
        effects=Effects(gravity=(0.0, -gravity), xsph=True, artificial_viscosity=0.02),
        walls=Walls(
            particles=tank_particles(width, depth + 3 * diameter, dx, layers=3),
            box=(0.0, width, 0.0, math.inf),
        ),
        duration=2.5 * fall,
        frame=fall / 50,
    )


def draw(rng: np.random.Generator, dx: float) -> dict[str, float]:
    """Return the arguments of a drop high above a puddle, except dx [m]."""
    diameter = rng.uniform(14, 20) * dx
    return {
        "diameter": diameter,
        "drop_height": rng.uniform(4.0, 8.0) * diameter,
        "puddle": rng.uniform(2, 5) * dx,
        "width": rng.uniform(2.0, 4.0) * diameter,
        "gravity": rng.uniform(*GRAVITY),
    }


FAMILY = FlowFamily(
    "long_fall",
    dx=0.02,
    seed=5,
    draw=draw,
    odd=STRONG_GRAVITY,
    headroom=2.23,
)
