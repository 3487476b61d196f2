"""Instances: the flows that episodes show, in finite numbered sets that manifests list.

An id such as "dam_break/train/17" names environment, set and number; manifests say what it means.
Lengths are drawn in multiples of the spacing: "dam_break/train/17/dx=0.05" is a larger flow, of
about as many particles. "dam_break/train/17/finer=2" is the same flow with half the usual spacing.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from sph_gym import scenes
from sph_gym.env import manifest
from sph_gym.env.distributions import FAMILIES, SHIFTS, Drawn, draw
from sph_gym.solver.checks import known, positive, whole
from sph_gym.solver.scene import Scene

SIZES = {"nominal": 1, "train": 256, "val": 16, "test": 32, "ood": 16}
PURPOSES = {
    "nominal": "the scene as it is",
    "train": "to learn from and to search on",
    "val": "to choose between what was learned",
    "test": "to compare agents on, and for nothing else",
    "ood": "to see what happens out of the distribution, in eight ways, in turns",
}
# Descriptions of the shifts of "ood".
ODD = {
    "resolution": "a finer spacing",
    "strength": "another strength of what drives the flow",
    "scene": "another scene, a dam break onto a wet bed with an obstacle",
    "viscosity": "a viscous fluid",
    "between": "artificial viscosity between the two ends",
    "beyond": "artificial viscosity beyond the two ends",
    "kernel": "a matched kernel instead of the article's",
    "integrator": "another integrator",
}

BENCHMARK = (
    "cheap tricks earn less than the tuned CFL rule on average, except on `patch_impact`; on "
    "single flows some win: `python -m sph_gym study exploits`"
)
# Environments that are no benchmarks, and why.
DIAGNOSTIC = {name: family.diagnostic for name, family in FAMILIES.items() if family.diagnostic}

# One flow, one spelling: int() would take "007" and the digits of all scripts.
NUMBER = re.compile("0|[1-9][0-9]{0,8}")
# Ends of ids: "dx=0.05" is another spacing [m], "finer=2" divides the usual one by 2.
SPACING, FINER = "dx=", "finer="
# Name of the set in the id of a user's own scene.
CUSTOM = "custom"


class Instance(NamedTuple):
    """One flow: its id, and what makes it."""

    id: str
    drawn: Drawn

    @property
    def scene(self) -> str:
        """Name of the environment."""
        return self.id.split("/")[0]

    @property
    def split(self) -> str:
        """Name of its set, one of SIZES."""
        return self.id.split("/")[1]

    @property
    def number(self) -> int:
        """Number within its set."""
        return int(self.id.split("/")[2])

    @property
    def arguments(self) -> Mapping[str, Any]:
        """Arguments of the scene that shows it."""
        return self.drawn.arguments

    def build(self) -> Scene:
        """Return the scene itself, its frame one step of the environment."""
        builder, arguments, context = self.drawn
        built = scenes.make(builder, **arguments)
        family = scenes.family(builder)
        frames = 1.0 if family is None else family.frames_per_step
        framed = replace(built, frame=frames * built.frame)
        return framed if context is None else context.apply(framed)


def label(scene: str) -> str:
    """Return "benchmark" or "diagnostic"."""
    return FAMILIES[scene].kind


def instance(
    scene: str, split: str, number: int, dx: float | None = None, finer: int = 1
) -> Instance:
    """Return instance `number` of a set: "nominal" is the scene as it is, the others are drawn.

    dx: particle spacing [m], by default the usual one of the environment, with which all drawn
    lengths grow; finer: factor by which the usual spacing of the same flow is divided.
    Raises ValueError for names that don't exist, numbers outside the set, and dx beside finer.
    """
    known("scene", scene, FAMILIES)
    size = SIZES[known("instances", split, SIZES)]
    if number not in range(size):
        raise ValueError(
            f"instance: expected a number from 0 to {size - 1} in {split!r}, got {number!r}"
        )
    id_, usual = f"{scene}/{split}/{number}", FAMILIES[scene].dx
    if whole("finer", finer, at_least=1) > 1 and dx is not None:
        raise ValueError(f"finer: expected 1 beside dx, got {finer}")
    if dx is not None and dx != usual:
        return Instance(f"{id_}/{SPACING}{dx!r}", draw(scene, split, number, dx))
    entry = manifest.entry(id_)
    drawn = draw(scene, split, number, usual) if entry is None else entry.drawn
    if finer == 1:
        return Instance(id_, drawn)
    arguments = drawn.arguments | {"dx": drawn.arguments["dx"] / finer}
    return Instance(f"{id_}/{FINER}{finer}", drawn._replace(arguments=arguments))


def shift(id_: str) -> str:
    """Return what is out of distribution in an instance of "ood", one of ODD; else empty.

    Raises ValueError if there is no such instance.
    """
    found = parse(id_)
    return SHIFTS[found.number % len(SHIFTS)] if found.split == "ood" else ""


def parse(id_: str) -> Instance:
    """Return the instance of an id. Raises ValueError if there is none."""
    scene, split, number, end, *more = [*str(id_).split("/"), "", "", ""]
    if not NUMBER.fullmatch(number) or any(more):
        raise _no_id(id_)
    if end.startswith(FINER):
        factor = end.removeprefix(FINER)
        # one flow, one spelling, here too
        if not NUMBER.fullmatch(factor) or int(factor) < 2:
            raise _no_id(id_)
        return instance(scene, split, int(number), finer=int(factor))
    if not end:
        return instance(scene, split, int(number))
    if not end.startswith(SPACING):
        raise _no_id(id_)
    try:
        dx = positive("dx", float(end.removeprefix(SPACING)))
    except ValueError:
        raise _no_id(id_) from None
    return instance(scene, split, int(number), dx)


def _no_id(id_: Any) -> ValueError:
    return ValueError(
        "instance: expected an id such as 'dam_break/train/17', 'dam_break/train/17/dx=0.05' or "
        f"'dam_break/train/17/finer=2', got {id_!r}"
    )
