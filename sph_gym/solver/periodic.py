"""Periodic directions: space closes upon itself, and distances go to the nearest image."""

import math
from typing import Any, NamedTuple

from sph_gym.solver.jit import jitable
from sph_gym.solver.lanes import first_lanes, first_true, like, select

# Multiple of a period, from the middle of the domain, beyond which a particle counts as outside
# after `wrap`; a little more than a half, to allow for rounding.
OUTSIDE = 0.501


class Period(NamedTuple):
    """A direction in which space closes upon itself: low, high [m]; length = high - low."""

    low: float
    high: float
    length: float
    half: float


@jitable
def nearest_image(period, d):
    """The component d of a distance between two particles, to the nearest image of the other."""
    if period is None:
        return d
    d = select(d > like(d, period.half), d - like(d, period.length), d)
    return select(d < like(d, -period.half), d + like(d, period.length), d)


@jitable
def wrap(period, x):
    """Into the domain again at its other end, from at most a period outside."""
    if period is None:
        return x
    x = select(x < like(x, period.low), x + like(x, period.length), x)
    return select(x < like(x, period.high), x, x - like(x, period.length))


@jitable
def first_outside(period, x, n):
    """The first of n lanes that `wrap` couldn't bring back, or -1."""
    if period is None:
        return -1
    distance = abs(x - like(x, period.low + period.half))
    return first_true((distance > like(x, OUTSIDE * period.length)) & first_lanes(x, n))


@jitable
def wrap_far(period, x):
    """Return x of one particle wrapped into the domain, from however far outside."""
    if period is None:
        return x
    return x - period.length * math.floor((x - period.low) / period.length)


def make_period(ends: tuple[float, float] | None, precision: Any) -> Period | None:
    """A periodic direction, where there is one; its length is what the two ends make of it."""
    if ends is None:
        return None
    low, high = precision(ends[0]), precision(ends[1])
    length = precision(high - low)
    return Period(low, high, length, precision(length / 2))
