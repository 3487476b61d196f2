"""The flows of the environments, drawn from the families of their scenes.

What was drawn is kept in manifests (`sph_gym.env.manifest`), which say what an id means.
"""

from typing import Any, NamedTuple

import numpy as np

from sph_gym import scenes
from sph_gym.scenes.dam_break import draw_flooded_obstacle
from sph_gym.scenes.shared.family import FlowFamily

# By the names of the environments, in the order of the scenes.
FAMILIES: dict[str, FlowFamily] = {
    family.name: family for family in map(scenes.family, scenes.names()) if family is not None
}
# The numbers of the sets are part of the seeds, never to be changed.
SPLITS = {"nominal": 0, "test": 1, "train": 2, "val": 3, "ood": 4}
# Shifts of the instances of "ood", in turns.
SHIFTS = ("resolution", "strength", "viscosity", "scene")
FINER = 0.7


class Drawn(NamedTuple):
    """All that makes a flow: a scene, its arguments, and a change of the scene.

    viscosity: laminar, in multiples of h c0; None leaves the scene's own.
    """

    builder: str
    arguments: dict[str, Any]
    viscosity: float | None = None


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
    if split == "ood":
        return _shifted(family, arguments, SHIFTS[number % len(SHIFTS)], rng)
    return Drawn(family.scene, arguments)


def _shifted(
    family: FlowFamily, arguments: dict[str, Any], shift: str, rng: np.random.Generator
) -> Drawn:
    """Return the flow with a property that no other set has."""
    dx = arguments["dx"]
    if shift == "resolution":
        return Drawn(family.scene, arguments | {"dx": FINER * dx})
    if shift == "strength":
        name, low, high = family.odd
        return Drawn(family.scene, arguments | {name: rng.uniform(low, high)})
    if shift == "viscosity":
        return Drawn(family.scene, arguments, rng.uniform(0.003, 0.01))
    return Drawn("dam_break", {"dx": dx} | draw_flooded_obstacle(rng, dx))
