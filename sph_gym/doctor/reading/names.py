"""Find positions, velocities, densities and pressures among the arrays of a file by their names."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from sph_gym.doctor.reading.frames import Array, Frame

NamedArrays = Mapping[str, Any]

# Names as `tidy` leaves them: small letters and digits, without units. DualSPHysics writes Pos.x,
# Vel, Rhop, Press, Idp and Type; PySPH x, y, z, u, v, w, rho, p, gid; ParaView Points:0 in tables.
POSITION = ("x", "pos", "position", "positions", "points", "coordinates", "coords", "r")
VELOCITY = ("v", "vel", "velocity", "velocities", "u")
DENSITY = ("rho", "rhop", "density", "densities", "dens")
PRESSURE = ("p", "press", "pres", "pressure", "pressures")
IDENTITY = ("idp", "id", "ids", "gid", "particleid", "particleids")
TIME = ("t", "time", "times", "timestep", "timevalue")
# Beginnings of the names of their components.
POSITIONS = ("", "pos", "position", "points", "coordinates")
VELOCITIES = ("v", "vel", "velocity")
# Types of DualSPHysics below it are fixed, moving and floating boundaries.
FLUID_TYPE = 3
EXPECTED = (
    "positions x (n, 2) or x and y (n,), and if there are any velocities v or u and v, densities "
    "rho, pressures p, identities id; or such names as Pos, Points, Vel, Velocity, Rhop, Density, "
    "Press, Pressure, Idp"
)


def tidy(name: str) -> str:
    """Return a name without units, folders and signs, in small letters: "Pos.x [m]" is "posx"."""
    return re.sub(r"[^a-z0-9]", "", name.split("[")[0].rsplit("/", 1)[-1].lower())


def named(arrays: NamedArrays) -> dict[str, Any]:
    """Return arrays by their tidy names; the first of those that share one."""
    found: dict[str, Any] = {}
    for name, array in arrays.items():
        found.setdefault(tidy(name), array)
    return found


def frame_of(arrays: NamedArrays, place: str, time: float = float("nan")) -> Frame:
    """Return the frame that is in arrays with one row a particle.

    place: of the arrays, for messages. Raises ValueError, with the names that are there, if there
    are no positions, and for columns of other lengths.
    """
    columns = named(arrays)
    x = vector(columns, POSITION, POSITIONS)
    if x is None:
        raise ValueError(unknown(place, arrays))
    ids = _first(columns, IDENTITY, 1)
    frame = Frame(
        x,
        vector(columns, VELOCITY, VELOCITIES),
        _scalar(columns, DENSITY),
        _scalar(columns, PRESSURE),
        None if ids is None else np.asarray(ids, np.float64).astype(np.int64),
        _walls(columns),
        _time(columns) if np.isnan(time) else time,
    )
    for name, column in frame.columns.items():
        if column is not None and len(column) != len(x):
            raise ValueError(
                f"{place}: expected {name} of {len(x)} particles, as positions are, got "
                f"{len(column)}"
            )
    return frame


def unknown(place: str, arrays: NamedArrays) -> str:
    """Return the message for a file in which no positions were found."""
    shapes = [f"{name} {np.shape(array)}" for name, array in sorted(arrays.items())]
    return f"{place}: expected {EXPECTED}; got {', '.join(shapes) or 'no arrays at all'}"


def stacked(arrays: NamedArrays) -> int | None:
    """Return how many frames are in arrays (frames, n[, d]); None if rows are particles of one."""
    columns = named(arrays)
    for name in POSITION:
        if name in columns and np.ndim(columns[name]) == 3:
            return len(columns[name])
    for names in _components(POSITIONS):
        parts = [columns[name] for name in names if name in columns]
        if len(parts) >= 2 and {np.ndim(part) for part in parts} == {2}:
            return len(parts[0])
    return None


def _components(stems: tuple[str, ...]) -> list[tuple[str, ...]]:
    return [tuple(stem + axis for axis in axes) for stem in stems for axes in ("xyz", "012")]


def vector(columns: NamedArrays, whole: tuple[str, ...], stems: tuple[str, ...]) -> Array | None:
    """Return a column of vectors (n, d), stored as one array or as one a direction.

    whole: names of the one array; stems: beginnings of the names of the others. In PySPH's files
    v is a component, so components come first.
    """
    trios = _components(stems)
    if whole is VELOCITY:
        trios.insert(0, ("u", "v", "w"))
    for names in trios:
        parts = [columns[name] for name in names if name in columns]
        alike = {np.shape(part) for part in parts}
        if names[0] in columns and len(parts) >= 2 and len(alike) == 1 and np.ndim(parts[0]) == 1:
            return np.stack([np.asarray(part, np.float64) for part in parts], axis=1)
    found = _first(columns, whole, 2)
    if found is None or np.shape(found)[1] not in (2, 3):
        return None
    return np.array(found, np.float64)


def _first(columns: NamedArrays, names: tuple[str, ...], dimensions: int) -> Any:
    """Return the first of these arrays that has so many dimensions, and numbers in it."""
    for name in names:
        if name in columns:
            array = np.asarray(columns[name])
            if dimensions == 1 and array.ndim == 2 and array.shape[1] == 1:
                array = array[:, 0]
            if array.ndim == dimensions and array.dtype.kind in "biuf":
                return array
    return None


def _scalar(columns: NamedArrays, names: tuple[str, ...]) -> Array | None:
    found = _first(columns, names, 1)
    return None if found is None else np.array(found, np.float64)


def _walls(columns: NamedArrays) -> Any:
    """Return (n,) which particles are walls: by this project's `kind`, or DualSPHysics' `Type`."""
    kind = _first(columns, ("kind",), 1)
    if kind is not None:
        return np.asarray(kind) != 0
    kind = _first(columns, ("type",), 1)
    if kind is not None and "rhop" in columns and (np.asarray(kind) == FLUID_TYPE).any():
        return np.asarray(kind) < FLUID_TYPE
    return None


def _time(columns: NamedArrays) -> float:
    """Return the time [s] where it is stored as a single number, else NaN."""
    for name in TIME:
        if name in columns and np.size(columns[name]) == 1:
            return float(np.asarray(columns[name]).reshape(-1)[0])
    return float("nan")
