"""Instances: which flow an episode shows. Finite numbered sets, each a seeded draw.

An id such as "dam_break/train/17" names scene, split and number; the number alone decides the
parameters, so an id means the same flow everywhere.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sph_gym import scenes
from sph_gym.solver.checks import known
from sph_gym.solver.scene import Scene

SIZES = {"nominal": 1, "train": 64, "val": 16, "test": 32}
PURPOSES = {
    "nominal": "the scene as it is",
    "train": "to learn from and to search on",
    "val": "to choose between what was learned",
    "test": "to compare agents on, and for nothing else",
}

# The scenes that are environments, each at a spacing at which an episode takes a second: some 300
# fluid particles.
NOMINAL_DX = {
    "dam_break": 0.04,
    "drop_impact": 0.03,
    "hydrostatic_tank": 0.03,
    "relaxation": 0.03,
}


class Instance(NamedTuple):
    """One flow: its id, and the scene with the arguments that make it."""

    id: str
    scene: str
    arguments: dict[str, Any]

    def build(self) -> Scene:
        """The scene itself."""
        return scenes.make(self.scene, **self.arguments)


def _dam_break(rng: np.random.Generator, dx: float) -> dict[str, float]:
    width = rng.uniform(8, 14) * dx
    return {
        "width": width,
        "height": width * rng.uniform(1.2, 2.5),
        "tank": rng.uniform(4.0, 7.0),
        "gravity": rng.uniform(4.0, 15.0),
    }


def _drop_impact(rng: np.random.Generator, dx: float) -> dict[str, float]:
    diameter = rng.uniform(7, 12) * dx
    return {
        "diameter": diameter,
        "drop_height": rng.uniform(0.5, 2.5) * diameter,
        "pool_depth": rng.uniform(3, 6) * dx,
        "width": rng.uniform(3.0, 4.5) * diameter,
        "gravity": rng.uniform(4.0, 15.0),
    }


def _hydrostatic_tank(rng: np.random.Generator, dx: float) -> dict[str, float]:
    return {
        "width": rng.uniform(12, 20) * dx,
        "depth": rng.uniform(10, 20) * dx,
        "gravity": rng.uniform(4.0, 15.0),
    }


def _relaxation(rng: np.random.Generator, dx: float) -> dict[str, float]:
    return {
        "diameter": rng.uniform(12, 22) * dx,
        "jitter": rng.uniform(0.02, 0.08),
        "seed": int(rng.integers(2**31)),
    }


_DRAWS: dict[str, Callable[[np.random.Generator, float], dict[str, Any]]] = {
    "dam_break": _dam_break,
    "drop_impact": _drop_impact,
    "hydrostatic_tank": _hydrostatic_tank,
    "relaxation": _relaxation,
}


def instance(scene: str, split: str, number: int, dx: float | None = None) -> Instance:
    """Instance `number` of a split: "nominal" is the scene as it is, the others are drawn.

    dx: particle spacing [m], by default the coarse one of the environments.
    Raises ValueError for names that don't exist and numbers outside the split.
    """
    known("scene", scene, _DRAWS)
    size = SIZES[known("instances", split, SIZES)]
    if not 0 <= number < size:
        raise ValueError(
            f"instance: expected a number from 0 to {size - 1} in {split!r}, got {number}"
        )
    spacing = NOMINAL_DX[scene] if dx is None else dx
    arguments: dict[str, Any] = {"dx": spacing}
    if split != "nominal":
        seed = [sorted(_DRAWS).index(scene), sorted(SIZES).index(split), number]
        arguments |= _DRAWS[scene](np.random.default_rng(seed), spacing)
    return Instance(f"{scene}/{split}/{number}", scene, arguments)


def parse(id_: str, dx: float | None = None) -> Instance:
    """The instance of an id. Raises ValueError if there is none."""
    scene, split, number, *more = [*str(id_).split("/"), "", ""]
    if not number.isdecimal() or any(more):
        raise ValueError(f"instance: expected an id such as 'dam_break/train/17', got {id_!r}")
    return instance(scene, split, int(number), dx)
