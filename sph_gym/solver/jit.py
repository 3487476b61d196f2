"""The one way in which this package compiles: `jit` for functions, `dispatch` for families."""

import hashlib
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

import numba
from numba.extending import overload

Function = TypeVar("Function", bound=Callable[..., Any])

# Everything in "fast" but nnan and ninf, which would delete the NaN tripwire (numba #2919, #8708).
FASTMATH = {"reassoc", "contract", "arcp", "afn", "nsz"}
OPTIONS: Any = {"error_model": "numpy", "nogil": True, "fastmath": FASTMATH}


def cache_home() -> Path:
    """Folder for everything that can be recomputed; `SPH_GYM_CACHE` overrides it."""
    if chosen := os.environ.get("SPH_GYM_CACHE"):
        return Path(chosen)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA", "~/AppData/Local")
    else:
        base = os.environ.get("XDG_CACHE_HOME", "~/.cache")
    return Path(base).expanduser() / "sph_gym"


@cache
def source_hash() -> str:
    """Hash of the solver's sources and of the compiler: the key of all that they produce."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def jit(function: Function) -> Function:
    """Compile `function` on first use, without the GIL, and cache the machine code on disk.

    Numba looks only at a function's own file to see whether its cache is stale, so an edited
    helper would go on running as it was (numba #1833). A folder named by the hash of all sources
    makes that impossible. Where no folder can be written, compilation works without a cache.
    """
    config: Any = numba.config
    if config.DISABLE_JIT:
        return function
    previous = config.CACHE_DIR
    config.CACHE_DIR = str(cache_home() / "jit" / source_hash())
    try:
        return numba.njit(cache=True, **OPTIONS)(function)
    except (OSError, RuntimeError):
        return numba.njit(**OPTIONS)(function)
    finally:
        config.CACHE_DIR = previous


class Family(Protocol):
    """A function whose implementation depends on the class of its first argument."""

    def __call__(self, first: Any, /, *rest: Any) -> Any:
        """Call the member for `type(first)`."""

    def member(self, kind: type) -> Callable[[Function], Function]:
        """Decorator that adds the implementation for one class."""


def dispatch(function: Callable[..., Any]) -> Family:
    """Make `function` a family whose member is chosen by the class of its first argument.

    The choice is made at compile time, so a family costs nothing in a loop. Members are added
    with `@family.member(SomeNamedTuple)` and take the same positional arguments.
    """
    members: dict[Any, Callable[..., Any]] = {}

    def family(first: Any, *rest: Any) -> Any:
        return members[type(first)](first, *rest)

    def choose(first: Any, *rest: Any) -> Callable[..., Any] | None:
        return members.get(getattr(first, "instance_class", None))

    def member(kind: type) -> Callable[[Function], Function]:
        def register(implementation: Function) -> Function:
            members[kind] = implementation
            return implementation

        return register

    family.__name__, family.__doc__ = function.__name__, function.__doc__
    family.member = member  # type: ignore[attr-defined]
    overload(family, strict=False, jit_options=OPTIONS)(choose)
    return cast(Family, family)
