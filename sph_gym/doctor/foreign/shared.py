"""Shared parts of the adapters of published packages."""

import ctypes
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

from sph_gym.doctor.case import Array, Case

# Which setter takes values of which type; a bool is a number, too, and comes first.
_SETTERS: tuple[tuple[Any, str], ...] = (
    (bool, "setValueBool"),
    (int | float, "setValueFloat"),
    (list, "setVec3ValueReal"),
)


def require(package: str, newest: tuple[int, ...], why: str, library: str = "") -> None:
    """Raise ImportError for a package that is newer than it may be; load a library before it.

    newest: the first numbers of its version; why: later ones don't do; library: of the system, such
    as "libGL.so.1", for packages that bring a part of it and crash unless it is there already.
    Raises OSError if the system doesn't have it.
    """
    found = version(package)
    if tuple(map(int, found.split(".")[: len(newest)])) > newest:
        wanted = ".".join(map(str, newest))
        raise ImportError(f"{package}: expected version {wanted} at most, got {found}: {why}")
    if library:
        ctypes.CDLL(library)


def only_open_space(case: Case, why: str) -> None:
    """Raise NotImplementedError for a case with walls, which the doctor then leaves out."""
    if case.box is not None:
        raise NotImplementedError(why)


def in_space(vectors: Array) -> Array:
    """Return (n, 3) vectors with z = 0, for packages that know three dimensions only."""
    return np.pad(vectors, [(0, 0), (0, 1)])


def in_plane(values: Any) -> Array:
    """Return x and y of (n, 3) vectors, and (n,) numbers as they are; views where that can be."""
    array = np.asarray(values)
    return array[:, :2] if array.ndim == 2 else array


def configure(*settings: tuple[Any, Mapping[str, Any]]) -> None:
    """Set parameters of objects that have an id for each, and a setter for each type.

    settings: objects and their parameters, names of ids with bools, numbers or three components.
    """
    for owner, values in settings:
        for name, value in values.items():
            setter = next(setter for types, setter in _SETTERS if isinstance(value, types))
            getattr(owner, setter)(getattr(owner, name), value)


# A side without an end is drawn so many spacings farther than the fluid at the start.
BEYOND = 30


def boundary(case: Case, layers: int | None = None) -> Array:
    """Return (m, 2) positions [m] of particles in layers outside the sides of case.box.

    The first layer is half a spacing behind its side; layers: by default, as many as make them as
    thick as the support. Empty for open space.
    """
    if case.box is None:
        return np.empty((0, 2))
    low, high = np.array(case.box[::2]), np.array(case.box[1::2])
    start = np.where(np.isfinite(low), low, case.x.min(axis=0) - BEYOND * case.dx)
    end = np.where(np.isfinite(high), high, case.x.max(axis=0) + BEYOND * case.dx)
    n = np.maximum(np.rint((end - start) / case.dx), 1)
    # between two sides, the lattice is stretched to fit
    step = np.where(np.isfinite(high - low), (end - start) / n, case.dx)
    first = np.where(np.isfinite(high), end - n * step, start)
    deep = layers or np.ceil(case.h / case.dx)
    columns, rows = (first[k] + (np.arange(-deep, n[k] + deep) + 0.5) * step[k] for k in (0, 1))
    grid = np.stack(np.meshgrid(columns, rows, indexing="ij"), axis=-1).reshape(-1, 2)
    return grid[np.any((grid < low) | (grid > high), axis=1)]
