"""Record the frames of a run as compressed NumPy, as HDF5, or as VTK that ParaView opens.

`read` reads all of them back. .npz, .h5, .hdf5: one file with the same names in all of them:

- times (n_frames,) [s]; controls (n_frames, 3): dt [s], stiffness [Pa], xsph
- fields/NAME (n_frames, n_particles[, 2]), fluid first, in the precision of the simulation
- gauges/NAME (n_frames, 1 or 2) the values of each gauge
- parameters: JSON text. Dataclasses are objects with their "class"; {"array": NAME} stands for
  the array NAME of the file; infinity is `Infinity`, as Python's json has it.
  `Scene.from_dict(read(PATH).parameters["scene"])` is the scene, to run it again.

.pvd: ParaView's index of times; the frames are beside it in a folder of its name, one .vtu each,
with vertex cells, vectors of three (z = 0) and everything but `kind` in float64. The folder's
parameters.json is the text above, its scene.json one for `Scene.from_dict`, its gauges.csv holds
the values of gauges over time. Only the index tells which frames belong to the run.
"""

import csv
import json
import os
import platform
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr
from zipfile import BadZipFile

import numba
import numpy as np
from numpy.typing import NDArray

from sph_gym.extras import needs_extra
from sph_gym.files import atomic_write, target_path, write_text
from sph_gym.provenance import VERSION
from sph_gym.solver.checks import instance_of, known, path_of
from sph_gym.solver.gauges import Gauge
from sph_gym.solver.plain import to_plain
from sph_gym.solver.simulation import Simulation

# Recorded fields, and their names in VTK.
FIELDS = {"x": "position", "v": "velocity", "rho": "density", "p": "pressure"}
TITLES = list(FIELDS.values())
INDEX = """<?xml version="1.0"?>
<VTKFile type="Collection" version="0.1">
<Collection>
{}</Collection>
</VTKFile>
"""

Arrays = dict[str, Any]
Append = Callable[[Arrays], None]


class Trajectory(NamedTuple):
    """A recording: arrays as at the top of this module, and the parameters with theirs in place.

    `parameters["kind"]` (n_particles,) is 0 for fluid and 1 for walls. gauges: by name.
    """

    times: NDArray[np.float64]
    controls: NDArray[np.float64]
    fields: dict[str, NDArray[Any]]
    parameters: dict[str, Any]
    gauges: dict[str, NDArray[np.float64]]


class Recorder:
    """Appends the present state of a simulation to a file at every `record`.

    The suffix of `path` chooses the format. Nothing is written before the first frame, then what
    was there is replaced. HDF5 and VTK are complete after every frame: a crash costs the one in
    hand. A .npz is held in memory and appears when the recorder closes, also after an exception or
    Ctrl-C. HDF5 can be read while it is written; if the process is killed, other programs than
    `read` may ask for `h5clear -s` first.

    gauges: are read at every `record`; no two of one name.

    Raises ValueError for unknown suffixes and equal names, FileNotFoundError if there is no such
    directory, FileExistsError if a file is where the folder of a .pvd should be, ImportError that
    names the extra to install.
    """

    def __init__(
        self, path: str | os.PathLike[str], sim: Simulation, gauges: Sequence[Gauge] = ()
    ) -> None:
        instance_of("sim", sim, Simulation)
        self._gauges = {instance_of("gauges", gauge, Gauge).name: gauge for gauge in gauges}
        if len(self._gauges) < len(gauges):
            names = ", ".join(gauge.name for gauge in gauges)
            raise ValueError(f"gauges: expected different names, got {names}")
        target, self._sim, self._closed = recording_target(path), sim, False
        self._file, writer = ExitStack(), _WRITERS[target.suffix.lower()]
        self._append = self._file.enter_context(writer(target, _constants(sim)))

    def record(self) -> None:
        """Append time, controls and fields as they are now; ValueError once it is closed."""
        if self._closed:
            raise ValueError("record: expected an open recorder, this one is closed")
        frame: Arrays = {f"fields/{name}": getattr(self._sim, name) for name in FIELDS}
        for name, gauge in self._gauges.items():
            frame[f"gauges/{name}"] = gauge.read(self._sim)
        frame["controls"] = np.array(self._sim.controls)
        frame["times"] = np.float64(self._sim.time)
        self._append(frame)

    def close(self) -> None:
        """Finish the file; a second time does nothing."""
        self._closed = True
        self._file.close()

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def recording_target(path: str | os.PathLike[str], name: str = "path") -> Path:
    """Return the path of a recording, or raise what `Recorder` raises; name: for messages."""
    target = target_path(name, path_of(name, path), _WRITERS)
    folder = target.with_suffix("")
    if target.suffix.lower() == ".pvd" and folder.exists() and not folder.is_dir():
        raise FileExistsError(
            f"{name}: expected a folder or nothing at {str(folder)!r}, where the frames are to "
            "go, got a file"
        )
    return target


def read(path: str | os.PathLike[str]) -> Trajectory:
    """Return what a `Recorder` wrote, up to the last complete frame.

    A .pvd has no controls, so they are NaN. Raises ValueError for other suffixes and contents,
    OSError if the file can't be opened, ImportError that names the extra to install.
    """
    path = path_of("path", path)
    suffix = known("path", path.suffix.lower(), _READERS)
    if not path.exists():
        raise FileNotFoundError(f"path: there is no file {str(path)!r}")
    stored = _READERS[suffix](path)
    try:
        parameters = _parameters(stored)
        times, controls = stored["times"], stored["controls"]
    except KeyError as error:
        raise ValueError(f"path: expected a recording, {str(path)!r} has no {error}") from None
    fields, gauges = _below("fields/", stored), _below("gauges/", stored)
    # an interrupted write may have come to some of the columns only
    n_frames = min(map(len, (times, controls, *fields.values(), *gauges.values())))
    fields, gauges = (
        {name: column[:n_frames] for name, column in part.items()} for part in (fields, gauges)
    )
    return Trajectory(times[:n_frames], controls[:n_frames], fields, parameters, gauges)


def _below(prefix: str, stored: Arrays) -> Arrays:
    """Return the arrays whose names begin with `prefix`, by the rest of their names."""
    return {name[len(prefix) :]: stored[name] for name in stored if name.startswith(prefix)}


# --- parameters -----------------------------------------------------------------------------


def _constants(sim: Simulation) -> Arrays:
    """Return all that doesn't change in a run, as it is stored."""
    parameters = {
        "scene": sim.scene,
        "dtype": sim.dtype,
        "neighbors": sim.neighbors,
        "mass": sim.mass,
        "nominal_controls": sim.nominal_controls,
        "n_fluid": sim.n_fluid,
        "n_particles": sim.n_particles,
        "kind": (np.arange(sim.n_particles) >= sim.n_fluid).astype(np.uint8),
        "sph_gym": VERSION,
        "numpy": np.__version__,
        "numba": numba.__version__,
        "python": platform.python_version(),
    }
    return stored_parameters(parameters)


def stored_parameters(parameters: dict[str, Any]) -> Arrays:
    """Return parameters as they are stored: the JSON text, and the arrays that it names."""
    arrays: Arrays = {}

    def keep(name: str, array: NDArray[Any]) -> dict[str, str]:
        arrays[name] = array
        return {"array": name}

    text = json.dumps(to_plain(parameters, "arrays", keep), indent=1)
    return {"parameters": np.bytes_(text.encode())} | arrays


def _parameters(stored: Arrays) -> dict[str, Any]:
    """Return the parameters of a file with their arrays in place."""
    found: dict[str, Any] = json.loads(
        stored["parameters"].item(),
        object_hook=lambda part: stored[part["array"]] if part.keys() == {"array"} else part,
    )
    return found


# --- formats --------------------------------------------------------------------------------


@contextmanager
def _write_npz(path: Path, constants: Arrays) -> Iterator[Append]:
    frames: list[Arrays] = []
    try:
        yield frames.append
    finally:
        if frames:
            stacked: Arrays = {name: np.stack([f[name] for f in frames]) for name in frames[0]}
            with atomic_write(path) as draft:
                np.savez_compressed(draft, **(constants | stacked))


@contextmanager
def _write_hdf5(path: Path, constants: Arrays) -> Iterator[Append]:
    with needs_extra("studies"):
        import h5py
    file: Any = None
    n_frames = 0

    def append(frame: Arrays) -> None:
        nonlocal file, n_frames
        if file is None:
            file = h5py.File(path, "w", libver="v110")
            _lay_out(file, constants, frame)
        for name, value in frame.items():
            file[name].resize(n_frames + 1, axis=0)
            file[name][n_frames] = value
        file.flush()
        n_frames += 1

    try:
        yield append
    finally:
        if file is not None:
            file.close()


def _lay_out(file: Any, constants: Arrays, frame: Arrays) -> None:
    """Write what stays, and make an empty dataset for everything in a frame."""
    for name, value in constants.items():
        file[name] = value
    for name, value in frame.items():
        # a compressed chunk must not be written twice: HDF5 wouldn't use its place again
        packed = name.startswith("fields/")
        shapes = {
            "shape": (0, *value.shape),
            "maxshape": (None, *value.shape),
            "chunks": (1 if packed else 256, *value.shape),
        }
        how = {"compression": "gzip", "shuffle": True} if packed else {}
        file.create_dataset(name, dtype=value.dtype, **shapes, **how)
    # flushing alone may leave a frame that is counted but not there (single writer, many readers)
    file.swmr_mode = True


@contextmanager
def _write_vtk(path: Path, constants: Arrays) -> Iterator[Append]:
    with needs_extra("studies"):
        import meshio
    folder = path.with_suffix("")
    lines: list[str] = []

    def append(frame: Arrays) -> None:
        folder.mkdir(exist_ok=True)
        if not lines:
            (folder / "parameters.json").write_bytes(constants["parameters"].item())
            scene = to_plain(_parameters(constants)["scene"], "scene")
            (folder / "scene.json").write_text(json.dumps(scene), encoding="utf-8")
        name = f"{len(lines):06d}.vtu"
        points, data = _points(frame)
        vertices = np.arange(len(points))[:, None]
        data["kind"] = constants["arrays/kind"]
        meshio.Mesh(points, [("vertex", vertices)], point_data=data).write(folder / name)
        place = quoteattr(f"{folder.name}/{name}")
        lines.append(f'<DataSet timestep="{float(frame["times"])!r}" file={place}/>\n')
        _append_gauges(folder / "gauges.csv", frame, first=not lines[1:])
        write_text(path, INDEX.format("".join(lines)))

    yield append


def _append_gauges(path: Path, frame: Arrays, first: bool) -> None:
    """Write a row with the values of the gauges, if there are any, into a new file if `first`."""
    gauges = _below("gauges/", frame)
    if not gauges:
        return
    with path.open("w" if first else "a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if first:
            axes = {1: ("",), 2: (" x", " y")}
            names = (name + axis for name, value in gauges.items() for axis in axes[len(value)])
            writer.writerow(["time", *names])
        writer.writerow([float(frame["times"]), *np.concatenate([*gauges.values()]).tolist()])


def _points(frame: Arrays) -> tuple[Any, Arrays]:
    """Return positions (n, 3) and the other fields by their names in VTK, vectors as (n, 3)."""
    data: Arrays = {}
    for name, title in FIELDS.items():
        column = frame[f"fields/{name}"].astype(np.float64)
        data[title] = np.pad(column, ((0, 0), (0, 1))) if column.ndim == 2 else column
    return data.pop(FIELDS["x"]), data


def _read_npz(path: Path) -> Arrays:
    try:
        # opened here, because numpy wouldn't close what turns out to be no archive
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (BadZipFile, EOFError) as error:
        raise ValueError(f"path: expected a recording, got {str(path)!r}: {error}") from None


def _read_hdf5(path: Path) -> Arrays:
    with needs_extra("studies"):
        import h5py
    names: list[str] = []
    # this mode also opens what a killed process left
    with h5py.File(path, "r", swmr=True) as file:
        file.visit(names.append)
        return {name: file[name][()] for name in names if isinstance(file[name], h5py.Dataset)}


def _read_vtk(path: Path) -> Arrays:
    """Return the arrays of an index and its frames, named as in the other formats."""
    with needs_extra("studies"):
        import meshio
    try:
        entries = ElementTree.parse(path).getroot().findall("Collection/DataSet")
        times = np.array([float(entry.attrib["timestep"]) for entry in entries])
        frames = [meshio.read(path.parent / entry.attrib["file"]) for entry in entries]
        kind = np.asarray(frames[0].point_data["kind"], np.uint8)
        flat = {title: [frame.point_data[title] for frame in frames] for title in TITLES[1:]}
        flat[TITLES[0]] = [frame.points for frame in frames]
    except (ElementTree.ParseError, KeyError, IndexError, meshio.ReadError) as error:
        raise ValueError(f"path: expected a recording, got {str(path)!r}: {error!r}") from None
    columns = {name: np.stack(flat[title]) for name, title in FIELDS.items()}
    stored: Arrays = {
        f"fields/{name}": column[..., :2] if column.ndim == 3 else column
        for name, column in columns.items()
    }
    stored |= {"times": times, "controls": np.full((len(times), 3), np.nan)}
    stored |= _read_gauges(path.with_suffix("") / "gauges.csv", len(times))
    return stored | _read_constants(path.with_suffix(""), kind)


def _read_constants(folder: Path, kind: NDArray[Any]) -> Arrays:
    """Return the parameters beside the frames of an index; their arrays are in the scene's file."""
    told = json.loads(
        (folder / "parameters.json").read_bytes(),
        object_hook=lambda part: None if part.keys() == {"array"} else part,
    )
    told["scene"] = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    told["kind"] = {"array": "arrays/kind"}
    return {"parameters": np.bytes_(json.dumps(told).encode()), "arrays/kind": kind}


def _read_gauges(path: Path, n_frames: int) -> Arrays:
    """Return the values of the gauges beside the frames, (n_frames, 1 or 2) each."""
    if not path.exists():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        (_, *names), *rows = csv.reader(file)
    values = np.array(rows[:n_frames], float)[:, 1:]
    found: Arrays = {}
    for k, name in enumerate(names):
        if name.endswith(" x") and names[k + 1 : k + 2] == [f"{name[:-2]} y"]:
            found[f"gauges/{name[:-2]}"] = values[:, k : k + 2]
        elif f"gauges/{name[:-2]}" not in found:
            found[f"gauges/{name}"] = values[:, k : k + 1]
    return found


_WRITERS = {".npz": _write_npz, ".h5": _write_hdf5, ".hdf5": _write_hdf5, ".pvd": _write_vtk}
_READERS = {".npz": _read_npz, ".h5": _read_hdf5, ".hdf5": _read_hdf5, ".pvd": _read_vtk}
