"""Checks of arguments: every message names the argument, what it was and what was expected."""

import math
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

MOST_PARTICLES = 1e8
# Share by which a length may fall short of a multiple of dx: 3 * 0.1 is a little more than 0.3.
ROUNDING = 1e-9

Kind = TypeVar("Kind")


def shown(value: Any) -> str:
    """Return a value as a message shows it: a number of NumPy as the plain number."""
    return repr(value.item() if isinstance(value, np.generic) else value)


def instance_of(name: str, value: Any, kind: type[Kind]) -> Kind:
    """Return `value` if it is an instance of the class `kind`; else raise ValueError."""
    if not isinstance(value, kind):
        raise ValueError(f"{name}: expected a {kind.__name__}, got {shown(value)}")
    return value


def number(name: str, value: Any) -> float:
    """Return `value` as a finite float; else raise ValueError."""
    try:
        if isinstance(value, (bool, str, bytes)):
            raise TypeError
        result = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name}: expected a number, got {shown(value)}") from None
    if not math.isfinite(result):
        raise ValueError(f"{name}: expected a finite number, got {shown(value)}")
    return result


def positive(name: str, value: Any) -> float:
    """Return `value` as a finite float above zero; else raise ValueError."""
    result = number(name, value)
    if result <= 0:
        raise ValueError(f"{name}: expected a number above 0, got {shown(value)}")
    return result


def in_range(name: str, value: Any, low: float, high: float = math.inf) -> float:
    """Return `value` as a finite float in [low, high]; else raise ValueError."""
    result = number(name, value)
    if not low <= result <= high:
        bounds = f"at least {low:g}" if high == math.inf else f"in [{low:g}, {high:g}]"
        raise ValueError(f"{name}: expected a number {bounds}, got {shown(value)}")
    return result


def at_least_spacings(name: str, value: Any, n: float, dx: float) -> float:
    """Return a length [m] as a finite float of at least n dx; else raise ValueError.

    A length that falls short of that by no more than a rounding error is taken as it is.
    """
    result = positive(name, value)
    if not result >= n * dx * (1 - ROUNDING):
        least = f"{n:g} dx" if n != 1 else "dx"
        raise ValueError(
            f"{name}: expected at least {least} = {n * dx:g} m, got {result:g} m; a larger one, or "
            f"a dx of at most {result / n:.4g} m instead of {dx:g} m, would do"
        )
    return result


def finite_array(name: str, value: Any, shape: tuple[Any, ...]) -> NDArray[np.float64]:
    """Return `value` as a finite float64 array of `shape` (a letter stands for any length)."""
    wanted = f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"
    try:
        if np.iscomplexobj(value):
            raise TypeError
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(
            f"{name}: expected numbers of shape {wanted}, got {shown(value)}"
        ) from None
    fits = array.ndim == len(shape) and all(
        isinstance(want, str) or have == want for have, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        found = array.shape if array.ndim else shown(value)
        raise ValueError(f"{name}: expected shape {wanted}, got {found}")
    if not np.isfinite(array).all():
        bad = int(np.flatnonzero(~np.isfinite(array.reshape(len(array), -1)).all(axis=1))[0])
        raise ValueError(f"{name}: expected finite numbers, got {array[bad]} at index {bad}")
    return array


def whole(name: str, value: Any, at_least: int = 0) -> int:
    """Return `value` as an integer of at least `at_least`; else raise ValueError."""
    result = in_range(name, value, at_least)
    if result != int(result):
        raise ValueError(f"{name}: expected a whole number, got {shown(value)}")
    return int(result)


def path_of(name: str, value: Any) -> Path:
    """Return `value` as a path; else raise ValueError."""
    try:
        return Path(value)
    except TypeError:
        raise ValueError(f"{name}: expected a path, got {shown(value)}") from None


def countable(
    particles: float, name: str = "dx", remedy: str = "a larger dx or a smaller region"
) -> None:
    """Raise ValueError for a region that takes more particles than fit into memory.

    name: of the argument to blame; remedy: what makes fewer of them.
    """
    if not particles <= MOST_PARTICLES:
        raise ValueError(
            f"{name}: expected at most {MOST_PARTICLES:g} particles, got {particles:.3g}; "
            f"{remedy} makes fewer"
        )


def known(name: str, value: Any, choices: Iterable[str]) -> str:
    """Return `value` if it is one of `choices`; else raise ValueError that lists them."""
    choices = list(choices)
    if value not in choices:
        near = get_close_matches(str(value), choices, n=1)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        raise ValueError(f"{name}: expected one of {', '.join(choices)}, got {value!r}{hint}")
    return str(value)
