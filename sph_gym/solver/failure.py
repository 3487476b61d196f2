"""The tripwire's verdict: in which link of the chain a run broke, at which particle, and why."""

from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.forces import add_weights
from sph_gym.solver.scene import Scene
from sph_gym.solver.state import Floats, Indices, Particles, WallParticles

# Beyond this multiple of h/c symplectic Euler amplifies the shortest waves.
LINEAR_COURANT = 0.9
# And beyond this one of h^2/nu the shortest shear waves.
LINEAR_VISCOUS = 0.145
# Closer than this share of dx, two particles are one; so close to a wall particle, one is inside.
MERGED, INSIDE = 0.05, 0.4


class Search(NamedTuple):
    """The neighbour search that was in use, to be checked against brute force."""

    start: Indices
    grid: Any
    kernel: Any
    h2: Any


def broken_link(
    fluid: Particles,
    walls: WallParticles | None,
    a: Floats,
    search: Search,
    bad: int,
    dx: float,
) -> tuple[str, int]:
    """The first link that shows the failure, and the place in the arrays of a particle in it.

    fluid: the last finite state with its densities and pressures; a: (n,) size of the
    accelerations [m/s^2]; bad: place of the particle that failed in the step after it.
    """
    if not _search_agrees(fluid, search, bad):
        return "neighbours", bad
    for link, values in {"density": fluid.rho, "pressure": fluid.stress, "force": a}.items():
        wrong = ~np.isfinite(values)
        if wrong.any():
            return link, int(np.argmax(wrong))
    if walls is not None:
        distance = np.hypot(walls.x - fluid.x[bad], walls.y - fluid.y[bad])
        if distance.min() < INSIDE * dx:
            return "walls", bad
    return "integration", bad


def _search_agrees(fluid: Particles, search: Search, bad: int) -> bool:
    x, y, zero = fluid.x[bad], fluid.y[bad], fluid.x.dtype.type(0)
    everybody = np.array([0, fluid.x.size], np.int32)
    brute = add_weights(fluid, everybody, None, search.kernel, search.h2, x, y, zero)
    found = add_weights(fluid, search.start, search.grid, search.kernel, search.h2, x, y, zero)
    return bool(np.isclose(brute, found, rtol=1e-3, equal_nan=True))


def cause(scene: Scene, dt: float, c: float, link: str, nearest: float) -> str:
    """Why: the step first, since too long a one makes all the rest happen.

    dt [s], c: sound speed at the present stiffness [m/s]; nearest: smallest spacing / dx.
    """
    nu = scene.effects.laminar_viscosity
    too_viscous = nu is not None and dt * nu > LINEAR_VISCOUS * scene.h**2
    too_long = dt * c > LINEAR_COURANT * scene.h
    too_long_at_c0 = dt * scene.fluid.c0 > LINEAR_COURANT * scene.h
    if too_viscous or (too_long and too_long_at_c0):
        return "cfl"
    if too_long:
        return "stiffness"
    if link == "walls":
        return "tunnelling"
    if nearest < MERGED:
        return "clumping"
    return "energy" if link == "integration" else "nan"
