"""Families: the distributions from which environments draw the flows that they play."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

# Ranges of gravity [m/s^2], and the one that is far from it.
GRAVITY = (4.0, 15.0)
STRONG_GRAVITY = ("gravity", 20.0, 40.0)


@dataclass(frozen=True)
class FlowFamily:
    """The flows of an environment and what is known of it as a game; `FAMILY` of a scene's module.

    scene: name of the scene that shows them, and of the environment; dx: a spacing at which an
    episode takes a second [m], with some 300 fluid particles; seed: of the draws, never to be
    changed; draw: returns the arguments except dx, given a generator and dx: lengths in multiples
    of dx, so that a flow has about as many particles at any dx; odd: the argument that is far from
    all others in "ood", and the range that it has there.
    frames_per_step: frames of the scene that make a step of the environment, more than one where a
    frame has too few substeps to tune.
    diagnostic: why cheap tricks may win, empty if they lose to the tuned CFL rule; headroom: work
    of the best static setting / work of the look-ahead oracle (`python -m sph_gym study headroom`),
    None if not measured, nan if the two are nowhere both within tolerance; remark: on it.
    """

    scene: str
    dx: float
    seed: int
    draw: Callable[[np.random.Generator, float], dict[str, Any]]
    odd: tuple[str, float, float]
    frames_per_step: float = 1.0
    diagnostic: str = ""
    headroom: float | None = None
    remark: str = ""

    @property
    def kind(self) -> str:
        """ "benchmark" or "diagnostic"."""
        return "diagnostic" if self.diagnostic else "benchmark"

    @property
    def label(self) -> str:
        """The kind, and the remark on the headroom."""
        return f"{self.kind}, {self.remark}" if self.remark else self.kind

    @property
    def gain(self) -> str:
        """The headroom in words."""
        if self.headroom is None:
            return "not measured"
        if math.isnan(self.headroom):
            return "unknown: nowhere are both within tolerance"
        return f"{self.headroom:.2f} times less work"
