"""Scenes by name, one short file each: geometry, fluid, and the effects that it calls for."""

import inspect
from importlib import import_module
from typing import Any

from sph_gym.scenes.reference import Reference
from sph_gym.solver.checks import known
from sph_gym.solver.scene import Scene

# Each is a module of this package, with a function of the same name that builds the scene.
_SCENES = (
    "dam_break",
    "drop_impact",
    "drop_sequence",
    "long_fall",
    "patch_impact",
    "shaken_tank",
    "hydrostatic_tank",
    "relaxation",
    "elliptical_drop",
    "oscillating_drop",
    "droplet",
    "perturbed_lattice",
    "rotating_square",
    "colliding_patches",
    "poiseuille",
    "couette",
    "lid_driven_cavity",
    "taylor_green",
    "standing_wave",
    "sloshing",
    "water_jet",
)


def names() -> list[str]:
    """The names that `make` knows."""
    return list(_SCENES)


def parameters(name: str) -> dict[str, Any]:
    """The arguments of a scene and their defaults."""
    arguments = inspect.signature(_builder(name)).parameters
    return {argument: spec.default for argument, spec in arguments.items()}


def description(name: str) -> tuple[str, str]:
    """What the scene called `name` shows in a sentence, and what its arguments mean.

    Raises ValueError for an unknown name.
    """
    return inspect.getdoc(_module(name)) or "", inspect.getdoc(_builder(name)) or ""


def make(name: str, **arguments: Any) -> Scene:
    """The scene called `name`; geometry arguments are in metres, every scene takes dx.

    Raises ValueError for a name or an argument that doesn't exist (and lists those that do), and
    for a value that makes no scene.
    """
    builder = _builder(name)
    taken = parameters(name)
    for argument in arguments:
        if argument not in taken:
            raise ValueError(
                f"{name}: unknown argument {argument!r}, expected one of {', '.join(taken)}"
            )
    return builder(**arguments)


def reference(name: str) -> Reference | None:
    """What the scene called `name` is compared with; None if nothing is known of its flow.

    Raises ValueError for an unknown name.
    """
    return getattr(_module(name), "REFERENCE", None)


def _module(name: str) -> Any:
    return import_module(f"sph_gym.scenes.{known('name', name, _SCENES)}")


def _builder(name: str) -> Any:
    return getattr(_module(name), name)


__all__ = ["description", "make", "names", "parameters", "reference"]
