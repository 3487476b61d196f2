"""Scenes by name, one short file each: geometry, fluid, and the effects that it calls for."""

import inspect
from collections.abc import Callable
from typing import Any

from sph_gym.scenes.dam_break import dam_break
from sph_gym.scenes.drop_impact import drop_impact
from sph_gym.scenes.hydrostatic_tank import hydrostatic_tank
from sph_gym.scenes.relaxation import relaxation
from sph_gym.solver.checks import known
from sph_gym.solver.scene import Scene

_SCENES: dict[str, Callable[..., Scene]] = {
    scene.__name__: scene for scene in (dam_break, drop_impact, hydrostatic_tank, relaxation)
}


def names() -> list[str]:
    """The names that `make` knows."""
    return list(_SCENES)


def parameters(name: str) -> dict[str, Any]:
    """The arguments of a scene and their defaults."""
    arguments = inspect.signature(_builder(name)).parameters
    return {argument: spec.default for argument, spec in arguments.items()}


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


def _builder(name: str) -> Callable[..., Scene]:
    return _SCENES[known("name", name, _SCENES)]


__all__ = ["make", "names", "parameters"]
