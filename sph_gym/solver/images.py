"""Images of the fluid behind plane sides of the box, which no boundary particles stand for.

A kernel is cut off at such a side: without anything beyond it, the fluid has too small a density
there, and settles. So the fluid is continued as in a mirror, which is exact for a wall without
friction: a flow against a plane is half of a symmetric one. In a corner two mirrors make a third
image. The neighbours of an image are neighbours of the particle itself, so that no list is longer.

By symmetry, what an image of particle j does to particle i is what j does to the image of i,
mirrored. The loops therefore mirror the group of i.
"""

from typing import Any, NamedTuple

from sph_gym.solver.confinement import Box, moved_box
from sph_gym.solver.jit import jitable
from sph_gym.solver.lanes import highest, like, lowest, replaced, select

# Images of a particle are numbered 3 k + l: k tells its place in x, itself, behind the lower or
# behind the upper side; l that in y. Number 0 is the particle.
N_IMAGES = 9
# Share of dx: how far in front of such a side a particle that passed it is put. On the side it
# would be at one place with its image, which could not push it off.
FREEBOARD = 0.1


class Image(NamedTuple):
    """A group of particles behind a side or a corner.

    x, y: [m]; x_low, x_high, y_low, y_high: [m] only sources between these are near enough.
    """

    x: Any
    y: Any
    x_low: float
    x_high: float
    y_low: float
    y_high: float


@jitable
def mirrored(low, high, place, h, x):
    """Return x [m] behind a side, and the interval [m] of the sources that are near enough.

    place: 0 for x itself, 1 behind the side `low`, 2 behind `high`. Boundary particles that are
    outside have no image: they are put out of reach.
    """
    if place == 1:
        out = like(x, low) - like(x, h + h)
        x = select(x < like(x, low), out, like(x, low + low) - x)
        return x, float(low), float(highest(x)) + float(h)
    if place == 2:
        out = like(x, high) + like(x, h + h)
        x = select(x > like(x, high), out, like(x, high + high) - x)
        return x, float(lowest(x)) - float(h), float(high)
    return x, -1e300, 1e300


@jitable
def image_of(mirrors, k, h, x, y):
    """Return image k of a group at x, y [m]; h: support radius [m]."""
    x, x_low, x_high = mirrored(mirrors.x_min, mirrors.x_max, k // 3, h, x)
    y, y_low, y_high = mirrored(mirrors.y_min, mirrors.y_max, k % 3, h, y)
    return Image(x, y, x_low, x_high, y_low, y_high)


@jitable
def is_near(image):
    """Return whether there is room for sources that are near enough to an image."""
    return image.x_low < image.x_high and image.y_low < image.y_high


@jitable
def meets(image, sources, j):
    """Return whether particle j of `sources` may be near enough to an image."""
    x, y = sources.x[j], sources.y[j]
    return image.x_low <= x and x <= image.x_high and image.y_low <= y and y <= image.y_high


@jitable
def turned(low_speed, high_speed, place, u):
    """Return a velocity [m/s] in the mirror of a side with the speeds given, and the sign."""
    if place == 1:
        return like(u, low_speed + low_speed) - u, -1.0
    if place == 2:
        return like(u, high_speed + high_speed) - u, -1.0
    return u, 1.0


@jitable
def with_mirrors(mirrors, stroke, model, time):
    """Return the model with its mirrors where they are at a time [s]."""
    if mirrors is None:
        return model
    return _with_moved(stroke, mirrors, model, time)


@jitable
def _with_moved(stroke, mirrors, model, time):
    if stroke is None:
        return model
    return replaced(model, "mirrors", moved_box(stroke, mirrors, time))


def make_mirrors(sides: tuple[float, ...] | None, number: Any) -> Box | None:
    """Return the sides [m] that mirror the fluid, infinite where they don't; None if none does."""
    if sides is None:
        return None
    return Box(*(number(side) for side in (*sides, *[0.0] * 5)))
