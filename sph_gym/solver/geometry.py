"""Positions of particles at the start: lattices, discs, tanks, and plates of boundary particles.

All raise ValueError that names the argument: for what isn't a finite number, for lengths that
aren't positive, for ends that aren't in order, and for more than 1e8 particles.
"""

import math

import numpy as np

from sph_gym.solver.checks import countable, finite_array, number, positive, whole
from sph_gym.solver.state import Floats

# Layers of boundary particles by default: as many as a support radius of up to 4 dx needs. With
# fewer than h / dx of them, particles find their way through.
LAYERS = 4


def snap(length: float, dx: float) -> float:
    """The multiple of dx nearest to a length, at least dx: where a lattice of spacing dx fits."""
    dx = positive("dx", dx)
    return max(round(number("length / dx", number("length", length) / dx)), 1) * dx


def lattice(x_min: float, x_max: float, y_min: float, y_max: float, dx: float) -> Floats:
    """Square lattice of spacing dx that fills a rectangle, half a spacing from its lower sides.

    Returns (n, 2) [m]. The upper sides are moved to the nearest multiple of dx: a lattice that
    was stretched to fit would not be at rest density.
    """
    dx = positive("dx", dx)
    x_min, width = _interval("x", x_min, x_max)
    y_min, height = _interval("y", y_min, y_max)
    countable((width / dx) * (height / dx))
    nx, ny = (max(round(side / dx), 1) for side in (width, height))
    x, y = x_min + (np.arange(nx) + 0.5) * dx, y_min + (np.arange(ny) + 0.5) * dx
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _interval(name: str, low: float, high: float) -> tuple[float, float]:
    """The lower end of an interval and its length [m]."""
    low, high = number(f"{name}_min", low), number(f"{name}_max", high)
    if not low < high:
        raise ValueError(f"{name}_max: expected a number above {name}_min = {low:g}, got {high:g}")
    return low, number(f"{name}_max - {name}_min", high - low)


def disc(x: float, y: float, radius: float, dx: float) -> Floats:
    """The points of a square lattice, symmetric about x, y, within `radius` of it. (n, 2) [m]."""
    centre, radius = (number("x", x), number("y", y)), positive("radius", radius)
    square = lattice(-radius, radius, -radius, radius, dx)
    square -= square.mean(axis=0)
    return square[np.hypot(*square.T) <= radius] + centre


def tank_particles(
    width: float, height: float, dx: float, layers: int = LAYERS, lid: bool = False
) -> Floats:
    """Floor and side walls of a tank, `layers` deep, in step with a lattice of spacing dx.

    The inner faces are x = 0, x = width (to the nearest multiple of dx) and y = 0, the walls at
    least `height` high; with a `lid`, the tank is closed at `height`. layers: at least h / dx.
    Returns (n, 2) [m].
    """
    dx, layers = positive("dx", dx), whole("layers", layers, at_least=1)
    columns, rows = positive("width", width) / dx, positive("height", height) / dx
    countable((columns + 2 * layers) * (rows + 2 * layers))
    nx, ny = max(round(columns), 1), math.ceil(rows - 1e-9)
    top = ny + (layers if lid else 0)
    i, j = (
        a.ravel() for a in np.meshgrid(np.arange(-layers, nx + layers), np.arange(-layers, top))
    )
    outside = (i < 0) | (i >= nx) | (j < 0) | (j >= ny)
    return (np.stack([i[outside], j[outside]], axis=-1) + 0.5) * dx


def channel_particles(length: float, height: float, dx: float, layers: int = LAYERS) -> Floats:
    """The two walls of a channel from x = 0 to `length`, inner faces y = 0 and y = height.

    In step with a lattice of spacing dx; length and height are rounded to multiples of it.
    layers: at least h / dx. Returns (n, 2) [m], the lower wall first.
    """
    length, height = positive("length", length), positive("height", height)
    layers, height = whole("layers", layers, at_least=1), snap(height, dx)
    below = lattice(0.0, length, -layers * dx, 0.0, dx)
    return np.concatenate([below, lattice(0.0, length, height, height + layers * dx, dx)])


def plate_particles(
    start: tuple[float, float], end: tuple[float, float], dx: float, layers: int = LAYERS
) -> Floats:
    """A straight wall from `start` to `end` [m], `layers` deep, half of them on either side.

    Its faces are layers dx / 2 from that line. layers: at least h / dx; through fewer of them
    particles find their way. Returns (n, 2) [m].
    """
    begin, finish = finite_array("start", start, (2,)), finite_array("end", end, (2,))
    dx, layers = positive("dx", dx), whole("layers", layers, at_least=1)
    along = finish - begin
    length = positive("length of the plate", np.hypot(*along))
    countable(length / dx * layers)
    n = max(round(length / dx), 1)
    normal = np.array([-along[1], along[0]]) / length * dx
    share = (np.arange(n) + 0.5) / n
    depths = np.arange(layers) - (layers - 1) / 2
    return np.concatenate([begin + share[:, None] * along + depth * normal for depth in depths])
