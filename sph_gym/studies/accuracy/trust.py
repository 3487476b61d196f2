"""How far the errors of a line can be believed: luck, trends, and fluids that are mush."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Of convergence in dx: below it, errors differ by chance rather than by resolution.
LEAST_ORDER = 0.3
# The same over the finest few: below it, errors have come to rest or begin to grow.
STILL_FALLING = 0.1
# Of convergence in dx: no faster are errors expected to go on falling.
MOST_ORDER = 2.0
# Resolutions that tell where errors go at the fine end.
RECENT = 3
# Of the mean over fluid and time of max(rho / rho0 - 1, 0), and of the fastest particle's Mach
# number: a fluid that is squeezed or hurried more is another one, whatever its error.
MOST_COMPRESSION, MOST_MACH = 0.02, 0.35


def envelope(errors: Array) -> Array:
    """(n,) the largest error here and at all finer resolutions; coarse first."""
    return np.maximum.accumulate(errors[::-1])[::-1]


def slope(across: Array, errors: Array) -> float:
    """d log error / d log across, by least squares: minus the order of convergence."""
    return float(np.polyfit(np.log(across), np.log(errors), 1)[0])


def expected(across: Array, errors: Array, at: float) -> float:
    """The error that the finest of others lead to expect at a finer resolution.

    Their power law, which neither rises nor falls faster than with second order.
    """
    x, y = np.log(across[-RECENT:]), np.log(errors[-RECENT:])
    fitted = slope(across[-RECENT:], errors[-RECENT:]) if len(x) > 1 else 0.0
    steep = min(max(fitted, -MOST_ORDER), 0.0)
    return float(np.exp(y.mean() + steep * (np.log(at) - x.mean())))


def raised(across: Array, errors: Array) -> Array:
    """(n,) the same errors, but the finest is at least what the others lead to expect there.

    Nothing finer tells whether it is luck that it is smaller.
    """
    found = np.array(errors, float)
    if len(found) > 1:
        found[-1] = max(found[-1], expected(across[:-1], found[:-1], float(across[-1])))
    return found


def counted(across: Array, errors: Array) -> Array:
    """(n,) what an error counts as: the largest at this and finer resolutions, luck apart."""
    return envelope(raised(across, errors))


def doubt(across: Array, errors: Array) -> float:
    """The worst ratio of an inner error to what the others promise at its place; at least 1."""
    worst, x, known = 1.0, np.log(across), raised(across, errors)
    for k in range(1, len(known) - 1):
        others = np.arange(len(known)) != k
        promised = np.interp(x[k], x[others], np.log(envelope(known[others])))
        worst = max(worst, float(known[k] / np.exp(promised)))
    return worst


def falls(across: Array, errors: Array) -> bool:
    """Whether errors fall with dx, over all resolutions and still over the finest few.

    Each counts as much as those of finer runs, so that one of luck doesn't tilt the rest.
    """
    worst, fine = envelope(errors), slice(-RECENT, None)
    return (
        slope(across, worst) <= -LEAST_ORDER and slope(across[fine], worst[fine]) <= -STILL_FALLING
    )


def mush(runs: Sequence[Any]) -> bool:
    """Whether the fluid of any of some runs is too soft for what happens to it."""
    return any(run.compression > MOST_COMPRESSION or run.mach > MOST_MACH for run in runs)
