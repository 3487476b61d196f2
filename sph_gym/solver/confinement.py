"""Walls that act after a move: the box that clamps positions, and plates that no path crosses.

Boundary particles push back before a particle arrives. The box and the plates stop those that
arrive all the same: a side of the box holds everything beyond it, so that no speed is too high,
and a plate looks at the whole path of a step.
"""

import math
from typing import Any, NamedTuple

from sph_gym.solver.jit import jitable
from sph_gym.solver.lanes import broadcast, like, maximum, minimum, rsqrt, select


class Box(NamedTuple):
    """Clamping walls in the precision of the arrays: sides [m], restitution in [0, 1].

    left, right, bottom, top: velocities of the sides [m/s], each along its normal.
    """

    x_min: float
    x_max: float
    y_min: float
    y_max: float
    restitution: float
    left: float
    right: float
    bottom: float
    top: float


class Plates(NamedTuple):
    """Segments; x0, y0, x1, y1: (n,) their ends [m]; restitution; skin: distance in front of a
    plate at which a particle that hit it is put [m].

    In a periodic domain also their images a period away, where a step may lead.
    """

    x0: Any
    y0: Any
    x1: Any
    y1: Any
    restitution: float
    skin: float


class Stroke(NamedTuple):
    """The motion of moving walls, see `Motion`; sides: whether left, right, bottom, top move."""

    u: float
    v: float
    ax: float
    ay: float
    omega: float
    left: float
    right: float
    bottom: float
    top: float


@jitable
def reflect(low, high, low_speed, high_speed, restitution, x, u):
    """Put a particle back onto the side that it passed and turn its normal velocity round.

    Position and velocity both: with the position alone it would press into the wall for ever.
    The velocity as a side sees it that moves itself. A position that is not a number stays one.
    """
    u = select(x < low, maximum(low_speed - restitution * (u - low_speed), u), u)
    u = select(x > high, minimum(high_speed - restitution * (u - high_speed), u), u)
    return minimum(high, maximum(low, x)), u


@jitable
def confine(box, stroke, time, x, y, u, v):
    """`reflect` at the four sides of the box, where there is one, as they are at a time [s]."""
    if box is None:
        return x, y, u, v
    box = moved_box(stroke, box, time)
    x, u = reflect(box.x_min, box.x_max, box.left, box.right, box.restitution, x, u)
    y, v = reflect(box.y_min, box.y_max, box.bottom, box.top, box.restitution, y, v)
    return x, y, u, v


@jitable
def stop_at_plates(plates, old_x, old_y, x, y, u, v):
    """End a path in front of the first plate in its way, and reflect the normal velocity.

    In a corner that may send a particle through another plate; then it stays where it was.
    """
    if plates is None:
        return x, y, u, v
    first, skin = like(old_x, 2.0), like(old_x, plates.skin)
    nx = ny = like(old_x, 0.0)
    for k in range(plates.x0.size):
        share, px, py = meet_plate(plates, k, old_x, old_y, x, y)
        nx, ny = select(share < first, px, nx), select(share < first, py, ny)
        first = minimum(share, first)
    hits = first < like(first, 1.5)
    x = select(hits, old_x + first * (x - old_x) + skin * nx, x)
    y = select(hits, old_y + first * (y - old_y) + skin * ny, y)
    u, v = turn_round(plates, nx, ny, u, v)
    for k in range(plates.x0.size):
        share, px, py = meet_plate(plates, k, old_x, old_y, x, y)
        hits = share < like(share, 1.5)
        x, y = select(hits, old_x, x), select(hits, old_y, y)
        u, v = turn_round(plates, px, py, u, v)
    return x, y, u, v


@jitable
def meet_plate(plates, k, old_x, old_y, x, y):
    """Share of a path after which it meets plate k, and the normal there, towards its start.

    Paths that don't have share 2 and no normal. A path that ends on the plate meets it; one that
    sets out from there begins on its left side.
    """
    px, py = broadcast(plates.x0, k), broadcast(plates.y0, k)
    tx, ty = broadcast(plates.x1, k) - px, broadcast(plates.y1, k) - py
    zero, one = like(old_x, 0.0), like(old_x, 1.0)
    length2 = tx * tx + ty * ty
    inv_length = rsqrt(length2)
    nx, ny = -ty * inv_length, tx * inv_length
    before = (old_x - px) * nx + (old_y - py) * ny
    after = (x - px) * nx + (y - py) * ny
    side = select(before < zero, -one, one)
    travelled = before - after
    share = before / select(abs(travelled) > zero, travelled, one)
    hit_x, hit_y = old_x + share * (x - old_x), old_y + share * (y - old_y)
    # a skin beyond both ends, so that rounding leaves no gap between plates that share one
    along = ((hit_x - px) * tx + (hit_y - py) * ty) * inv_length
    skin = like(along, plates.skin)
    missed = select(along < -skin, one, select(along > length2 * inv_length + skin, one, zero))
    missed = select(side * after > zero, one, missed) > zero
    share = select(missed, one + one, share)
    return share, select(missed, zero, side * nx), select(missed, zero, side * ny)


@jitable
def turn_round(plates, nx, ny, u, v):
    """Velocities after a collision with a plate of normal nx, ny; without a normal, unchanged."""
    approach = minimum(u * nx + v * ny, like(u, 0.0))
    turned = (like(u, 1.0) + like(u, plates.restitution)) * approach
    return u - turned * nx, v - turned * ny


@jitable
def stroke_at(stroke, time):
    """Return the displacement of the moving walls [m] and their velocity [m/s]."""
    phase = stroke.omega * time
    swing, rate = math.sin(phase), stroke.omega * math.cos(phase)
    x, y = stroke.u * time + stroke.ax * swing, stroke.v * time + stroke.ay * swing
    return x, y, stroke.u + stroke.ax * rate, stroke.v + stroke.ay * rate


@jitable
def moved_box(stroke, box, time):
    """The box at a time [s]."""
    if stroke is None:
        return box
    x, y, u, v = stroke_at(stroke, time)
    return Box(
        box.x_min + like(box.x_min, stroke.left * x),
        box.x_max + like(box.x_min, stroke.right * x),
        box.y_min + like(box.x_min, stroke.bottom * y),
        box.y_max + like(box.x_min, stroke.top * y),
        box.restitution,
        like(box.x_min, stroke.left * u),
        like(box.x_min, stroke.right * u),
        like(box.x_min, stroke.bottom * v),
        like(box.x_min, stroke.top * v),
    )
