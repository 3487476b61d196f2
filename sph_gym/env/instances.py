"""Instances: which flow an episode shows. Finite numbered sets, each a seeded draw.

An id such as "dam_break/train/17" names scene, split and number; the number alone decides the
parameters, so an id means the same flow everywhere.
"""

from collections.abc import Callable
from dataclasses import replace
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
    "drop_sequence": 0.03,
    "long_fall": 0.02,
    "colliding_patches": 0.05,
    "sloshing": 0.025,
    "hydrostatic_tank": 0.03,
    "relaxation": 0.03,
}

# Environments whose scene has another name: scenes of their own names exist, with the fluid that
# an analytic reference asks for.
SHOWN_BY = {"colliding_patches": "patch_impact", "sloshing": "shaken_tank"}

# How many frames of the scene make a step of the environment: in a step of a few substeps there
# is little to tune.
FRAMES_PER_STEP = {"dam_break": 1.5, "drop_impact": 1.5}

# Scenes that are no game, and why; all others are benchmarks.
DIAGNOSTIC = {
    "hydrostatic_tank": "the water is at rest: the softest fluid and the longest step win",
    "relaxation": "the blob is at rest: the energy of its jitter depends on the stiffness",
}


class Instance(NamedTuple):
    """One flow: its id, and the scene with the arguments that make it."""

    id: str
    scene: str
    arguments: dict[str, Any]

    def build(self) -> Scene:
        """The scene itself, its frame one step of the environment."""
        built = scenes.make(SHOWN_BY.get(self.scene, self.scene), **self.arguments)
        return replace(built, frame=FRAMES_PER_STEP.get(self.scene, 1.0) * built.frame)


def _dam_break(rng: np.random.Generator, dx: float) -> dict[str, float]:
    width = rng.uniform(12, 17) * dx
    return {
        "width": width,
        "height": width * rng.uniform(1.2, 2.5),
        "tank": rng.uniform(4.0, 7.0),
        "gravity": rng.uniform(4.0, 15.0),
    }


def _drop_impact(rng: np.random.Generator, dx: float) -> dict[str, float]:
    diameter = rng.uniform(9, 14) * dx
    return {
        "diameter": diameter,
        "drop_height": rng.uniform(1.0, 4.0) * diameter,
        "pool_depth": rng.uniform(2, 5) * dx,
        "width": rng.uniform(3.0, 4.5) * diameter,
        "gravity": rng.uniform(4.0, 15.0),
    }


def _drop_sequence(rng: np.random.Generator, dx: float) -> dict[str, float]:
    diameter, gravity = rng.uniform(8, 11) * dx, rng.uniform(4.0, 15.0)
    return {
        "diameter": diameter,
        "drop_height": rng.uniform(0.5, 2.0) * diameter,
        "drops": int(rng.integers(2, 4)),
        "interval": rng.uniform(2.5, 3.5) * float(np.sqrt(diameter / gravity)),
        "pool_depth": rng.uniform(4, 6) * dx,
        "width": rng.uniform(3.5, 5.5) * diameter,
        "gravity": gravity,
    }


def _long_fall(rng: np.random.Generator, dx: float) -> dict[str, float]:
    diameter = rng.uniform(14, 20) * dx
    return {
        "diameter": diameter,
        "drop_height": rng.uniform(4.0, 8.0) * diameter,
        "puddle": rng.uniform(2, 5) * dx,
        "width": rng.uniform(2.0, 4.0) * diameter,
        "gravity": rng.uniform(4.0, 15.0),
    }


def _colliding_patches(rng: np.random.Generator, dx: float) -> dict[str, float]:
    length = rng.uniform(10, 16) * dx
    return {
        "length": length,
        "height": rng.uniform(0.7, 1.3) * length,
        "speed": rng.uniform(0.5, 2.0),
        "gap": rng.uniform(0.5, 1.0) * length,
    }


def _sloshing(rng: np.random.Generator, dx: float) -> dict[str, float]:
    return {
        "length": rng.uniform(55, 75) * dx,
        "fill": rng.uniform(4, 6) * dx,
        "strength": rng.uniform(0.6, 1.0),
        "shakes": rng.uniform(0.5, 1.0),
        "rest": rng.uniform(2.0, 3.0),
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
    "drop_sequence": _drop_sequence,
    "long_fall": _long_fall,
    "colliding_patches": _colliding_patches,
    "sloshing": _sloshing,
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
