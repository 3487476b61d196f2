"""Hostile policies: random, extreme, or made to break the solver.

Each is an endless stream of pushes, (3,) in [-1, 1], to be played as actions of any mode.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

Push = NDArray[np.float64]

STEP = 0.2


def uniform(rng: np.random.Generator) -> Iterator[Push]:
    """Yield uniform random actions."""
    while True:
        yield rng.uniform(-1, 1, 3)


def corners(rng: np.random.Generator) -> Iterator[Push]:
    """Yield random corners of the action space."""
    while True:
        yield rng.choice((-1.0, 1.0), 3)


def switching(rng: np.random.Generator) -> Iterator[Push]:
    """Alternate between a corner and the opposite one."""
    corner = rng.choice((-1.0, 1.0), 3)
    while True:
        yield corner
        corner = -corner


def softest(rng: np.random.Generator) -> Iterator[Push]:
    """Ask for the softest fluid with the longest step."""
    while True:
        yield np.array([1.0, -1.0, rng.uniform(-1, 1)])


def stiffest(rng: np.random.Generator) -> Iterator[Push]:
    """Ask for the stiffest fluid with the largest Courant number."""
    while True:
        yield np.array([1.0, 1.0, rng.choice((-1.0, 1.0))])


def ambush(rng: np.random.Generator) -> Iterator[Push]:
    """Let a soft fluid be compressed for some steps, then stiffen it at one blow."""
    while True:
        for _ in range(rng.integers(1, 8)):
            yield np.array([0.5, -1.0, -1.0])
        yield np.array([1.0, 1.0, -1.0])


def walk(rng: np.random.Generator) -> Iterator[Push]:
    """Walk at random in small steps."""
    place = rng.uniform(-1, 1, 3)
    while True:
        yield place
        place = np.clip(place + rng.normal(0.0, STEP, 3), -1, 1)


def held(rng: np.random.Generator) -> Iterator[Push]:
    """Hold one entry at an end of its range and draw the others at random."""
    entry, end = rng.integers(3), rng.choice((-1.0, 1.0))
    while True:
        push = rng.uniform(-1, 1, 3)
        push[entry] = end
        yield push


POLICIES: dict[str, Callable[[np.random.Generator], Iterator[Push]]] = {
    "uniform": uniform,
    "corners": corners,
    "switching": switching,
    "softest": softest,
    "stiffest": stiffest,
    "ambush": ambush,
    "walk": walk,
    "held": held,
}
