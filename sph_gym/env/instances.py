"""Instances: which flow an episode shows. Finite numbered sets, listed in manifests.

An id such as "dam_break/train/17" names scene, split and number; manifests say what it means. At
another spacing than the usual one it is "dam_break/train/17/dx=0.05", and the number alone decides
the draw.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from sph_gym import scenes
from sph_gym.env import manifest
from sph_gym.env.draws import FAMILIES, SHIFTS, Drawn, draw
from sph_gym.solver.checks import known, positive
from sph_gym.solver.scene import Scene

SIZES = {"nominal": 1, "train": 256, "val": 16, "test": 32, "ood": 16}
PURPOSES = {
    "nominal": "the scene as it is",
    "train": "to learn from and to search on",
    "val": "to choose between what was learned",
    "test": "to compare agents on, and for nothing else",
    "ood": "to see what happens out of the distribution, in four ways, in turns",
}
# What is out of distribution in "ood".
ODD = {
    "resolution": "a finer spacing",
    "strength": "another strength of what drives the flow",
    "viscosity": "a viscous fluid",
    "scene": "another scene, a dam break onto a wet bed with an obstacle",
}

# How many frames of the scene make a step of the environment: in a step of a few substeps there
# is little to tune.
FRAMES_PER_STEP = {"dam_break": 1.5, "drop_impact": 1.5}

BENCHMARK = "cheap tricks lose to the tuned CFL rule: `python -m sph_gym study exploits`"
# Scenes that are no game, and why; all others are benchmarks.
DIAGNOSTIC = {
    "hydrostatic_tank": "the water is at rest: the softest fluid and the longest step win",
    "relaxation": "the blob is at rest: the energy of its jitter depends on the stiffness",
}


# One flow, one spelling: int() would take "007" and the digits of all scripts.
NUMBER = re.compile("0|[1-9][0-9]{0,8}")
# What stands before the spacing in an id.
SPACING = "dx="
# What stands for the split in the id of a user's own scene.
CUSTOM = "custom"


class Instance(NamedTuple):
    """One flow: its id, and what makes it."""

    id: str
    drawn: Drawn

    @property
    def scene(self) -> str:
        """Name of the environment's scene."""
        return self.id.split("/")[0]

    @property
    def split(self) -> str:
        """Which of SIZES it belongs to."""
        return self.id.split("/")[1]

    @property
    def number(self) -> int:
        """Which one of its split it is."""
        return int(self.id.split("/")[2])

    @property
    def arguments(self) -> Mapping[str, Any]:
        """Of the scene that shows it."""
        return self.drawn.arguments

    def build(self) -> Scene:
        """The scene itself, its frame one step of the environment."""
        builder, arguments, viscosity = self.drawn
        built = scenes.make(builder, **arguments)
        effects = built.effects
        if viscosity is not None:
            effects = replace(effects, laminar_viscosity=viscosity * built.h * built.fluid.c0)
        frame = FRAMES_PER_STEP.get(builder, 1.0) * built.frame
        return replace(built, effects=effects, frame=frame)


def label(scene: str) -> str:
    """Whether a scene is "benchmark" or "diagnostic"."""
    return "diagnostic" if scene in DIAGNOSTIC else "benchmark"


def why(scene: str) -> str:
    """Why a scene has its label."""
    return DIAGNOSTIC.get(scene, BENCHMARK)


def instance(scene: str, split: str, number: int, dx: float | None = None) -> Instance:
    """Instance `number` of a split: "nominal" is the scene as it is, the others are drawn.

    dx: particle spacing [m], by default the coarse one of the environments.
    Raises ValueError for names that don't exist and numbers outside the split.
    """
    known("scene", scene, FAMILIES)
    size = SIZES[known("instances", split, SIZES)]
    if not 0 <= number < size:
        raise ValueError(
            f"instance: expected a number from 0 to {size - 1} in {split!r}, got {number}"
        )
    id_, usual = f"{scene}/{split}/{number}", FAMILIES[scene].dx
    if dx is not None and dx != usual:
        return Instance(f"{id_}/{SPACING}{dx!r}", draw(scene, split, number, dx))
    entry = manifest.entry(id_)
    return Instance(id_, draw(scene, split, number, usual) if entry is None else entry.drawn)


def shift(id_: str) -> str:
    """What is out of distribution in an instance of "ood", one of ODD; else empty.

    Raises ValueError if there is no such instance.
    """
    found = parse(id_)
    return SHIFTS[found.number % len(SHIFTS)] if found.split == "ood" else ""


def parse(id_: str) -> Instance:
    """The instance of an id. Raises ValueError if there is none."""
    scene, split, number, spacing, *more = [*str(id_).split("/"), "", "", ""]
    if not NUMBER.fullmatch(number) or any(more) or not (spacing or SPACING).startswith(SPACING):
        raise _no_id(id_)
    dx = None
    if spacing:
        try:
            dx = positive("dx", float(spacing.removeprefix(SPACING)))
        except ValueError:
            raise _no_id(id_) from None
    return instance(scene, split, int(number), dx)


def _no_id(id_: Any) -> ValueError:
    return ValueError(
        f"instance: expected an id such as 'dam_break/train/17' or 'dam_break/train/17/dx=0.05', "
        f"got {id_!r}"
    )
