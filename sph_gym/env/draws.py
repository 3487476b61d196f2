"""How the flows of the environments are drawn: sizes in multiples of dx, so that any dx will do.

What is drawn is kept in manifests (`sph_gym.env.manifest`), which say what an id means.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

Arguments = dict[str, Any]


class Drawn(NamedTuple):
    """What makes a flow: a scene, its arguments, and what is changed in the scene that they make.

    viscosity: laminar, in multiples of h c0; None leaves the scene's own.
    """

    builder: str
    arguments: Arguments
    viscosity: float | None = None


class Family(NamedTuple):
    """The flows of an environment.

    builder: the scene that shows them; dx: a spacing at which an episode takes a second [m], some
    300 fluid particles; seed: of its draws, never to be changed; draw: arguments but dx; odd: the
    argument that is far from all others in "ood", and the range that it then has.
    """

    builder: str
    dx: float
    seed: int
    draw: Callable[[np.random.Generator, float], Arguments]
    odd: tuple[str, float, float]


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
        "drop_height": rng.uniform(3.0, 6.0) * diameter,
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


def _flooded_obstacle(rng: np.random.Generator, dx: float) -> Arguments:
    width = rng.uniform(12, 16) * dx
    return {
        "width": width,
        "height": width * rng.uniform(1.2, 2.0),
        "tank": rng.uniform(4.0, 6.0),
        "gravity": rng.uniform(4.0, 15.0),
        "wet_bed": rng.uniform(2, 4) * dx,
        "obstacle": rng.uniform(4, 7) * dx,
        "obstacle_at": rng.uniform(2.0, 2.8),
    }


STRONG_GRAVITY = ("gravity", 20.0, 40.0)
# `colliding_patches` and `sloshing` of the same names exist as scenes, with the fluid that an
# analytic reference asks for.
FAMILIES = {
    "dam_break": Family("dam_break", 0.04, 1, _dam_break, STRONG_GRAVITY),
    "drop_impact": Family("drop_impact", 0.03, 2, _drop_impact, STRONG_GRAVITY),
    "drop_sequence": Family("drop_sequence", 0.03, 3, _drop_sequence, STRONG_GRAVITY),
    "long_fall": Family("long_fall", 0.02, 5, _long_fall, STRONG_GRAVITY),
    "colliding_patches": Family(
        "patch_impact", 0.05, 0, _colliding_patches, ("speed", 4.0, 8.0)
    ),
    "sloshing": Family("shaken_tank", 0.025, 7, _sloshing, STRONG_GRAVITY),
    "hydrostatic_tank": Family("hydrostatic_tank", 0.03, 4, _hydrostatic_tank, STRONG_GRAVITY),
    "relaxation": Family("relaxation", 0.03, 6, _relaxation, ("jitter", 0.1, 0.15)),
}  # fmt: skip

# Their numbers are part of the seeds, never to be changed.
SPLITS = {"nominal": 0, "test": 1, "train": 2, "val": 3, "ood": 4}
# What is out of distribution in "ood", in turns.
SHIFTS = ("resolution", "strength", "viscosity", "scene")
FINER = 0.7


def draw(scene: str, split: str, number: int, dx: float) -> Drawn:
    """Flow `number` of a split of an environment's scene; it depends on nothing else.

    dx: particle spacing [m]; of the flows in "ood" that are finer, 1 / FINER times theirs.
    """
    family = FAMILIES[scene]
    arguments: Arguments = {"dx": dx}
    if split == "nominal":
        return Drawn(family.builder, arguments)
    rng = np.random.default_rng([family.seed, SPLITS[split], number])
    drawn = Drawn(family.builder, arguments | family.draw(rng, dx))
    return drawn if split != "ood" else _shifted(family, drawn, SHIFTS[number % 4], rng)


def _shifted(family: Family, drawn: Drawn, shift: str, rng: np.random.Generator) -> Drawn:
    """The flow with something that no other split has."""
    builder, arguments, dx = drawn.builder, drawn.arguments, drawn.arguments["dx"]
    if shift == "resolution":
        return Drawn(builder, arguments | {"dx": FINER * dx})
    if shift == "strength":
        name, low, high = family.odd
        return Drawn(builder, arguments | {name: rng.uniform(low, high)})
    if shift == "viscosity":
        return Drawn(builder, arguments, rng.uniform(0.003, 0.01))
    return Drawn("dam_break", {"dx": dx} | _flooded_obstacle(rng, dx))
