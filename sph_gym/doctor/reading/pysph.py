"""Read the output of PySPH: one .hdf5 or .npz a frame, with an array of particles a material."""

import pickle
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.doctor.reading.frames import Frame
from sph_gym.doctor.reading.names import frame_of

COLUMNS = ("x", "y", "z", "u", "v", "w", "rho", "p", "gid")
FLUID = ("fluid", "water", "liquid")
# gid of all particles that nothing has numbered.
NO_ID = 2**32 - 1
# All that a pickled array of numbers, texts and dictionaries is made of.
_HARMLESS = {
    ("numpy", "ndarray"),
    ("numpy", "dtype"),
    ("_codecs", "encode"),
    *((f"numpy.{core}.multiarray", name) for core in ("core", "_core")
      for name in ("_reconstruct", "scalar")),
    *((f"numpy.{core}.numeric", "_frombuffer") for core in ("core", "_core")),
}  # fmt: skip


def frame_of_pysph(path: Path) -> Frame:
    """Return the particles of all materials; those that are no fluid are walls.

    Raises ValueError for other contents.
    """
    read = _read_npz if path.suffix == ".npz" else _read_hdf5
    materials, time = read(path)
    if not materials:
        raise ValueError(f"{path}: expected arrays of particles, got none")
    named_fluid = [name for name in materials if any(word in name.lower() for word in FLUID)]
    frames = [
        (frame_of(_columns(arrays), f"{path}, particles {name}", time), name)
        for name, arrays in materials.items()
    ]
    return _joined([(frame, bool(named_fluid) and name not in named_fluid)
                    for frame, name in frames if len(frame.x)])  # fmt: skip


def _columns(arrays: Mapping[str, Any]) -> dict[str, Any]:
    found = {name: arrays[name] for name in COLUMNS if np.size(arrays.get(name, ())) > 0}
    if "gid" in found and (np.asarray(found["gid"]) == NO_ID).any():
        del found["gid"]
    return found


def _joined(parts: list[tuple[Frame, bool]]) -> Frame:
    """Return one frame of several; ids are those of one material and don't tell it from others."""
    if not parts:
        raise ValueError("expected particles, got none")
    frames = [frame for frame, _ in parts]
    walls = np.concatenate([np.full(len(frame.x), wall) for frame, wall in parts])
    columns: dict[str, Any] = {}
    for name in ("x", "v", "rho", "p"):
        some = [getattr(frame, name) for frame in frames]
        if all(column is not None for column in some):
            columns[name] = np.concatenate(some)
    ids = frames[0].ids if len(frames) == 1 else None
    wall = walls if walls.any() else None
    return Frame(**columns, ids=ids, wall=wall, time=frames[0].time)


def _read_hdf5(path: Path) -> tuple[dict[str, dict[str, Any]], float]:
    import h5py

    with h5py.File(path, "r") as file:
        materials = {
            name: {key: array[()] for key, array in group["arrays"].items() if key in COLUMNS}
            for name, group in file["particles"].items()
        }
        time = file["solver_data"].attrs.get("t", np.nan) if "solver_data" in file else np.nan
    return materials, float(time)


def _read_npz(path: Path) -> tuple[dict[str, dict[str, Any]], float]:
    particles, solver = _plain(path, "particles"), _plain(path, "solver_data")
    return {name: info["arrays"] for name, info in particles.items()}, float(
        solver.get("t", np.nan)
    )


def _plain(path: Path, name: str) -> dict[str, Any]:
    """Return a dictionary that numpy has pickled, without running anything that the file names."""
    with zipfile.ZipFile(path) as archive, archive.open(f"{name}.npy") as file:
        version = np.lib.format.read_magic(file)
        read = {(1, 0): np.lib.format.read_array_header_1_0,
                (2, 0): np.lib.format.read_array_header_2_0}  # fmt: skip
        if version not in read:
            raise ValueError(f"{path}: array {name} has the unknown form {version}")
        read[version](file)
        try:
            found = _Unpickler(file, encoding="latin1").load()
        except (pickle.UnpicklingError, EOFError, TypeError, AttributeError) as error:
            raise ValueError(f"{path}: expected PySPH's {name}: {error}") from None
    value = found.item() if isinstance(found, np.ndarray) else found
    if not isinstance(value, dict):
        raise ValueError(f"{path}: expected PySPH's {name}, got a {type(value).__name__}")
    return value


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in _HARMLESS:
            raise pickle.UnpicklingError(f"it holds {module}.{name}, which is no number")
        return super().find_class(module, name)
