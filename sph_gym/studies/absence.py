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
from sph_gym.studies import variants

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


def _terms() -> dict[str, tuple[str, ...]]:
    """Return functions by effect: those that add something in its section of effects.py, and more.

    A section begins with the strength of its effect.
    """
    sections = {inspect.getsourcelines(each.strength)[1]: each.name for each in EFFECTS}
    found = {name: list[str]() for name in (*sections.values(), *ELSEWHERE)}
    for name, function in vars(effects).items():
        if name.startswith("add_") and isinstance(function, FunctionType):
            line = inspect.getsourcelines(function)[1]
            above = [begin for begin in sections if begin < line]
            if above:
                found[sections[max(above)]].append(name)
    return {effect: (*names, *ELSEWHERE.get(effect, ())) for effect, names in found.items()}


TERMS = _terms()
# Instead of one effect: every function that begins with `if argument is None`, where it is None.
EVERY = "every absent part"


class Count(NamedTuple):
    """Instructions of the whole function, and of the innermost loop over pairs."""

    whole: int
    loop: int


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
    # numba lists only code that it has just compiled, none from its cache
    step: Any = stepping.advance
    listings = list(step.inspect_asm().values())
    if not listings:
        raise ValueError("stepping.advance: nothing has been compiled")
    return count_in(listings[-1])


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


# --- Counting -------------------------------------------------------------------------------

_FUNCTION = re.compile(r"\s*\.type\s+(\S+?),\s*[@%]function")
_LABEL = re.compile(r"(\.?L\w+):")
_INSTRUCTION = re.compile(r"\s+([a-z]\w*)")
_BRANCH = re.compile(r"(?:j|b|cb|tb)\w*(?:\.\w+)?\s.*?(\.?L\w+)\s*$")
_WRAPPERS = ("cpython", "cfunc")


def count_in(listing: str) -> Count:
    """Count the instructions in a listing; ValueError if it can't be read, as without ELF."""
    bodies = functions(listing)
    reached = reachable(bodies)
    whole = sum(len(instructions(bodies[name])) for name in reached)
    loops = [loop for name in reached for loop in pair_loops(bodies[name])]
    if not loops:
        raise ValueError("no loop over pairs was found in the listing")
    return Count(whole, max(map(len, loops)))


def functions(listing: str) -> dict[str, list[str]]:
    """Return the lines of every function in the listing but of numba's wrappers."""
    bodies: dict[str, list[str]] = {}
    name = ""
    for line in listing.splitlines():
        if found := _FUNCTION.match(line):
            name = found[1]
            bodies[name] = []
        elif line.lstrip().startswith(".size"):
            name = ""
        elif name:
            bodies[name].append(line)
    if not bodies:
        raise ValueError("no functions are marked in the listing of this system")
    return {k: v for k, v in bodies.items() if not any(w in k[:16] for w in _WRAPPERS)}


def reachable(bodies: dict[str, list[str]]) -> list[str]:
    """Return the names of the first function and of all that it mentions, at any depth."""
    reached = list(bodies)[:1]
    for name in reached:
        symbols = set(re.findall(r"[\w.]+", "\n".join(instructions(bodies[name]))))
        reached += [other for other in bodies if other in symbols and other not in reached]
    return reached


def instructions(lines: list[str]) -> list[str]:
    """Return the lines that are neither labels nor directives nor comments."""
    return [line.strip() for line in lines if _INSTRUCTION.match(line)]


def pair_loops(lines: list[str]) -> list[list[str]]:
    """Return every innermost loop that takes a reciprocal root, in one command or two."""
    places = {found[1]: k for k, line in enumerate(lines) if (found := _LABEL.match(line))}
    spans = []
    for k, line in enumerate(lines):
        found = _BRANCH.match(line.strip())
        if found and places.get(found[1], k) < k:
            spans.append((places[found[1]], k))
    inner = [s for s in spans if not any(s != t and s[0] <= t[0] and t[1] <= s[1] for t in spans)]
    bodies = [instructions(lines[first : last + 1]) for first, last in inner]
    commands = [" ".join(line.split()[0] for line in body) for body in bodies]
    named = zip(bodies, commands, strict=True)
    return [body for body, said in named if _takes_reciprocal_root(said)]


def _takes_reciprocal_root(commands: str) -> bool:
    # without viscosity, a pair's direction needs 1 / r alone
    return "rsqrt" in commands or ("sqrt" in commands and ("rcp" in commands or "div" in commands))


def main() -> None:
    """Print the count as JSON, or why there is none."""
    build = Build(*json.load(sys.stdin))
    try:
        print(json.dumps(compile_and_count(build)))
    except AttributeError as error:
        print(json.dumps(str(error)))


if __name__ == "__main__":
    main()
