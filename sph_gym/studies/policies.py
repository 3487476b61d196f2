"""Hostile policies: random, extreme, or made to break the solver.

Each is an endless stream of pushes, (3,) in [-1, 1], to be played as actions of any mode.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Push = NDArray[np.float64]
PushPolicy = Callable[[np.random.Generator], Iterator[Push]]

STEP = 0.2


def drawn(draw: Callable[[np.random.Generator], Any]) -> PushPolicy:
    """Return a policy that draws every push anew."""

    def policy(rng: np.random.Generator) -> Iterator[Push]:
        while True:
            yield np.asarray(draw(rng))

    return policy


def corner(rng: np.random.Generator) -> Push:
    """Return a random corner of the action space."""
    return rng.choice((-1.0, 1.0), 3)


def switching(rng: np.random.Generator) -> Iterator[Push]:
    """Alternate between a corner and the opposite one."""
    push = corner(rng)
    while True:
        yield push
        push = -push


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


HOSTILE: dict[str, PushPolicy] = {
    "uniform": drawn(lambda rng: rng.uniform(-1, 1, 3)),
    "corners": drawn(corner),
    "switching": switching,
    # the softest fluid with the longest step, and the stiffest with the largest Courant number
    "softest": drawn(lambda rng: [1.0, -1.0, rng.uniform(-1, 1)]),
    "stiffest": drawn(lambda rng: [1.0, 1.0, rng.choice((-1.0, 1.0))]),
    "ambush": ambush,
    "walk": walk,
    "held": held,
}
