"""The flows of the environments, drawn from the families of their scenes.

What was drawn is kept in manifests (`sph_gym.env.manifest`), which say what an id means.
"""

from typing import Any, NamedTuple

import numpy as np

from sph_gym import scenes
from sph_gym.env import contexts
from sph_gym.env.contexts import Context
from sph_gym.scenes.dam_break import draw_flooded_obstacle
from sph_gym.scenes.shared.family import FlowFamily

# By the names of the environments, in the order of the scenes.
FAMILIES: dict[str, FlowFamily] = {
    family.scene: family for family in map(scenes.family, scenes.names()) if family is not None
}
# The numbers of the sets are part of the seeds, never to be changed.
SPLITS = {"nominal": 0, "test": 1, "train": 2, "val": 3, "ood": 4}
# A context is drawn by a generator of its own, so that flows don't hang on how contexts are drawn.
CONTEXT = 1
# Shifts of the instances of "ood", in turns.
SHIFTS = (
    "resolution", "strength", "scene", "viscosity", "between", "beyond", "kernel", "integrator",
)  # fmt: skip
FINER = 0.7


class Drawn(NamedTuple):
    """All that makes a flow: a scene, its arguments, and the numerics; None leaves the scene's."""

    builder: str
    arguments: dict[str, Any]
    context: Context | None = None


def draw(name: str, split: str, number: int, dx: float) -> Drawn:
    """Return flow `number` of a set of an environment; it depends on nothing else.

    dx: particle spacing [m]; the finer flows of "ood" have FINER times it.
    """
    family = FAMILIES[name]
    arguments: dict[str, Any] = {"dx": dx}
    if split == "nominal":
        return Drawn(family.scene, arguments)
    rng = np.random.default_rng([family.seed, SPLITS[split], number])
    arguments |= family.draw(rng, dx)
    numerics = np.random.default_rng([family.seed, SPLITS[split], number, CONTEXT])
    context = contexts.draw(numerics, number)
    if split != "ood":
        return Drawn(family.scene, arguments, context)
    shift = SHIFTS[number % len(SHIFTS)]
    context = contexts.shifted(numerics, number // len(SHIFTS), shift, context)
    return _shifted(family, arguments, shift, rng)._replace(context=context)


def _shifted(
    family: FlowFamily, arguments: dict[str, Any], shift: str, rng: np.random.Generator
) -> Drawn:
    """Return the flow with a property that no other set has, unless the shift is of numerics."""
    dx = arguments["dx"]
    if shift == "resolution":
        return Drawn(family.scene, arguments | {"dx": FINER * dx})
    if shift == "strength":
        name, low, high = family.odd
        return Drawn(family.scene, arguments | {name: rng.uniform(low, high)})
    if shift == "scene":
        return Drawn("dam_break", {"dx": dx} | draw_flooded_obstacle(rng, dx))
    return Drawn(family.scene, arguments)
