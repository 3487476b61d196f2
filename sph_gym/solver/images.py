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
from sph_gym.solver.lanes import highest, like, lowest, minimum, replaced, select

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


# --- Plates ---------------------------------------------------------------------------------


class MirrorPlates(NamedTuple):
    """Plates that mirror the fluid on both sides and hide one side from the other, and corners.

    x, y: (n,) a point of each [m]; nx, ny: its normal; low, high: its ends along (-ny, nx), seen
    from that point [m]; corner: 1 for a corner where two of them meet at right angles, the fluid
    being where both coordinates are positive, else 0; h: support radius [m].
    """

    x: Any
    y: Any
    nx: Any
    ny: Any
    low: Any
    high: Any
    corner: Any
    h: float


# Two parts of a plate's effect on a pair: the image is added, the particle behind it is hidden.
ADDED, HIDDEN = range(2)


@jitable
def before_plate(plates, k, x, y):
    """Return the distance from plate k [m], negative on its far side, and the place along it."""
    dx, dy = x - like(x, plates.x[k]), y - like(y, plates.y[k])
    nx, ny = like(x, plates.nx[k]), like(x, plates.ny[k])
    return dx * nx + dy * ny, dy * nx - dx * ny


@jitable
def is_at_plate(plates, k, x, y):
    """Return whether a group at x, y [m] may see its images in plate k."""
    s, along = before_plate(plates, k, x, y)
    h = float(plates.h)
    low, high = float(plates.low[k]) - h, float(plates.high[k]) + h
    return float(lowest(abs(s))) < h and float(lowest(along)) < high and float(highest(along)) > low


@jitable
def crosses(plates, k, s, along, s_j, along_j):
    """Return 1 where the straight way from s, along to the other place meets plate k, else 0.

    Seen as if both were on different sides; the way to an image meets it at the same point.
    """
    zero, one = like(s, 0.0), like(s, 1.0)
    a, b = abs(s), abs(s_j)
    meeting, total = along * b + along_j * a, a + b
    missed = select(meeting < like(s, plates.low[k]) * total, one, zero)
    return select(meeting > like(s, plates.high[k]) * total, zero, one - missed)


@jitable
def through_plate(plates, k, what, x, y, x_j, y_j):
    """Return whether plate k adds or hides anything, and from where particle j has to be seen.

    what: ADDED, for which a group at x, y [m] is mirrored, or HIDDEN. Lanes that nothing happens
    to are out of reach.
    """
    zero, one = like(x, 0.0), like(x, 1.0)
    s, along = before_plate(plates, k, x, y)
    s_j, along_j = before_plate(plates, k, like(x, x_j), like(x, y_j))
    opposite = select(s * s_j < zero, one, zero)
    acts = crosses(plates, k, s, along, s_j, along_j)
    corner = like(x, plates.corner[k])
    if what == ADDED:
        # in a corner both of both are inside
        within = select(minimum(minimum(s, s_j), minimum(along, along_j)) < zero, zero, one)
        acts = acts * (one - opposite) * (one - corner * (one - within))
        nx, ny = like(x, plates.nx[k]), like(x, plates.ny[k])
        twice, turned_along = s + s, corner * (along + along)
        x, y = x - twice * nx + turned_along * ny, y - twice * ny - turned_along * nx
    else:
        acts = acts * opposite * (one - corner)
        for q in range(k):
            # what an earlier plate hides is hidden once
            s, along = before_plate(plates, q, x, y)
            s_q, along_q = before_plate(plates, q, like(x, x_j), like(x, y_j))
            before = select(s * s_q < zero, one - like(x, plates.corner[q]), zero)
            acts = acts * (one - before * crosses(plates, q, s, along, s_q, along_q))
    out = like(x, plates.h) * like(x, 4.0)
    return float(highest(acts)) > 0.5, x + (one - acts) * out, y


@jitable
def mirror_matrix(plates, k, what):
    """Return xx, xy and yy of the matrix that turns vectors as `through_plate` turns places."""
    if what == HIDDEN:
        return 1.0, 0.0, 1.0
    nx, ny, corner = float(plates.nx[k]), float(plates.ny[k]), float(plates.corner[k])
    return (
        1.0 - 2.0 * nx * nx - 2.0 * corner * ny * ny,
        -2.0 * (1.0 - corner) * nx * ny,
        1.0 - 2.0 * ny * ny - 2.0 * corner * nx * nx,
    )
