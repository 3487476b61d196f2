"""The tripwire: in which link of the chain a run broke, at which particle, and why."""

import math
from typing import NamedTuple

import numpy as np

from sph_gym.solver.kernels import ALL_KERNELS, density_kernel
from sph_gym.solver.periodic import make_period, nearest_image
from sph_gym.solver.scene import Scene
from sph_gym.solver.state import Floats, Particles
from sph_gym.solver.stepping import FORCE

CAUSES = ("cfl", "stiffness", "clumping", "tunnelling", "energy", "nan")
# Beyond this multiple of h/c symplectic Euler amplifies the shortest waves.
LINEAR_COURANT = 0.9
# And beyond this multiple of the viscous limit the shortest shear waves.
LINEAR_VISCOUS = 1.16
# Beyond this multiple of the force limit the step is to blame: in all hard cases of the study
# `stability`, runs at the stable step of a frame's start reach no more than 1.9 by its end. Of
# those that blow up below 0.9 h/c, most come to 2 to 1000; the others have burst by then, and
# show no force any more.
FORCED = 2.0
# Closer than this share of dx, two particles are one; so close to a wall particle, one is inside.
MERGED, INSIDE = 0.05, 0.4


class Onset(NamedTuple):
    """When and why a run last broke; all are -1 if it hasn't.

    cause: its place in CAUSES; substep: substeps from the start, the one that failed included;
    time: [s] of the last whole state.
    """

    cause: float = -1.0
    substep: float = -1.0
    time: float = -1.0


def broken_link(
    fluid: Particles,
    walls: Particles | None,
    a: Floats,
    bad: int,
    scene: Scene,
    mass: float,
) -> tuple[str, int]:
    """The first link that shows the failure, and the place in the arrays of a particle in it.

    fluid: the last finite state with its densities and pressures; a: (n,) size of the
    accelerations [m/s^2]; bad: place of the particle that failed in the step after it; mass
    [kg/m].
    """
    n = fluid.id.size
    if not _search_agrees(fluid, walls, bad, scene, mass):
        return "neighbours", bad
    for link, values in {"density": fluid.rho, "pressure": fluid.stress, "force": a}.items():
        wrong = ~np.isfinite(values[:n])
        if wrong.any():
            return link, int(np.argmax(wrong))
    if walls is not None and _distances(walls, fluid, bad, scene).min() < INSIDE * scene.dx:
        return "walls", bad
    return "integration", bad


def _distances(others: Particles, fluid: Particles, i: int, scene: Scene) -> Floats:
    """(n,) [m] from fluid particle i to all the others, or to their nearest images."""
    n, walls = others.id.size, scene.walls
    dx = others.x[:n] - np.float64(fluid.x[i])
    dy = others.y[:n] - np.float64(fluid.y[i])
    if walls is not None:
        dx = nearest_image(make_period(walls.period_x, np.float64), dx)
        dy = nearest_image(make_period(walls.period_y, np.float64), dy)
    return np.hypot(dx, dy)


def _search_agrees(
    fluid: Particles, walls: Particles | None, bad: int, scene: Scene, mass: float
) -> bool:
    """Return whether the search gave the density of brute force, if it was a sum at all."""
    if scene.effects.continuity:
        return True
    kernel = ALL_KERNELS[scene.fluid.kernel](scene.h)
    all_particles = [fluid] if walls is None else [fluid, walls]
    brute = mass * sum(
        density_kernel(kernel, _distances(some, fluid, bad, scene)).sum() for some in all_particles
    )
    found = fluid.rho[bad]
    return not np.isfinite(found) or bool(np.isclose(brute, found, rtol=1e-3))


def cause(scene: Scene, dt: float, c: float, link: str, nearest: float, a_max: float = 0.0) -> str:
    """Why: the step first, since too long a one makes all the rest happen.

    Within walls forces are large whatever the step is, and don't tell. dt [s], c: sound speed at
    the present stiffness [m/s]; nearest: smallest spacing / dx; a_max: largest |a| [m/s^2].
    """
    nu = scene.effects.laminar_viscosity
    too_viscous = nu is not None and dt * nu > LINEAR_VISCOUS * scene.viscous_share * scene.h**2
    too_viscous = too_viscous or dt > LINEAR_VISCOUS * scene.surface_dt
    too_long = dt * c > LINEAR_COURANT * scene.h
    too_long_at_c0 = dt * scene.fluid.c0 > LINEAR_COURANT * scene.h
    if too_viscous or (too_long and too_long_at_c0):
        return "cfl"
    if too_long:
        return "stiffness"
    if link == "walls":
        return "tunnelling"
    if a_max > 0 and dt > FORCED * FORCE * math.sqrt(scene.h / a_max):
        return "cfl"
    if nearest < MERGED:
        return "clumping"
    return "energy" if link == "integration" else "nan"
