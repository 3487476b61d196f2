"""Instructions of a step that is compiled with the code of absent effects replaced by identity.

Every count is taken in a process of its own, in which nothing has been compiled before:
`python -m sph_gym.studies.absence` reads a `Build` as JSON and prints its `Count`.
"""

import inspect
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

from numba.core import types
from numba.extending import overload

import sph_gym
from sph_gym import Simulation, scenes
from sph_gym.solver import effects, jit, stepping
from sph_gym.solver.registry import EFFECTS
from sph_gym.studies import assembly, variants
from sph_gym.studies.assembly import Count

# Functions outside of effects.py that return what they are given, or a constant, without their
# part of the scene.
ELSEWHERE: dict[str, tuple[str, ...]] = {
    "surface_tension": ("store_normals",),
    "continuity": ("add_offset", "grow"),
    "gravity": ("add_gravity",),
    "box": ("confine",),
    "plates": ("stop_at_plates",),
    "periodicity": ("nearest_image", "wrap"),
    "motion": ("move_walls",),
}


def terms(effect: str) -> tuple[str, ...]:
    """Return the names of the terms in the section of an effect in effects.py."""
    begins = sorted(inspect.getsourcelines(each.strength)[1] for each in EFFECTS)
    own = [inspect.getsourcelines(each.strength)[1] for each in EFFECTS if each.name == effect]
    functions = [f for f in vars(effects).values() if isinstance(f, FunctionType)]
    lines = {f.__name__: inspect.getsourcelines(f)[1] for f in functions}
    return tuple(
        name
        for name, line in lines.items()
        if name.startswith("add_") and own and own == [b for b in begins if b < line][-1:]
    )


TERMS: dict[str, tuple[str, ...]] = {
    name: (*terms(name), *ELSEWHERE.get(name, ()))
    for name in dict.fromkeys((*(each.name for each in EFFECTS), *ELSEWHERE))
}
# Instead of one effect: every function that begins with `if argument is None`, where it is None.
EVERY = "every absent part"


class Build(NamedTuple):
    """A scene with a spacing [m], an effect that is left out of it, and parts that are replaced.

    left_out: of `variants.EFFECTS`; identity: of TERMS, and EVERY; both may be empty.
    """

    scene: str
    dx: float
    left_out: str = ""
    identity: tuple[str, ...] = ()


@cache
def count(build: Build) -> Count | None:
    """Compile a step in a new process; None, with a message, where there is no listing to read.

    Raises OSError with what the process said if it failed.
    """
    home = str(Path(sph_gym.__file__).parents[1])
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-m", "sph_gym.studies.absence"],
            cwd=home,
            env=os.environ | {"PYTHONPATH": home, "SPH_GYM_CACHE": folder},
            input=json.dumps(build),
            capture_output=True,
            text=True,
        )
    if done.returncode != 0:
        said = (done.stderr.strip() or "nothing").splitlines()[-1]
        raise OSError(f"{build}: the process that compiles it ended early and said: {said}")
    found = json.loads(done.stdout.splitlines()[-1])
    if isinstance(found, str):
        print(f"no instructions counted: {found}", file=sys.stderr)
        return None
    return Count(*found)


def compile_and_count(build: Build) -> Count:
    """Compile a step of the build in this process, whose solver it changes for good."""
    for part in build.identity:
        replace_absent() if part == EVERY else replace_terms(part)
    scene = scenes.make(build.scene, dx=build.dx)
    if build.left_out:
        scene = variants.left_out(scene, build.left_out)
    sim = Simulation(scene, threads=1)
    sim.advance(sim.controls.dt)
    return assembly.count(stepping.advance)


# --- Replacing ------------------------------------------------------------------------------


def replace_terms(effect: str) -> None:
    """Let the terms of an effect return what they return without it, whatever they are given."""
    known = {function.__name__: function for function in solver_functions()}
    for name in TERMS[effect]:
        if name not in known:
            raise ValueError(f"TERMS: expected functions of the solver for {effect}, got {name}")
        first = next(iter(inspect.signature(known[name]).parameters))
        _rebind(known[name], jit.jitable(identity(known[name], first)))


def replace_absent() -> None:
    """Let every function of the solver return as if it had no body where its part is absent."""
    for function in solver_functions():
        identities = guards(function)
        if identities:
            _rebind(function, _where_absent(function, identities))


def guards(function: FunctionType) -> dict[int, Callable[..., Any]]:
    """Return identities of a function by the places of arguments without which it is one."""
    parameters = list(inspect.signature(function).parameters)
    found: dict[int, Callable[..., Any]] = {}
    for name in re.findall(r"^    if (\w+) is None", inspect.getsource(function), re.MULTILINE):
        # some do something else instead, and some need more than to be given anything
        if name in parameters:
            try:
                found[parameters.index(name)] = identity(function, name)
            except (AttributeError, KeyError, TypeError, ValueError):
                continue
    return found


class _Given:
    """Stand-in for an argument, or for a field of one: `text` says which."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __getattr__(self, name: str) -> "_Given":
        if name.startswith("_"):
            raise AttributeError(name)
        return _Given(f"{self.text}.{name}")


def identity(function: FunctionType, absent: str) -> Callable[..., Any]:
    """Return a function that only returns what `function` does when an argument is None.

    Raises ValueError if that is neither another argument, nor a field of one, nor a constant.
    """
    parameters = list(inspect.signature(function).parameters)
    given = {name: None if name == absent else _Given(name) for name in parameters}

    def expression(result: Any) -> str:
        if isinstance(result, tuple):
            return "".join(["(", *(f"{expression(part)}, " for part in result), ")"])
        if isinstance(result, _Given):
            return result.text
        if result is None or isinstance(result, (bool, int, float)):
            return repr(result)
        raise ValueError(f"{function.__name__}: expected an argument or a constant, got {result!r}")

    text = f"def {function.__name__}({', '.join(parameters)}):\n    return "
    found: dict[str, Any] = {}
    exec(text + expression(function(*given.values())), found)
    return found[function.__name__]


def solver_functions() -> list[FunctionType]:
    """Return the functions of all modules of the solver."""
    return [
        value
        for module in _solver_modules()
        for value in vars(module).values()
        if isinstance(value, FunctionType) and value.__module__ == module.__name__
    ]


def _solver_modules() -> list[Any]:
    return [module for name, module in sys.modules.items() if name.startswith("sph_gym.solver.")]


def _rebind(old: Any, new: Any) -> None:
    for module in _solver_modules():
        for name in [name for name, value in vars(module).items() if value is old]:
            setattr(module, name, new)


def _where_absent(function: Any, identities: dict[int, Callable[..., Any]]) -> Callable[..., Any]:
    def either(*arguments: Any) -> Any:
        return function(*arguments)

    def choose(*arguments: Any) -> Any:
        for place, replacement in identities.items():
            if isinstance(arguments[place], types.NoneType):
                return replacement
        return function

    overload(either, strict=False, jit_options=jit.OPTIONS)(choose)
    return either


def main() -> None:
    """Print the count as JSON, or why there is none."""
    build = Build(*json.load(sys.stdin))
    try:
        print(json.dumps(compile_and_count(build)))
    except AttributeError as error:
        print(json.dumps(str(error)))


if __name__ == "__main__":
    main()
