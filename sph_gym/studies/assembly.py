"""Count the machine instructions of a compiled function, and of its hottest loop.

The function and the helpers that it calls count, but not the wrappers that numba puts around it.
numba lists only code that it has just compiled, none from its cache.
"""

import re
from typing import Any, NamedTuple

_FUNCTION = re.compile(r"\s*\.type\s+(\S+?),\s*[@%]function")
_LABEL = re.compile(r"(\.?L\w+):")
_INSTRUCTION = re.compile(r"\s+([a-z]\w*)")
_BRANCH = re.compile(r"(?:j|b|cb|tb)\w*(?:\.\w+)?\s.*?(\.?L\w+)\s*$")
_WRAPPERS = ("cpython", "cfunc")


class Count(NamedTuple):
    """Instructions of the whole function, and of the innermost loop over pairs."""

    whole: int
    loop: int


def count(function: Any) -> Count:
    """Count the instructions of a function compiled by `jit`.

    Raises ValueError if nothing was compiled or the listing can't be read.
    """
    listings = list(function.inspect_asm().values())
    if not listings:
        raise ValueError(f"{function.__name__}: nothing has been compiled")
    return count_in(listings[-1])


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
    """Return every innermost loop that takes a root and a reciprocal, as forces do."""
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
    return [body for body, said in named if "sqrt" in said and ("rcp" in said or "div" in said)]
