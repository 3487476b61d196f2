"""Scenes by name: every module of this package is one, and builds it by a function of that name.

Beside its builder, a module may hold `REFERENCE` (what its flow is compared with), `REFINEMENT`
(how the study of accuracy resolves it) and `FAMILY` (the flows of its environment); what several
scenes share, and these types, are in `sph_gym.scenes.shared`.
"""

from __future__ import annotations

import inspect
import re
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

from sph_gym.solver.checks import known

# a list of names needs no solver, which takes most of a second to import
if TYPE_CHECKING:
    from sph_gym.scenes.shared.family import FlowFamily
    from sph_gym.scenes.shared.reference import Reference
    from sph_gym.solver.scene import Scene

# The order of the scenes that were there first, in which `sph_gym/Mixed-v1` numbers its
# environments. A new scene needs no entry: it follows these, by its name.
_FIRST = (
    "dam_break", "drop_impact", "drop_sequence", "long_fall", "patch_impact", "shaken_tank",
    "hydrostatic_tank", "relaxation", "elliptical_drop", "oscillating_drop", "droplet",
    "perturbed_lattice", "rotating_square", "colliding_patches", "poiseuille", "couette",
    "lid_driven_cavity", "taylor_green", "standing_wave", "sloshing", "water_jet",
)  # fmt: skip


def names() -> list[str]:
    """Return the names that `make` knows."""
    return list(_found())


@cache
def _found() -> tuple[str, ...]:
    there = sorted(module.name for module in iter_modules(__path__) if not module.ispkg)
    first = tuple(name for name in _FIRST if name in there)
    return first + tuple(name for name in there if name not in first)


def with_family() -> tuple[str, ...]:
    """Return the names of the scenes that are environments, without importing them."""
    files = {name: Path(__file__).with_name(f"{name}.py") for name in _found()}
    return tuple(
        name
        for name, file in files.items()
        if re.search(r"^FAMILY\b", file.read_text(encoding="utf-8"), re.MULTILINE)
    )


def parameters(name: str) -> dict[str, Any]:
    """Return the arguments of a scene and their defaults. Raises ValueError for an unknown name."""
    arguments = inspect.signature(_builder(name)).parameters
    return {argument: spec.default for argument, spec in arguments.items()}


def description(name: str) -> tuple[str, str]:
    """Return what a scene shows in a sentence, and what its arguments mean.

    Raises ValueError for an unknown name.
    """
    return inspect.getdoc(_module(name)) or "", inspect.getdoc(_builder(name)) or ""


def make(name: str, **arguments: Any) -> Scene:
    """Return the scene called `name`; geometry arguments are in metres, every scene takes dx.

    Raises ValueError for a name or an argument that doesn't exist (and lists those that do), and
    for a value that makes no scene.
    """
    builder = _builder(name)
    taken = parameters(name)
    for argument in arguments:
        known(f"argument of {name}", argument, taken)
    return builder(**arguments)


def reference(name: str) -> Reference | None:
    """Return what a scene is compared with, None if nothing is known of its flow.

    Raises ValueError for an unknown name.
    """
    return getattr(_module(name), "REFERENCE", None)


def refinement(name: str) -> Any:
    """Return the `Refinement` of a scene, None if the study of accuracy leaves it out.

    Raises ValueError for an unknown name.
    """
    return getattr(_module(name), "REFINEMENT", None)


def family(name: str) -> FlowFamily | None:
    """Return the family of flows of a scene's environment, None if it has no environment.

    Raises ValueError for an unknown name.
    """
    return getattr(_module(name), "FAMILY", None)


def _module(name: str) -> Any:
    return import_module(f"sph_gym.scenes.{known('name', name, _found())}")


def _builder(name: str) -> Any:
    return getattr(_module(name), name)


__all__ = [
    "description", "family", "make", "names", "parameters", "reference", "refinement",
    "with_family",
]  # fmt: skip
