"""Shallow water in a tank that is shaken sideways, violently, and then stands still."""

import math

import numpy as np

from sph_gym.scenes.shared import waves
from sph_gym.scenes.shared.family import GRAVITY, STRONG_GRAVITY, FlowFamily
from sph_gym.solver.checks import at_least_spacings, in_range, positive
from sph_gym.solver.geometry import lattice, snap, tank_particles
from sph_gym.solver.gravity import RecordedGravity
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.walls import Walls

FRAMES_PER_PERIOD = 40
SAMPLES_PER_PERIOD = 80


def shaken_tank(
    dx: float = 0.025,
    length: float = 1.5,
    fill: float = 0.125,
    strength: float = 0.5,
    shakes: float = 1.0,
    rest: float = 2.0,
    gravity: float = 9.81,
) -> Scene:
    """A tank that is shaken at its water's own period, and left alone.

    length, fill: of the tank, and depth of the water [m], rounded to multiples of dx; strength:
    amplitude of the shaking, in gravities; shakes, rest: how long, in periods, it is shaken and
    the scene goes on; gravity: downwards [m/s^2]. Seen from the tank: its walls stand still.
    It warns at the start: the article's kernels heat water at rest, a little (`sim.warnings`).
    """
    dx, gravity = positive("dx", dx), positive("gravity", gravity)
    length = at_least_spacings("length", length, 6, dx)
    fill = at_least_spacings("fill", fill, 1, dx)
    length, fill = snap(length, dx), snap(fill, dx)
    strength = in_range("strength", positive("strength", strength), 0.0, 2.0)
    shakes, rest = positive("shakes", shakes), positive("rest", rest)
    period = 2 * math.pi / waves.frequency(1, length, fill, gravity)
    # as high as the water climbs a wall under the steepest tilt
    climb = fill + strength * length / 2
    times = np.arange(math.ceil(shakes * SAMPLES_PER_PERIOD) + 2) / SAMPLES_PER_PERIOD
    sideways = strength * gravity * np.where(times < shakes, np.sin(2 * np.pi * times), 0.0)
    vectors = np.stack([sideways, np.full_like(times, -gravity)], axis=-1)
    return Scene(
        "shaken_tank",
        x=lattice(0.0, length, 0.0, fill, dx),
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=sound_speed(math.sqrt(2 * gravity * climb)), kernel="mueller"),
        effects=Effects(
            gravity=RecordedGravity(vectors, period / SAMPLES_PER_PERIOD),
            xsph=True,
            artificial_viscosity=0.02,
        ),
        walls=Walls(
            particles=tank_particles(length, 1.5 * climb, dx, layers=3),
            box=(0.0, length, 0.0, math.inf),
        ),
        duration=(shakes + rest) * period,
        frame=period / FRAMES_PER_PERIOD,
    )


def draw(rng: np.random.Generator, dx: float) -> dict[str, float]:
    """Return the arguments of a shallow tank that is shaken for a period or less, except dx [m]."""
    return {
        "length": rng.uniform(55, 75) * dx,
        "fill": rng.uniform(4, 6) * dx,
        "strength": rng.uniform(0.6, 1.0),
        "shakes": rng.uniform(0.5, 1.0),
        "rest": rng.uniform(2.0, 3.0),
        "gravity": rng.uniform(*GRAVITY),
    }


FAMILY = FlowFamily(
    "shaken_tank",
    dx=0.025,
    seed=7,
    draw=draw,
    odd=STRONG_GRAVITY,
    headroom=1.56,
)
