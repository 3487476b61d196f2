"""A look at where fluid and walls of a scene are, before anything moves.

What can't be meant is refused; what is legal but odd is told by the warning "start".
"""

import math
from typing import Any

import numpy as np

from sph_gym.solver.gravity import Gravity
from sph_gym.solver.kernels import ALL_KERNELS, density_kernel, rest_lattice
from sph_gym.solver.state import Floats
from sph_gym.solver.thickness import (
    LINK,
    close_pairs,
    count_layers,
    is_linked,
    layer_share,
    measure,
    needed_layers,
)
from sph_gym.solver.tunnelling import INSIDE_WALL
from sph_gym.solver.walls import Walls

# Share of dx by which a place may be wrong: rounding, and the jitter of reference runs.
SLACK = 0.05
# Density at the start [rho0]: more of it, on average or at one particle, makes a burst; less in
# the mean is not the fluid of these numbers.
DENSE, DENSEST, SPARSE = 1.03, 1.5, 0.5
# Support radius [dx] below which a particle at rest has its 8 nearest neighbours at most, and a
# tank at rest loses level: with matched kernels 1 % at 2 dx, 2 to 9 at 1.5 dx, 9 to 29 at 1.2 dx.
# Smoothing lengths are mostly 1 to 1.7 dx, the supports of the scenes of this package 2.6 to 4 dx.
NARROW = 2.0
# Boundary particles that may be in thinner places.
STRAYS = 3
# Multiple of dx: in a wall, a boundary particle is nearer, since a square's diagonal is sqrt(2) dx.
NEAREST = 0.75
# Multiple of their sizes that fluid and walls may be apart.
FAR = 10.0


# --- What is refused ------------------------------------------------------------------------


def check_places(scene: Any) -> None:
    """Raise ValueError for fluid outside of the box or in walls of boundary particles."""
    x, walls, dx = np.asarray(scene.x), scene.walls, scene.dx
    slack = SLACK * dx + 4 * np.finfo(float).eps * float(np.abs(x).max())
    if walls.box is not None:
        low, high = np.array(walls.box[::2]), np.array(walls.box[1::2])
        outside = ((x < low - slack) | (x > high + slack)).any(axis=1)
        _refuse(x, outside, f"within walls.box = {walls.box}", "outside of it")
    if walls.particles is not None:
        wanted = f"at least dx / 2 = {dx / 2:g} m from walls.particles, and not between them"
        _refuse(x, _walled(scene, slack), wanted, "there")


def _walled(scene: Any, slack: float) -> Any:
    """Return (n,) which fluid is nearer than dx / 2 to boundary particles, or between them."""
    x, dx, shape = np.asarray(scene.x), scene.dx, ALL_KERNELS[scene.fluid.kernel](scene.h)
    walls, walled, near = images(scene.walls, scene.h), np.zeros(len(x), bool), []
    # no place in a wall is farther from all of its particles
    for i, _, distance in close_pairs(x, walls, NEAREST * dx):
        walled[i[distance < dx / 2 - slack]] = True
        near.append(np.unique(i))
    chosen = np.concatenate([np.zeros(0, int), *near])
    share = np.zeros(len(x))
    for i, _, distance in close_pairs(x[chosen], walls, scene.h):
        share[chosen] += np.bincount(i, density_kernel(shape, distance), len(chosen))
    full = layer_share(math.inf, scene.fluid.kernel, scene.h, dx)
    return walled | (share > INSIDE_WALL * full)


def _refuse(x: Floats, wrong: Any, wanted: str, found: str) -> None:
    if not wrong.any():
        return
    first, low, high = int(np.argmax(wrong)), x[wrong].min(axis=0), x[wrong].max(axis=0)
    raise ValueError(
        f"x: expected fluid {wanted}, got {int(wrong.sum())} of {len(x)} particles {found}: x "
        f"from {low[0]:g} to {high[0]:g}, y from {low[1]:g} to {high[1]:g}, the first at index "
        f"{first}"
    )


def images(walls: Walls, reach: float) -> Floats:
    """Return the boundary particles (m, 2) [m], and their images within reach [m] of a domain."""
    particles = np.asarray(walls.particles)
    for axis, ends in enumerate((walls.period_x, walls.period_y)):
        if ends is None:
            continue
        step = np.zeros(2)
        step[axis] = ends[1] - ends[0]
        place = particles[:, axis]
        behind, before = place > ends[1] - reach, place < ends[0] + reach
        particles = np.concatenate([particles, particles[behind] - step, particles[before] + step])
    return particles


# --- What is odd ----------------------------------------------------------------------------


def anomalies(scene: Any, ratio: Floats) -> list[tuple[float, float, str]]:
    """Return a measure, its limit and a sentence for all that is odd about the start of a scene.

    ratio: (n,) densities at the start, summed, as shares of those of rest.
    """
    found, walls = [*_narrow(scene), *_crowd(scene, ratio)], scene.walls
    if walls is not None and walls.particles is not None:
        found += _thin(scene)
    if walls is not None and (walls.particles is not None or walls.plates is not None):
        found += _distant(scene)
    return found


def is_narrow(scene: Any) -> bool:
    """Return whether the support of a scene is so narrow that its h may be a smoothing length."""
    return bool(scene.h < (1 - 1e-9) * NARROW * scene.dx)


def _narrow(scene: Any) -> list[tuple[float, float, str]]:
    if not is_narrow(scene):
        return []
    h, dx = scene.h, scene.dx
    n_neighbors = int((np.hypot(*rest_lattice(h, dx)) < (1 - 1e-9) * h).sum()) - 1
    times = 3 if scene.fluid.kernel == "quintic_spline" else 2
    text = (
        f"h = {h:g} m is the support radius, where the kernel ends, and only {h / dx:.3g} dx: a "
        f"particle has about {n_neighbors} neighbours, too few for good densities; usual in 2D are "
        f"h = 2.6 to 4 dx, with 20 to 45 neighbours; if {h:g} m is a smoothing length, give h = "
        f"{times * h:g} m, {times} times as much"
    )
    return [(dx / h, 1 / NARROW, text)]


def _crowd(scene: Any, ratio: Floats) -> list[tuple[float, float, str]]:
    mean, most, n = float(ratio.mean()), float(ratio.max()), len(ratio)
    if mean > DENSE or most > DENSEST:
        crowded = mean if mean > DENSE else most
        limit = DENSE if mean > DENSE else DENSEST
        which = "" if mean > DENSE else f" in {int((ratio > DENSEST).sum())} places"
        text = (
            f"the fluid starts at {crowded:.2f} rho0{which}, particles overlap (mean distance "
            f"{1 / math.sqrt(crowded):.2f} dx): expect a burst; a lattice() of spacing dx is at "
            "rest density"
        )
        return [(crowded, limit, text)]
    if mean < SPARSE and n > 1 and most < SPARSE:
        text = (
            f"the fluid starts at {mean:.2f} rho0: particles are much farther apart than dx = "
            f"{scene.dx:g} m and hardly touch; x and dx may be in different units"
        )
        return [(1 / math.sqrt(mean), 1 / math.sqrt(SPARSE), text)]
    return []


def _thin(scene: Any) -> list[tuple[float, float, str]]:
    """Return walls with fewer layers than the support needs, or with gaps between particles."""
    walls, dx, h, kernel = scene.walls, scene.dx, scene.h, scene.fluid.kernel
    thickness, needed = measure(np.asarray(walls.particles), kernel, h, dx), needed_layers(h, dx)
    linked = is_linked(thickness, dx)
    if not linked.any():
        nearest = float(np.median(_gaps(np.asarray(walls.particles)))) / dx
        text = (
            f"walls.particles are {nearest:.3g} dx apart, fluid passes between them; walls have "
            f"spacing dx = {dx:g} m (and the units of dx)"
        )
        return [(nearest, LINK, text)]
    # at a face of the box or of plates, fluid touches walls but can't enter
    wanted = np.where(walls.unbacked(dx, h), needed, max(needed - 1, 1))
    shares = np.array([layer_share(each, kernel, h, dx) for each in range(needed + 1)])
    # halfway between as many layers and one less
    thin = linked & (thickness.share < (shares[wanted - 1] + shares[wanted]) / 2)
    if thin.sum() <= STRAYS:
        return []
    layers = count_layers(float(np.quantile(thickness.share[thin], 0.1)), kernel, h, dx)
    text = (
        f"{int(thin.sum())} of {len(thin)} walls.particles belong to walls of about {layers} "
        f"layer{'s' if layers > 1 else ''}, fewer than the {needed} that a support of h = "
        f"{h / dx:.3g} dx needs: fluid may pass them; layers={needed} holds it, and so does a box "
        "or a plate at their face"
    )
    return [(needed / layers, 1.0, text)]


def _gaps(particles: Floats) -> Floats:
    """Return the distance to the nearest other of the first few boundary particles [m]."""
    if len(particles) < 2:
        return np.array([math.inf])
    some = particles[:100]
    distance = np.hypot(*(some[:, None] - particles).transpose(2, 0, 1))
    distance[np.arange(len(some)), np.arange(len(some))] = math.inf
    return np.asarray(distance.min(axis=1))


def _distant(scene: Any) -> list[tuple[float, float, str]]:
    """Return fluid that is nowhere near its walls, or falls beside or below them."""
    x, solid = np.asarray(scene.x), _solid(scene.walls)
    name = "walls.plates" if scene.walls.particles is None else "walls.particles"
    low, high = x.min(axis=0), x.max(axis=0)
    gap = np.maximum(solid.min(axis=0) - high, low - solid.max(axis=0))
    size = float(np.maximum(high - low, np.ptp(solid, axis=0)).max()) + scene.h
    distance = float(gap.max())
    if distance > FAR * size:
        text = (
            f"{name} are {distance:g} m away from the fluid, {distance / size:.3g} times "
            "the larger of their sizes; they may be in different units or places"
        )
        return [(distance / size, FAR, text)]
    field = scene.effects.field
    if not isinstance(field, Gravity) or scene.walls.is_periodic or scene.walls.box is not None:
        return []
    pull = np.array((field.x, field.y))
    down = int(abs(field.x) < abs(field.y))
    along = math.copysign(1.0, pull[down])
    below = float((along * x[:, down]).min() - (along * solid[:, down]).max())
    missed = max(float(gap[1 - down]), below)
    if pull.any() and missed > scene.h and not np.asarray(scene.v).any():
        text = f"there are {name}, but none below the fluid: it falls beside them"
        return [(missed / scene.h, 1.0, text)]
    return []


def _solid(walls: Walls) -> Floats:
    """Return (n, 2) [m] of the boundary particles and of the ends of plates."""
    parts = [] if walls.particles is None else [np.asarray(walls.particles)]
    if walls.plates is not None:
        parts.append(np.asarray(walls.plates).reshape(-1, 2))
    return np.concatenate(parts)
