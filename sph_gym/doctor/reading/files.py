"""Open a recording: which kind of file it is, and what reads its frames."""

import json
import os
import re
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from zipfile import BadZipFile

import numpy as np

from sph_gym import trajectory
from sph_gym.doctor.reading.frames import Frame, Known, RecordedFrames, planar
from sph_gym.doctor.reading.legacy_vtk import read_legacy_vtk
from sph_gym.doctor.reading.names import TIME, frame_of, named, stacked
from sph_gym.doctor.reading.pysph import frame_of_pysph
from sph_gym.doctor.reading.tables import read_table
from sph_gym.extras import needs_extra
from sph_gym.solver.checks import known, path_of
from sph_gym.solver.scene import Scene

ARCHIVES = (".npz", ".h5", ".hdf5")
# How many names a message lists.
MOST_NAMES = 8


def open_recording(path: str | os.PathLike[str]) -> RecordedFrames:
    """Return the recording at a path, two-dimensional if one coordinate is the same for all.

    path: of a .npz or .h5 with arrays (frames, n[, 2]), as a `Recorder` writes them or others do;
    of a .pvd; of one file of a numbered series of .vtk, .vtu, .csv, or of PySPH's .hdf5 or .npz;
    or of a folder with one.

    Raises FileNotFoundError if there is nothing, ValueError for what isn't known, with the names
    that were found and those that were expected, and ImportError that names the extra to install.
    """
    target = path_of("recording", path)
    if not target.exists():
        raise FileNotFoundError(f"recording: there is no file or folder {str(target)!r}")
    first = series_in(target)[0] if target.is_dir() else target
    suffix = known("suffix of recording", first.suffix.lower(), (".pvd", *FRAME_SUFFIXES))
    if suffix == ".pvd":
        recording = _open_pvd(first)
    elif suffix in ARCHIVES:
        recording = _open_archive(first)
    else:
        recording = _series(first, _READERS[suffix], f"series of {suffix}")
    if len(recording) == 0:
        raise ValueError(f"{target}: expected at least one frame, got none")
    return planar(recording)


# --- one file a frame -----------------------------------------------------------------------


def _series(path: Path, read: Callable[[Path], Any], form: str) -> RecordedFrames:
    files = series_of(path)
    return RecordedFrames(str(path), form, [partial(_read_frame, file, read) for file in files])


def _read_frame(path: Path, read: Callable[[Path], Any], time: float = float("nan")) -> Frame:
    found = read(path)
    return found if isinstance(found, Frame) else frame_of(found, str(path), time)


def _read_vtu(path: Path) -> dict[str, Any]:
    with needs_extra("studies"):
        import meshio
    try:
        mesh = meshio.read(path)
    except (Exception, SystemExit) as error:
        # over a file that it can't read, meshio ends the program or fails in all sorts of ways
        raise ValueError(f"{path}: expected a VTK file that meshio reads: {error}") from None
    return {**mesh.field_data, **mesh.point_data, "Points": mesh.points}


_READERS = {".vtk": read_legacy_vtk, ".vtu": _read_vtu, ".csv": read_table}


def _open_pvd(path: Path) -> RecordedFrames:
    files, times = read_pvd(path)
    for file in files:
        known(f"{path}: suffix of {file.name}", file.suffix.lower(), _READERS)
        if not file.is_file():
            raise FileNotFoundError(f"{path}: there is no file {str(file)!r}")
    loads = [
        partial(_read_frame, file, _READERS[file.suffix.lower()], time)
        for file, time in zip(files, times, strict=True)
    ]
    text = path.with_suffix("") / "scene.json"
    scene = _scene(json.loads(text.read_text(encoding="utf-8"))) if text.is_file() else None
    return RecordedFrames(str(path), "ParaView's .pvd", loads, Known(scene))


def _scene(data: Any) -> Scene | None:
    """Return a scene of this project, None if another version wrote it."""
    try:
        return Scene.from_dict(data)
    except ValueError:
        return None


# --- one file for all frames ----------------------------------------------------------------


def _open_archive(path: Path) -> RecordedFrames:
    names = _names(path)
    if "parameters" in names and any(name.startswith("fields/") for name in names):
        return _open_trajectory(path)
    if any(name.split("/")[0] == "particles" for name in names):
        return _series(path, frame_of_pysph, "output of PySPH")
    arrays = _arrays(path)
    n_frames = stacked(arrays)
    if n_frames is None:
        return _series(path, _arrays, f"series of {path.suffix}")
    times = _times(arrays, n_frames)
    loads = [partial(_slice, arrays, k, n_frames, float(times[k]), str(path))
             for k in range(n_frames)]  # fmt: skip
    return RecordedFrames(str(path), f"arrays of {n_frames} frames", loads)


def _open_trajectory(path: Path) -> RecordedFrames:
    read = trajectory.read(path)
    kind = read.parameters.get("kind")
    loads = [partial(_of_trajectory, read, k, kind) for k in range(len(read.times))]
    scene = _scene(read.parameters.get("scene"))
    stiffness = read.controls[:, 1]
    known = Known(scene, stiffness if np.isfinite(stiffness).all() else None)
    return RecordedFrames(str(path), "recording of sph_gym", loads, known)


def _of_trajectory(read: trajectory.Trajectory, k: int, kind: Any) -> Frame:
    columns = {name: read.fields[name][k] for name in read.fields}
    if kind is not None and np.any(kind):
        columns["kind"] = kind
    return frame_of(columns, "recording", float(read.times[k]))


def _names(path: Path) -> list[str]:
    if path.suffix == ".npz":
        try:
            with path.open("rb") as opened, np.load(opened) as file:
                return list(file.files)
        except (BadZipFile, EOFError, AttributeError, ValueError) as error:
            raise ValueError(f"{path}: expected an archive of arrays: {error}") from None
    with needs_extra("studies"):
        import h5py
    names: list[str] = []
    with h5py.File(path, "r", swmr=True) as file:
        file.visit(names.append)
    return names


def _arrays(path: Path) -> dict[str, Any]:
    """Return all arrays of numbers of a file."""
    if path.suffix == ".npz":
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            try:
                return {name: file[name] for name in file.files}
            except ValueError as error:
                raise ValueError(f"{path}: expected arrays of numbers: {error}") from None
    with needs_extra("studies"):
        import h5py
    names = _names(path)
    with h5py.File(path, "r", swmr=True) as file:
        found = {name: file[name] for name in names}
        return {name: each[()] for name, each in found.items() if isinstance(each, h5py.Dataset)}


def _slice(arrays: dict[str, Any], k: int, n_frames: int, time: float, place: str) -> Frame:
    """Return frame k; arrays without frames, such as identities, are the same in all of them."""
    columns = {
        name: array[k] if np.ndim(array) >= 2 and len(array) == n_frames else array
        for name, array in arrays.items()
        if np.ndim(array) >= 1 and np.asarray(array).dtype.kind in "biuf"
    }
    return frame_of(columns, place, time)


def _times(arrays: dict[str, Any], n_frames: int) -> Any:
    """Return the time [s] of each frame, NaN where none is told."""
    columns = named(arrays)
    for name in TIME:
        if np.shape(columns.get(name, 0.0)) == (n_frames,):
            return np.asarray(columns[name], np.float64)
    return np.full(n_frames, np.nan)


# Suffixes of files that hold one frame.
FRAME_SUFFIXES = (".vtk", ".vtu", ".csv", ".npz", ".hdf5", ".h5")
_NUMBERED = re.compile(r"(.*?)(\d+)(\.[A-Za-z]\w*)")


def series_of(path: Path) -> list[Path]:
    """Return the files that differ from this one by their number only, in its order."""
    found = _NUMBERED.fullmatch(path.name)
    if found is None:
        return [path]
    return _groups(path.parent).get((found[1], found[3]), [path])


def series_in(folder: Path) -> list[Path]:
    """Return the numbered series in a folder, that of the fluid if there are several.

    A single .pvd is a series by itself. Raises ValueError if there is no series, and if it isn't
    clear which one is meant.
    """
    indices = sorted(folder.glob("*.pvd"))
    if len(indices) == 1:
        return indices
    groups = {key: files for key, files in _groups(folder).items() if len(files) > 1}
    if not groups:
        raise ValueError(
            f"{folder}: expected a .pvd or a numbered series of {', '.join(FRAME_SUFFIXES)}, got "
            f"{_some(sorted(each.name for each in folder.iterdir()))}"
        )
    fluid = [files for (stem, _), files in groups.items() if "fluid" in stem.lower()]
    chosen = fluid if len(fluid) == 1 else list(groups.values())
    if len(chosen) > 1:
        raise ValueError(
            f"{folder}: expected one numbered series, got {_some([f[0].name for f in chosen])}; "
            "name one of its files"
        )
    return chosen[0]


def read_pvd(path: Path) -> tuple[list[Path], list[float]]:
    """Return the files of a .pvd and their times [s].

    Raises ValueError if it is none, and for flows in several parts.
    """
    try:
        sets = [each.attrib for each in ElementTree.parse(path).iter("DataSet")]
    except ElementTree.ParseError as error:
        raise ValueError(f"{path}: expected ParaView's index of files: {error}") from None
    files = [path.parent / each.get("file", "") for each in sets]
    times = [float(each.get("timestep", "nan")) for each in sets]
    if not files:
        raise ValueError(f"{path}: expected DataSet entries, got none")
    if len(set(times)) < len(times):
        raise ValueError(f"{path}: expected one file for each time, got {len(files)} files")
    return files, times


def _groups(folder: Path) -> dict[tuple[str, str], list[Path]]:
    """Return numbered files by what stands before and after the number, sorted by it."""
    found: dict[tuple[str, str], dict[int, Path]] = defaultdict(dict)
    for each in folder.iterdir():
        name = _NUMBERED.fullmatch(each.name)
        if name is not None and name[3].lower() in FRAME_SUFFIXES:
            found[name[1], name[3]][int(name[2])] = each
    return {key: [files[n] for n in sorted(files)] for key, files in found.items()}


def _some(names: list[str]) -> str:
    rest = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return (", ".join(names[:MOST_NAMES]) or "nothing") + rest
