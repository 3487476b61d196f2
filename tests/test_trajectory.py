import csv
import json
import shutil
import sys
from dataclasses import dataclass, field, fields, is_dataclass, replace
from xml.etree import ElementTree

import numba
import numpy as np
import pytest

import sph_gym
from sph_gym import Controls, Gravity, Scene, Simulation, scenes
from sph_gym.__main__ import main
from sph_gym.trajectory import FIELDS, Recorder, _constants, read
from tests import cases

ONE_FILE = [".npz", ".h5", ".hdf5"]
ALL = [*ONE_FILE, ".pvd"]


def simulation(dtype="float64"):
    """Fluid, a tank and a box; 60 particles."""
    dx = cases.DX
    fluid = sph_gym.lattice(0.0, 4 * dx, 0.0, 4 * dx, dx)
    walls = sph_gym.Walls(
        particles=sph_gym.tank_particles(4 * dx, 3 * dx, dx, layers=2),
        box=(0.0, 4 * dx, 0.0, np.inf),
    )
    # all effects, as other tests have them compiled
    effects = replace(cases.ALL_EFFECTS, gravity=Gravity(0.0, -9.81, ramp=0.1))
    scene = Scene("cup", fluid, dx, 2.6 * dx, cases.WATER, effects=effects, walls=walls)
    return Simulation(scene, dtype)


def need(suffix):
    pytest.importorskip({".npz": "numpy", ".pvd": "meshio"}.get(suffix, "h5py"))


def state(sim, names=("x", "v", "rho", "p")):
    return {name: getattr(sim, name) for name in names}


def record(path, sim, n_frames=3):
    """Record the start and `n_frames` more, each with another dt; returns what was there."""
    seen = []
    with Recorder(path, sim) as recorder:
        for k in range(n_frames + 1):
            if k:
                sim.controls = sim.controls._replace(dt=sim.controls.dt / 2)
                sim.advance(0.002)
            recorder.record()
            seen.append((sim.time, tuple(sim.controls), state(sim, FIELDS)))
    return seen


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("suffix", ONE_FILE)
def test_what_is_read_is_what_was_there(tmp_path, suffix, dtype):
    need(suffix)
    seen = record(tmp_path / f"run{suffix}", simulation(dtype))
    run = read(tmp_path / f"run{suffix}")
    assert run.times.tolist() == [time for time, _, _ in seen]
    assert run.controls.tolist() == [list(controls) for _, controls, _ in seen]
    assert run.times.dtype == run.controls.dtype == np.float64
    assert set(run.fields) == set(FIELDS)
    for name, column in run.fields.items():
        assert column.dtype == dtype
        np.testing.assert_array_equal(column, [fields[name] for _, _, fields in seen])
    assert [file.name for file in tmp_path.iterdir()] == [f"run{suffix}"]


@pytest.mark.parametrize("suffix", ALL)
def test_gauges_are_kept(tmp_path, suffix):
    need(suffix)
    sim, path = simulation(), tmp_path / f"run{suffix}"
    floor, level = sph_gym.Gauge("force", "bottom", "floor"), sph_gym.Gauge("level", 0.03)
    seen = []
    with Recorder(path, sim, (floor, level)) as recorder:
        for _ in range(3):
            sim.advance(0.002)
            recorder.record()
            seen.append([sim.time, *floor.read(sim), *level.read(sim)])
    if suffix == ".pvd":
        text = (path.with_suffix("") / "gauges.csv").read_text()
        rows = list(csv.reader(text.splitlines()))
        assert rows[0] == ["time", "floor x", "floor y", "level:0.03"]
        assert np.array_equal(np.array(rows[1:], float), seen)
    run = read(path)
    assert set(run.gauges) == {"floor", "level:0.03"}
    assert np.array_equal(run.gauges["floor"], np.array(seen)[:, 1:3])
    assert np.array_equal(run.gauges["level:0.03"], np.array(seen)[:, 3:])


def test_what_paraview_opens_is_read_back(tmp_path):
    need(".pvd")
    sim = simulation()
    seen = record(tmp_path / "run.pvd", sim)
    run = read(tmp_path / "run.pvd")
    assert run.times.tolist() == [time for time, _, _ in seen]
    assert run.controls.shape == (len(seen), 3)
    assert np.isnan(run.controls).all()
    for name, column in run.fields.items():
        np.testing.assert_array_equal(column, [fields[name] for _, _, fields in seen])
    assert run.parameters["kind"].sum() == sim.n_particles - sim.n_fluid
    scene = Scene.from_dict(run.parameters["scene"])
    assert scene.to_dict() == sim.scene.to_dict()


def test_an_index_of_something_else_is_no_recording(tmp_path):
    need(".pvd")
    path = tmp_path / "run.pvd"
    for text in ("no markup", "<VTKFile/>"):
        path.write_text(text)
        with pytest.raises(ValueError, match="path: expected a recording"):
            read(path)


def test_gauges_need_names_of_their_own(tmp_path):
    gauge = sph_gym.Gauge("level", 0.03)
    with pytest.raises(ValueError, match="gauges: expected different names"):
        Recorder(tmp_path / "run.npz", simulation(), [gauge, gauge])


def assert_stored(stored, value):
    """That `stored` names everything in `value`, dataclasses and their fields too."""
    if is_dataclass(value):
        assert stored["class"] == type(value).__name__
        assert set(stored) == {"class"} | {part.name for part in fields(value)}
        for part in fields(value):
            assert_stored(stored[part.name], getattr(value, part.name))
    elif isinstance(value, np.ndarray):
        np.testing.assert_array_equal(stored, value)
    elif isinstance(value, Controls):
        assert stored == value._asdict()
    else:
        assert stored == (list(value) if isinstance(value, tuple) else value)


@pytest.mark.parametrize("suffix", ONE_FILE)
def test_all_parameters_are_in_the_file(tmp_path, suffix):
    need(suffix)
    sim = simulation("float32")
    nominal = sim.nominal_controls
    record(tmp_path / f"run{suffix}", sim)
    stored = read(tmp_path / f"run{suffix}").parameters
    assert_stored(stored["scene"], sim.scene)
    assert stored["scene"]["walls"]["box"][3] == np.inf
    assert stored["scene"]["effects"]["gravity"]["ramp"] == 0.1
    assert stored["dtype"] == "float32"
    assert stored["neighbors"] == "grid"
    assert stored["mass"] == sim.mass
    assert stored["nominal_controls"] == nominal._asdict()
    assert stored["kind"].tolist() == [0] * sim.n_fluid + [1] * (sim.n_particles - sim.n_fluid)
    assert stored["sph_gym"] == sph_gym.__version__
    assert stored["numpy"] == np.__version__
    assert stored["numba"] == numba.__version__


@dataclass(frozen=True)
class Part:
    weights: np.ndarray
    on: bool = True


@dataclass(frozen=True)
class Odd:
    parts: tuple = ()
    limit: float = np.inf
    nothing: None = None
    names: np.ndarray = None
    table: dict = None
    count: np.int32 = field(default_factory=lambda: np.int32(3))
    law: object = len


@pytest.mark.parametrize("suffix", ONE_FILE)
def test_parameters_of_any_make_are_stored(tmp_path, suffix):
    need(suffix)
    sim = simulation()
    parts = Part(np.arange(3.0)), Part(np.zeros((0, 2)), False)
    odd = Odd(parts, names=np.array(["a", "ä"]), table={1: (np.float64(0.1), None)})
    object.__setattr__(sim.scene, "effects", odd)
    with Recorder(tmp_path / f"run{suffix}", sim) as recorder:
        recorder.record()
    stored = read(tmp_path / f"run{suffix}").parameters["scene"]["effects"]
    assert stored["parts"][0]["weights"].tolist() == [0, 1, 2]
    assert stored["parts"][1]["weights"].shape == (0, 2)
    assert [part["on"] for part in stored["parts"]] == [True, False]
    assert stored["limit"] == np.inf
    assert stored["nothing"] is None
    assert stored["names"] == ["a", "ä"]
    assert stored["table"] == {"1": [0.1, None]}
    assert stored["count"] == 3
    assert stored["law"] == repr(len)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_every_frame_of_vtk_has_all_arrays(tmp_path, dtype):
    meshio = pytest.importorskip("meshio")
    sim = simulation(dtype)
    seen = record(tmp_path / "run.pvd", sim)
    for k, (_, _, fields_then) in enumerate(seen):
        mesh = meshio.read(tmp_path / "run" / f"{k:06d}.vtu")
        arrays = {"position": mesh.points, **mesh.point_data}
        kind = arrays.pop("kind")
        assert kind.tolist() == [0] * sim.n_fluid + [1] * (sim.n_particles - sim.n_fluid)
        assert set(arrays) == set(FIELDS.values())
        for name, title in FIELDS.items():
            column = fields_then[name]
            assert arrays[title].dtype == np.float64
            if column.ndim == 2:
                assert arrays[title].shape == (sim.n_particles, 3)
                assert not arrays[title][:, 2].any()
                arrays[title] = arrays[title][:, :2]
            np.testing.assert_array_equal(arrays[title], column)
        (cells,) = mesh.cells
        assert cells.type == "vertex"
        assert cells.data.ravel().tolist() == list(range(sim.n_particles))


def indexed(path):
    """Times and files that ParaView's index lists."""
    entries = ElementTree.parse(path).getroot().findall("Collection/DataSet")
    return [(float(entry.get("timestep")), entry.get("file")) for entry in entries]


def test_the_index_lists_the_times_from_the_first_frame_on(tmp_path):
    need(".pvd")
    sim, path, times = simulation(), tmp_path / 'a "b" & c.pvd', []
    with Recorder(path, sim) as recorder:
        for k in range(3):
            times.append(sim.time)
            recorder.record()
            assert indexed(path) == [
                (time, f'a "b" & c/{frame:06d}.vtu') for frame, time in enumerate(times)
            ]
            assert all((tmp_path / file).exists() for _, file in indexed(path))
            sim.advance(0.001 * (k + 1))


def test_the_parameters_are_beside_the_frames(tmp_path):
    need(".pvd")
    record(tmp_path / "run.pvd", simulation(), n_frames=0)
    stored = json.loads((tmp_path / "run" / "parameters.json").read_text())
    assert stored["scene"]["effects"]["gravity"] == {
        "class": "Gravity",
        "x": 0.0,
        "y": -9.81,
        "ramp": 0.1,
    }


@pytest.mark.parametrize("suffix", ONE_FILE)
@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_an_interrupted_recording_is_kept(tmp_path, suffix, error):
    need(suffix)
    sim, path = simulation(), tmp_path / f"run{suffix}"

    def run():
        with Recorder(path, sim) as recorder:
            for _ in range(2):
                recorder.record()
                sim.advance(0.001)
            raise error

    with pytest.raises(error):
        run()
    assert len(read(path).times) == 2
    assert len(read(path).fields["x"]) == 2


def test_hdf5_can_be_read_while_it_is_written_and_after_a_crash(tmp_path):
    need(".h5")
    sim = simulation()
    with Recorder(tmp_path / "run.h5", sim) as recorder:
        for k in range(1, 4):
            recorder.record()
            shutil.copy(tmp_path / "run.h5", tmp_path / "left.h5")
            left = read(tmp_path / "left.h5")
            assert left.times[-1] == sim.time
            assert {len(left.times), *map(len, left.fields.values())} == {k}
            np.testing.assert_array_equal(left.fields["p"][-1], sim.p)
            sim.advance(0.001)


def test_a_frame_in_hand_is_dropped_and_written_again(tmp_path, monkeypatch):
    h5py = pytest.importorskip("h5py")
    sim, path = simulation(), tmp_path / "run.h5"
    with Recorder(path, sim) as recorder:
        recorder.record()
        sim.advance(0.001)
        write, done = h5py.Dataset.__setitem__, []

        def interrupted(dataset, *arguments):
            if done:
                raise KeyboardInterrupt
            done.append(dataset)
            write(dataset, *arguments)

        with monkeypatch.context() as patch:
            patch.setattr(h5py.Dataset, "__setitem__", interrupted)
            with pytest.raises(KeyboardInterrupt):
                recorder.record()
        shutil.copy(path, tmp_path / "left.h5")
        recorder.record()
    assert len(read(tmp_path / "left.h5").times) == 1
    assert len(read(tmp_path / "left.h5").fields["x"]) == 1
    np.testing.assert_array_equal(read(path).fields["x"][1:], [sim.x])


@pytest.mark.parametrize("suffix", ALL)
def test_without_a_frame_nothing_is_touched(tmp_path, suffix):
    need(suffix)
    path = tmp_path / f"run{suffix}"
    path.write_text("precious")
    with pytest.raises(RuntimeError), Recorder(path, simulation()):
        raise RuntimeError
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]


def test_a_failed_write_leaves_what_was_there(tmp_path, monkeypatch):
    path = tmp_path / "run.npz"
    path.write_text("precious")

    def full(*arguments, **more):
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(OSError, match="disk full"):
        record(path, simulation(), n_frames=0)
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", ALL)
def test_a_closed_recorder_takes_no_frames(tmp_path, suffix):
    need(suffix)
    with Recorder(tmp_path / f"run{suffix}", simulation()) as recorder:
        recorder.record()
        recorder.close()
        with pytest.raises(ValueError, match="closed"):
            recorder.record()


def test_wrong_words_are_named(tmp_path):
    sim = simulation()
    with pytest.raises(ValueError, match=r"path: expected a name ending in \.npz or \.h5 .*\.vtk'"):
        Recorder(tmp_path / "run.vtk", sim)
    with pytest.raises(FileNotFoundError, match="no directory"):
        Recorder(tmp_path / "nowhere" / "run.npz", sim)
    with pytest.raises(ValueError, match=r"path: expected one of \.npz, \.h5, \.hdf5, \.pvd, got"):
        read(tmp_path / "run.vtk")


def test_other_files_are_no_recordings(tmp_path):
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    with pytest.raises(ValueError, match="expected a recording"):
        read(tmp_path / "other.npz")
    (tmp_path / "torn.npz").write_bytes((tmp_path / "other.npz").read_bytes()[:100])
    with pytest.raises(ValueError, match="expected a recording"):
        read(tmp_path / "torn.npz")
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "nothing.npz")


def test_nothing_is_unpickled(tmp_path):
    constants = _constants(simulation())
    np.savez(tmp_path / "bad.npz", **constants, times=np.array([{}], dtype=object))
    with pytest.raises(ValueError, match="allow_pickle=False"):
        read(tmp_path / "bad.npz")


@pytest.mark.parametrize(("suffix", "library"), [(".h5", "h5py"), (".pvd", "meshio")])
def test_without_the_library_the_extra_is_named(tmp_path, suffix, library, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(
        ImportError, match=rf'{library} is missing: pip install "sph_gym\[studies\]"'
    ):
        Recorder(tmp_path / f"run{suffix}", simulation())


def test_the_command_line_saves_the_start_and_every_frame(tmp_path, capsys):
    path = tmp_path / "run.npz"
    command = ["run", "patch_impact", "--set", "dx=0.1", "--seconds", "0.1", "--save", str(path)]
    assert main([*command, "--dtype", "float32", "--dt", "0.001"]) == 0
    assert f"trajectory: {path}" in capsys.readouterr().out
    run, scene = read(path), scenes.make("patch_impact", dx=0.1)
    assert run.times[0] == 0.0
    assert run.times[-1] == pytest.approx(0.1)
    assert np.diff(run.times[:-1]) == pytest.approx(scene.frame)
    assert run.controls[0, 0] == 0.001
    assert run.fields["x"].dtype == np.float32
    assert run.parameters["scene"]["name"] == scene.name


def test_the_command_line_saves_and_films_at_once(tmp_path):
    for library in ("imageio", "meshio"):
        pytest.importorskip(library)
    film, path = tmp_path / "run.gif", tmp_path / "run.pvd"
    command = ["run", "relaxation", "--set", "dx=0.1", "--seconds", "0.05"]
    assert main([*command, "--video", str(film), "--save", str(path)]) == 0
    assert film.exists()
    assert [time for time, _ in indexed(path)][-1] == pytest.approx(0.05)


def test_the_command_line_names_the_formats(tmp_path, capsys):
    assert main(["run", "relaxation", "--set", "dx=0.1", "--save", str(tmp_path / "run.csv")]) == 2
    assert "expected a name ending in .npz or .h5 or .hdf5 or .pvd" in capsys.readouterr().err


def test_a_file_in_the_place_of_the_folder_is_an_error_at_once(tmp_path):
    need(".pvd")
    (tmp_path / "run").write_text("mine")
    with pytest.raises(FileExistsError, match="path: expected a folder"):
        Recorder(tmp_path / "run.pvd", simulation())
    (tmp_path / "other").mkdir()
    Recorder(tmp_path / "other.pvd", simulation()).close()
