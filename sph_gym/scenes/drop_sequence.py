"""Drops hit a shallow pool one after the other: calm and violence alternate."""

import math

import numpy as np

from sph_gym.scenes.shared import tanks
from sph_gym.scenes.shared.family import GRAVITY, STRONG_GRAVITY, FlowFamily
from sph_gym.solver.checks import at_least_spacings, countable, positive, whole
from sph_gym.solver.geometry import disc, lattice, snap, tank_particles
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.walls import Walls


def drop_sequence(
    dx: float = 0.02,
    diameter: float = 0.3,
    drop_height: float = 0.3,
    drops: int = 3,
    interval: float = 0.5,
    pool_depth: float = 0.12,
    width: float = 1.2,
    gravity: float = 9.81,
) -> Scene:
    """Drops above each other in the middle of a tank, the first at rest `drop_height` up.

    diameter, drop_height (of the lowest point above the pool), pool_depth, width (of the tank):
    [m], the last two rounded to multiples of dx; drops: how many; interval: between their
    impacts [s], for which the later ones are thrown, mostly upwards; gravity: downwards [m/s^2].
    Lasts for twice the interval after the last impact.
    """
    dx, gravity = positive("dx", dx), positive("gravity", gravity)
    diameter = at_least_spacings("diameter", diameter, 3, dx)
    width = at_least_spacings("width", width, 6, dx)
    drop_height = at_least_spacings("drop_height", drop_height, 1, dx)
    drops, interval = whole("drops", drops, at_least=1), positive("interval", interval)
    width = snap(width, dx)
    pool_depth = snap(at_least_spacings("pool_depth", pool_depth, 1, dx), dx)
    tanks.check_room(diameter, width, dx)
    in_pool, in_drop = (width / dx) * (pool_depth / dx), math.pi / 4 * (diameter / dx) ** 2
    countable(in_pool + in_drop)
    countable(in_pool + drops * in_drop, "drops", "fewer drops")
    heights = drop_height + 1.5 * diameter * np.arange(drops)
    arrivals = math.sqrt(2 * drop_height / gravity) + interval * np.arange(drops)
    thrown = gravity * arrivals / 2 - heights / arrivals
    pool = lattice(0.0, width, 0.0, pool_depth, dx)
    bodies = [
        disc(width / 2, pool_depth + height + diameter / 2, diameter / 2, dx) for height in heights
    ]
    v = [np.zeros_like(pool)]
    v += [np.full_like(body, (0.0, up)) for body, up in zip(bodies, thrown, strict=True)]
    fastest = np.sqrt(thrown**2 + 2 * gravity * (heights + diameter / 2 + pool_depth)).max()
    return Scene(
        "drop_sequence",
        x=np.concatenate([pool, *bodies]),
        v=np.concatenate(v),
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=sound_speed(float(fastest)), kernel="mueller"),
        effects=Effects(gravity=(0.0, -gravity), xsph=True, artificial_viscosity=0.02),
        walls=Walls(
            particles=tank_particles(width, pool_depth + 3 * diameter, dx, layers=3),
            box=(0.0, width, 0.0, math.inf),
        ),
        duration=float(arrivals[-1]) + 2 * interval,
        frame=interval / 30,
    )


def draw(rng: np.random.Generator, dx: float) -> dict[str, float]:
    """Return the arguments of two or three drops above a pool, except dx [m]."""
    diameter, gravity = rng.uniform(8, 11) * dx, rng.uniform(*GRAVITY)
    return {
        "diameter": diameter,
        "drop_height": rng.uniform(0.5, 2.0) * diameter,
        "drops": int(rng.integers(2, 4)),
        "interval": rng.uniform(2.5, 3.5) * float(np.sqrt(diameter / gravity)),
        "pool_depth": rng.uniform(4, 6) * dx,
        "width": rng.uniform(3.5, 5.5) * diameter,
        "gravity": gravity,
    }


FAMILY = FlowFamily(
    "drop_sequence",
    dx=0.03,
    seed=3,
    draw=draw,
    odd=STRONG_GRAVITY,
    headroom=1.58,
    remark="small headroom",
)
