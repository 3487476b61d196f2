"""Water at rest under gravity: the places and the densities with which it starts.

The level is that of the highest particle plus dx / 2, against the gravity of the start. All that
is at one depth below it starts with the pressure rho0 g depth, connected or not.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from sph_gym.solver.equation_of_state import density_at, make_eos
from sph_gym.solver.kernels import (
    ALL_KERNELS,
    calibrated_mass,
    primitive,
    primitive_scale,
    rest_lattice,
)
from sph_gym.solver.scene import Scene
from sph_gym.solver.state import Floats
from sph_gym.solver.stepping import stable_dt

# Steps after which the fluid is stopped, so that short waves and then long ones come to rest; and
# the share of dx that a particle may move meanwhile.
SETTLING = 3 * (2, 4, 8, 16, 32)
FARTHEST = 0.5
# Share of dx: a gap in a column of particles beyond which another column begins.
GAP = 1.5


def densities(scene: Scene, stiffness: float) -> Floats:
    """Return (n,) densities [kg/m^3] of the fluid at rest; stiffness: Tait's B [Pa]."""
    return _density(scene, stiffness, -_heights(scene)[0])


def rest_densities(scene: Scene, stiffness: float) -> Any:
    """Return the kernel sums [kg/m^3] of the fluid if nothing is odd: rho0, or (n,) under weight.

    Densities by continuity are sums of another kernel, and start from the lattice as it is.
    stiffness: Tait's B [Pa].
    """
    if not scene.effects.continuity:
        return densities(scene, stiffness) if scene.hydrostatic else scene.fluid.rho0
    kernel = ALL_KERNELS[scene.fluid.kernel](scene.h)
    r = np.hypot(*rest_lattice(scene.h, scene.dx))
    shape = np.where(r < scene.h, primitive(kernel, r * r, r), 0.0)
    mass = calibrated_mass(kernel, scene.fluid.rho0, scene.dx)
    return mass * primitive_scale(kernel) * shape.sum()


def pressed(scene: Scene, stiffness: float) -> Scene:
    """Return the scene with the fluid where its kernel sums are the densities of rest.

    Every column of particles is pressed down onto its lowest one. What rests on a particle, and
    so its pressure, is the same as before. stiffness: Tait's B [Pa]. Scenes that don't start at
    rest, and those with densities by continuity, are returned as they are.
    """
    if not _is_pressed(scene):
        return scene
    x, (height, up) = np.asarray(scene.x), _heights(scene)
    floor = _floors(x @ np.array([up[1], -up[0]]), height, scene.dx) - scene.dx / 2
    # rho0 / rho hardly bends between the floor and the particle
    points, weights = np.polynomial.legendre.leggauss(4)
    length = np.zeros_like(height)
    for point, weight in zip((1 + points) / 2, weights / 2, strict=True):
        depth = -(floor + point * (height - floor))
        share = scene.fluid.rho0 / _density(scene, stiffness, depth)
        length += weight * (height - floor) * share
    return replace(scene, x=x + (floor + length - height)[:, None] * up)


def settle(engine: Any, scene: Scene, stiffness: float) -> None:
    """Let a pressed fluid come to rest at walls and surface, at time 0; stiffness: Tait's B [Pa].

    A fluid that moves by more than `FARTHEST` isn't one at rest, and is left as it was.
    """
    if not _is_pressed(scene):
        return
    c, nu = scene.fluid.sound_speed(stiffness), scene.effects.laminar_viscosity
    start, dt = engine.state(), stable_dt(scene.h, c, 0.0, nu, scene.viscous_share)
    for n_substeps in SETTLING:
        _, bad = engine.run(0.0, dt, n_substeps)
        if bad >= 0 or _path(start, engine.state(), scene) > FARTHEST * scene.dx:
            engine.set_state(start, 0.0)
            return
        _give_velocities(engine, None)
    _give_velocities(engine, start)
    engine.renew(0.0)


def _is_pressed(scene: Scene) -> bool:
    return scene.hydrostatic and not scene.effects.continuity


def _heights(scene: Scene) -> tuple[Floats, Floats]:
    """Return (n,) heights [m] of the particles above the level, and (2,) which way is up."""
    gravity = scene.effects.gravity_at(0.0)
    up = -gravity / np.hypot(*gravity)
    height = np.asarray(scene.x) @ up
    return height - height.max() - scene.dx / 2, up


def _density(scene: Scene, stiffness: float, depth: Floats) -> Floats:
    fluid, g = scene.fluid, np.hypot(*scene.effects.gravity_at(0.0))
    eos = make_eos(stiffness, fluid.rho0, fluid.gamma, fluid.clamp)
    return np.asarray(density_at(eos, fluid.rho0 * g * depth))


def _floors(across: Floats, height: Floats, dx: float) -> Floats:
    """Return (n,) the height [m] of the lowest particle of each particle's column, dx wide."""
    column = np.rint((across - across.min()) / dx)
    order = np.lexsort((height, column))
    gaps = np.diff(height[order], prepend=-np.inf) > GAP * dx
    first = gaps | (np.diff(column[order], prepend=-1) != 0)
    floor = np.empty_like(height)
    floor[order] = height[order][first][np.cumsum(first) - 1]
    return floor


def _path(before: dict[str, Any], after: dict[str, Any], scene: Scene) -> float:
    """Return the longest way [m] of a particle between two states of an engine."""
    longest = 0.0
    for name, ends in zip("xy", scene.periods, strict=True):
        way = after[name][np.argsort(after["id"])] - before[name][np.argsort(before["id"])]
        if ends is not None:
            way -= (ends[1] - ends[0]) * np.rint(way / (ends[1] - ends[0]))
        longest = max(longest, float(np.abs(way).max()))
    return longest


def _give_velocities(engine: Any, state: dict[str, Any] | None) -> None:
    """Give an engine's fluid the velocities of a state, or none."""
    fluid, n = engine.fluid, engine.n
    for name in ("u", "v"):
        column = getattr(fluid, name)
        column[:n] = 0.0 if state is None else state[name][np.argsort(state["id"])][fluid.id]
