import numpy as np
import pytest

from sph_gym import Simulation, scenes
from sph_gym.doctor.plain import make
from sph_gym.doctor.reading import open_recording
from sph_gym.trajectory import Recorder
from tests.doctor import recorded

h5py = pytest.importorskip("h5py")
meshio = pytest.importorskip("meshio")


@pytest.fixture(scope="module")
def run():
    return recorded.flow(make)


def same(recording, run, times=True, rtol=1e-6):
    assert len(recording) == len(run["t"])
    for k in (0, 3, len(recording) - 1):
        frame = recording.frame(k)
        rows = slice(None) if frame.ids is None else np.argsort(frame.ids)
        for name in ("x", "v", "rho", "p"):
            np.testing.assert_allclose(getattr(frame, name)[rows], run[name][k], rtol, 1e-6)
        if times:
            assert frame.time == pytest.approx(run["t"][k])
        else:
            assert np.isnan(frame.time)


@pytest.mark.parametrize("names", [("x", "v", "rho", "p", "t"),
                                   ("Position", "velocity", "Density", "Pres", "time"),
                                   ("pos", "Vel", "Rhop", "Press", "times")])  # fmt: skip
@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_arrays_by_usual_names(tmp_path, run, names, suffix):
    arrays = dict(zip(names, run.values(), strict=True))
    path = tmp_path / f"run{suffix}"
    if suffix == ".npz":
        np.savez(path, **arrays)
    else:
        with h5py.File(path, "w") as file:
            for name, array in arrays.items():
                file[f"group/{name}"] = array
    same(open_recording(path), run)


def test_arrays_of_components_and_identities(tmp_path, run):
    path, order = tmp_path / "run.npz", np.random.default_rng(0).permutation(100)
    x, v, rho, p = (run[name][:, order] for name in ("x", "v", "rho", "p"))
    columns = {"x": x[..., 0], "y": x[..., 1], "u": v[..., 0], "v": v[..., 1], "rho": rho, "p": p}
    np.savez(path, **columns, Idp=order, time=run["t"], name="a dam")
    same(open_recording(path), run)


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".pvd"])
def test_recordings_of_this_project(tmp_path, suffix):
    sim = Simulation(scenes.make("hydrostatic_tank", dx=0.08))
    path = tmp_path / f"run{suffix}"
    with Recorder(path, sim) as recorder:
        recorder.record()
        sim.advance(0.01)
        recorder.record()
    recording = open_recording(path)
    frame = recording.frame(1)
    assert recording.known.scene.dx == 0.08
    assert frame.wall.sum() == sim.n_particles - sim.n_fluid
    np.testing.assert_allclose(frame.x, sim.x, rtol=1e-12)
    assert frame.time == pytest.approx(0.01)
    assert (recording.known.stiffness is None) == (suffix == ".pvd")


@pytest.mark.parametrize("text", [True, False], ids=["ASCII", "BINARY"])
def test_vtk_of_dualsphysics(tmp_path, run, text):
    recorded.write_partvtk(tmp_path, run, text=text)
    same(open_recording(tmp_path / "PartFluid_0003.vtk"), run, times=False)
    same(open_recording(tmp_path), run, times=False)


def test_csv_of_dualsphysics(tmp_path, run):
    recorded.write_partvtk_csv(tmp_path, run)
    same(open_recording(tmp_path), run)


def test_csv_of_paraview(tmp_path, run):
    for k in range(len(run["t"])):
        heading = "Density,Velocity:0,Velocity:1,Velocity:2,Pressure,Points:0,Points:1,Points:2"
        zero = np.zeros(100)
        v, x = run["v"][k], run["x"][k]
        columns = [run["rho"][k], *v.T, zero, run["p"][k], *x.T, zero]
        table = np.stack(columns, axis=1)
        np.savetxt(tmp_path / f"out.{k}.csv", table, delimiter=",", header=heading, comments="")
    same(open_recording(tmp_path / "out.0.csv"), run, times=False)


@pytest.mark.parametrize("suffix", [".hdf5", ".npz"])
def test_output_of_pysph(tmp_path, run, suffix):
    wall = np.stack([np.linspace(0, 0.8, 20), np.full(20, -0.02)], axis=1)
    recorded.write_pysph(tmp_path, run, suffix, wall=wall)
    for path in (tmp_path, tmp_path / f"flow_20{suffix}"):
        recording = open_recording(path)
        frame = recording.frame(3)
        assert recording.form == "output of PySPH"
        assert frame.wall.sum() == 20
        assert frame.ids is None
        assert frame.time == pytest.approx(run["t"][3])
        np.testing.assert_array_equal(frame.x[~frame.wall], run["x"][3])
        np.testing.assert_array_equal(frame.v[~frame.wall], run["v"][3])


def test_what_a_pickle_names_is_not_run(tmp_path):
    class Evil:
        def __reduce__(self):
            return (tmp_path / "run").touch, ()

    content = np.array({"fluid": Evil()}, dtype=object)
    np.savez(tmp_path / "a_0.npz", particles=content, solver_data=np.array({}, dtype=object))
    with pytest.raises(ValueError, match="which is no number"):
        open_recording(tmp_path / "a_0.npz")
    assert not (tmp_path / "run").exists()


def test_vtu_series_and_pvd(tmp_path, run):
    lines = []
    for k, t in enumerate(run["t"]):
        pad = [np.pad(run[name][k], ((0, 0), (0, 1))) for name in "xv"]
        columns = {"vel": pad[1], "rho": run["rho"][k], "pressure": run["p"][k]}
        recorded.write_vtu(tmp_path / f"f{k}.vtu", columns, pad[0])
        lines.append(f'<DataSet timestep="{float(t)!r}" part="0" file="f{k}.vtu"/>')
    same(open_recording(tmp_path / "f2.vtu"), run, times=False)
    text = f'<VTKFile type="Collection"><Collection>{"".join(lines)}</Collection></VTKFile>'
    (tmp_path / "flow.pvd").write_text(text)
    same(open_recording(tmp_path / "flow.pvd"), run)
    same(open_recording(tmp_path), run)


UNSTRUCTURED = """# vtk DataFile Version 5.1
vtk output
ASCII
DATASET UNSTRUCTURED_GRID
FIELD FieldData 1
TimeValue 1 1 double
0.25
POINTS 2 double
0 1 0 1 0.5 0
METADATA
INFORMATION 0

CELLS 3 2
OFFSETS vtktypeint64
0 1 2
CONNECTIVITY vtktypeint64
0 1
CELL_TYPES 2
1
1
POINT_DATA 2
FIELD FieldData 2
velocity 3 2 float
1 2 0
3 4 0
density 1 2 double
1000 nan
METADATA
INFORMATION 0

CELL_DATA 2
SCALARS density float
LOOKUP_TABLE default
7 7
"""


def test_newer_legacy_vtk(tmp_path):
    (tmp_path / "drop.vtk").write_text(UNSTRUCTURED)
    frame = open_recording(tmp_path / "drop.vtk").frame(0)
    np.testing.assert_array_equal(frame.x, [[0, 1], [1, 0.5]])
    np.testing.assert_array_equal(frame.v, [[1, 2], [3, 4]])
    np.testing.assert_array_equal(frame.rho, [1000, np.nan])
    assert frame.time == 0.25


def test_three_dimensions_stay(tmp_path):
    x = np.random.default_rng(0).random((2, 30, 3))
    np.savez(tmp_path / "run.npz", x=x)
    assert open_recording(tmp_path / "run.npz").frame(0).x.shape == (30, 3)


def write_unknown(folder, name):
    path = folder / name
    if name.endswith(".npz"):
        np.savez(path, places=np.zeros((3, 4, 2)))
    elif name.endswith(".h5"):
        with h5py.File(path, "w") as file:
            file["a/temperature"] = np.zeros(3)
    elif name.endswith(".csv"):
        path.write_text("a,b\n1,2\n")
    elif name.endswith(".vtk"):
        path.write_text(UNSTRUCTURED[:250])
    else:
        path.write_text("nothing")
    return path


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("run.npz", ["expected positions", r"places \(3, 4, 2\)"]),
        ("run.h5", ["expected positions", "temperature"]),
        ("run.csv", ["expected a heading with positions", "a,b"]),
        ("run.vtk", ["expected a complete VTK file"]),
        ("run.vtu", ["expected a VTK file that meshio reads"]),
        ("run.pvd", ["expected ParaView's index"]),
        ("run.dat", ["suffix of recording: expected one of"]),
    ],
)
def test_what_is_not_known_lists_names(tmp_path, name, words):
    path = write_unknown(tmp_path, name)
    for word in words:
        with pytest.raises(ValueError, match=word):
            open_recording(path)


def test_folders_without_one_series(tmp_path):
    with pytest.raises(FileNotFoundError):
        open_recording(tmp_path / "nothing")
    with pytest.raises(ValueError, match=r"expected a \.pvd or a numbered series"):
        open_recording(tmp_path)
    for name in ("a0.vtk", "a1.vtk", "b0.vtk", "b1.vtk"):
        (tmp_path / name).write_text(UNSTRUCTURED)
    with pytest.raises(ValueError, match="expected one numbered series"):
        open_recording(tmp_path)


def test_columns_of_other_lengths(tmp_path):
    np.savez(tmp_path / "run.npz", x=np.zeros((2, 5, 2)), rho=np.zeros((2, 4)))
    with pytest.raises(ValueError, match="expected rho of 5 particles"):
        open_recording(tmp_path / "run.npz")
