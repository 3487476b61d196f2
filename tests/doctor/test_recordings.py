from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Simulation, scenes
from sph_gym.doctor import check_recording, faults, plain
from sph_gym.doctor.diagnosis import LINKS
from sph_gym.doctor.recordings import CHECKS
from sph_gym.trajectory import Recorder
from tests.doctor import recorded
from tests.doctor.healthy import HEALTHY

pytest.importorskip("scipy")
h5py = pytest.importorskip("h5py")


@pytest.fixture(scope="module")
def runs():
    return {name: recorded.flow(plain.make, name) for name in recorded.CASES}


def check(folder, run):
    path = folder / "run.npz"
    np.savez(path, **run)
    return check_recording(path)


def result(diagnosis, name):
    return next(each for each in diagnosis.results if each.check == name)


def changed(run, **columns):
    return {name: array.copy() for name, array in run.items()} | columns


# --- sound ones -------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("case", recorded.CASES)
@pytest.mark.parametrize("name", HEALTHY)
def test_no_sound_solver_is_accused(tmp_path, name, case):
    run = recorded.flow(HEALTHY[name], case) if hasattr_all(HEALTHY[name]) else None
    run = run or without_fields(HEALTHY[name], case)
    diagnosis = check(tmp_path, run)
    assert diagnosis.ok, diagnosis.verdict


def hasattr_all(make):
    start, _ = recorded.CASES["blob"]()
    solver = make(start)
    return all(getattr(solver, name, None) is not None for name in ("rho", "p"))


def without_fields(make, case):
    class Only:
        def __init__(self, start):
            self._solver = make(start)
            self.rho = self.p = np.zeros(start.n)

        x = property(lambda self: self._solver.x)
        v = property(lambda self: self._solver.v)

        def step(self, dt):
            self._solver.step(dt)

    run = recorded.flow(Only, case)
    return {name: run[name] for name in ("x", "v", "t")}


def test_what_a_sound_recording_tells(tmp_path, runs):
    diagnosis = check(tmp_path, runs["blob"])
    assert [each.check for each in diagnosis.results if each.broken] == []
    assert {each.check for each in diagnosis.results} == {each.name for each in CHECKS}
    order = [LINKS.index(each.link) for each in diagnosis.results]
    assert order == sorted(order)
    assert result(diagnosis, "equation_of_state").measured == pytest.approx(7.0, abs=0.1)
    assert "c0 = 20 m/s" in result(diagnosis, "equation_of_state").message
    assert result(diagnosis, "motion").measured == pytest.approx(1.0, abs=0.05)
    for name in ("finite", "particles", "interior_density", "suction", "clumping", "momentum",
                 "speeds", "escape"):  # fmt: skip
        assert result(diagnosis, name).status == "pass", name


def test_a_gravity_is_found(tmp_path):
    run = recorded.flow(plain.make, "blob")
    t = run["t"][:, None, None]
    g = np.array([0.0, -9.81])
    run["x"], run["v"] = run["x"] + g / 2 * t**2, run["v"] + g * t
    assert "gravity of" in result(check(tmp_path, run), "momentum").message


@pytest.mark.parametrize("write", [recorded.write_partvtk, recorded.write_partvtk_csv,
                                   recorded.write_pysph])  # fmt: skip
def test_foreign_formats_are_judged_alike(tmp_path, runs, write):
    write(tmp_path, runs["dam"])
    diagnosis = check_recording(tmp_path)
    assert diagnosis.ok, diagnosis.verdict
    assert result(diagnosis, "equation_of_state").status == "pass"
    motion = result(diagnosis, "motion").status
    assert motion == ("inconclusive" if write is recorded.write_partvtk else "pass")


def record(folder, sim, n_frames=20, seconds=0.01):
    path = folder / "run.npz"
    with Recorder(path, sim) as recorder:
        recorder.record()
        for _ in range(n_frames):
            if sim.advance(seconds).diverged:
                break
            recorder.record()
    return path


@pytest.mark.parametrize("name", ["hydrostatic_tank", "relaxation"])
def test_scenes_of_this_project(tmp_path, name):
    sim = Simulation(scenes.make(name, dx=0.08))
    diagnosis = check_recording(record(tmp_path, sim))
    assert diagnosis.ok, diagnosis.verdict
    law = result(diagnosis, "equation_of_state")
    assert (law.status, law.measured < 1e-3) == ("pass", True)


# --- broken ones ------------------------------------------------------------------------------


@pytest.mark.every(5)
@pytest.mark.parametrize(
    ("fault", "case", "link"),
    [
        ("no_clamp", "dam", "pressure"),
        ("no_clamp", "spin", "pressure"),
        ("clamp_from_above", "blob", "pressure"),
        ("ratio_upside_down", "dam", "pressure"),
        ("density_of_the_start", "dam", "density"),
        ("twice_the_mass", "blob", "density"),
        ("half_drift", "spin", "integration"),
        ("own_dt", "dam", "integration"),
        ("sorted_positions", "spin", "neighbours"),
        ("column_visited_twice", "spin", "neighbours"),
    ],
)
def test_faults_that_a_recording_betrays(tmp_path, fault, case, link):
    diagnosis = check(tmp_path, recorded.flow(faults.make(fault), case))
    assert diagnosis.link == link, diagnosis.verdict


@pytest.mark.parametrize("column", ["rho", "p", "v", "x"])
def test_the_first_value_that_is_not_finite(tmp_path, runs, column):
    run = changed(runs["dam"])
    later = ["rho", "p", "v", "x"][["rho", "p", "v", "x"].index(column) :]
    for name in later:
        run[name][5:, 17] = np.nan
        run[name][6:] = np.nan
    found = result(check(tmp_path, run), "finite")
    links = {"rho": "density", "p": "pressure", "v": "force", "x": "integration"}
    assert (found.status, found.link) == ("fail", links[column])
    assert found.measured == f"{column} in frame 5"
    assert "of particle 17 " in found.message


def test_nothing_but_nan(tmp_path, runs):
    run = {name: np.full_like(array, np.nan) for name, array in runs["dam"].items()}
    diagnosis = check(tmp_path, run | {"t": runs["dam"]["t"]})
    assert diagnosis.link == "density"
    run = {"x": np.full((3, 4, 2), np.nan)}
    assert check(tmp_path, run).link == "setup"


def test_identities(tmp_path, runs):
    n = runs["dam"]["x"].shape[1]
    ids = np.tile(np.arange(n), (len(runs["dam"]["t"]), 1))
    ids[4:, 7] = 8
    diagnosis = check(tmp_path, changed(runs["dam"], id=ids))
    assert diagnosis.link == "setup"
    assert "same identity" in diagnosis.first.message
    same = np.zeros_like(ids)
    diagnosis = check(tmp_path, changed(runs["dam"], id=same))
    assert diagnosis.ok
    assert "not used" in diagnosis.notes[0]


def test_rows_in_another_order(tmp_path, runs):
    rng = np.random.default_rng(0)
    run = changed(runs["spin"])
    n = run["x"].shape[1]
    ids = np.tile(np.arange(n), (len(run["t"]), 1))
    for k in range(1, len(run["t"])):
        order = rng.permutation(n)
        for name in ("x", "v", "rho", "p"):
            run[name][k] = run[name][k][order]
        ids[k] = order
    found = result(check(tmp_path, run), "particles")
    assert found.status == "inconclusive"
    assert result(check(tmp_path, run), "motion").status == "skip"
    diagnosis = check(tmp_path, run | {"id": ids})
    assert result(diagnosis, "particles").status == "pass"
    assert result(diagnosis, "motion").status == "pass"


@pytest.mark.parametrize(("gone", "status"), [(45, "fail"), (0, "inconclusive")])
def test_particles_that_vanish(tmp_path, runs, gone, status):
    run = runs["spin"]
    for k in range(len(run["t"])):
        kept = np.arange(100) != gone if k > 5 else np.ones(100, bool)
        columns = {name: run[name][k][kept] for name in ("x", "v", "rho", "p")}
        np.savez(tmp_path / f"s_{k}.npz", **columns, id=np.arange(100)[kept], t=run["t"][k])
    diagnosis = check_recording(tmp_path)
    found = result(diagnosis, "particles")
    assert (found.status, found.link) == (status, "setup")
    assert str(gone) in found.message


@pytest.mark.parametrize("factor", [0.5, 1000.0])
def test_other_units(tmp_path, runs, factor):
    diagnosis = check(tmp_path, changed(runs["spin"], t=runs["spin"]["t"] / factor))
    found = result(diagnosis, "motion")
    assert (found.status, found.link) == ("fail", "integration")
    assert found.measured == pytest.approx(factor, rel=0.05)


def test_numbers_of_frames_are_no_times(tmp_path, runs):
    run = changed(runs["spin"], t=np.arange(len(runs["spin"]["t"])))
    assert result(check(tmp_path, run), "motion").status == "inconclusive"


def test_particles_that_stay_though_they_are_fast(tmp_path, runs):
    run = changed(runs["spin"])
    run["x"][:, 31] = run["x"][0, 31]
    diagnosis = check(tmp_path, run)
    found = result(diagnosis, "frozen")
    assert (found.status, found.link) == ("fail", "integration")
    assert "31 the first" in found.message


def test_particles_that_never_move_are_walls(tmp_path, runs):
    run = runs["dam"]
    n_frames = len(run["t"])
    floor = np.stack([np.arange(-2, 24) * 0.04, np.full(26, -0.02)], axis=1)
    wall = {"x": floor, "v": np.zeros_like(floor), "rho": np.full(26, 1000.0), "p": np.zeros(26)}
    both = {
        name: np.concatenate([run[name], np.stack([column] * n_frames)], axis=1)
        for name, column in wall.items()
    }
    diagnosis = check(tmp_path, both | {"t": run["t"]})
    assert diagnosis.ok, diagnosis.verdict
    assert "26 of 126 particles never move" in diagnosis.notes[0]
    leak = {name: array.copy() for name, array in both.items()}
    leak["x"][5:, 3, 1] = np.linspace(-0.03, -0.4, n_frames - 5)
    assert check(tmp_path, leak | {"t": run["t"]}).link == "walls"
    # a wall that is told from the fluid and moves away may be followed
    leak["kind"] = np.arange(126) >= 100
    assert check(tmp_path, leak | {"t": run["t"]}).link == "walls"
    leak["x"][5:, 100:, 1] -= 0.5
    assert check(tmp_path, leak | {"t": run["t"]}).ok


def test_particles_at_one_place(tmp_path, runs):
    run = changed(runs["spin"])
    run["x"][8:, 44] = run["x"][8:, 45]
    found = result(check(tmp_path, run), "clumping")
    assert (found.status, found.link) == ("fail", "force")


def test_a_fluid_that_bursts(tmp_path, runs):
    run = changed(runs["blob"])
    run["v"][10:] *= 500
    diagnosis = check(tmp_path, run)
    assert result(diagnosis, "speeds").status == "fail"
    assert result(diagnosis, "energy").status == "fail"


def test_densities_below_zero(tmp_path, runs):
    run = changed(runs["dam"])
    run["rho"][-1, 12] = -1.0
    found = result(check(tmp_path, run), "interior_density")
    assert (found.status, found.measured) == ("fail", -1.0)


def tamper(path, change):
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    change(arrays)
    np.savez(path, **arrays)
    return check_recording(path)


@pytest.mark.parametrize(
    ("check_name", "link", "column", "factor", "added"),
    [
        ("momentum", "force", "fields/v", 0.0, 3.0),
        ("equation_of_state", "pressure", "fields/p", 6.0, 0.0),
        ("energy", "integration", "fields/v", 20.0, 0.0),
        ("interior_density", "density", "fields/rho", 1.0, 0.0),
    ],
)
def test_against_the_scene_of_the_recording(tmp_path, check_name, link, column, factor, added):
    scene = scenes.make("relaxation", dx=0.08)
    # moving, and pressed, so that there are pressures
    x = 0.97 * np.asarray(scene.x)
    scene = replace(scene, x=x, v=np.full_like(x, 0.5))
    path = record(tmp_path, Simulation(scene), 10)
    assert check_recording(path).ok, check_recording(path).verdict

    def change(arrays):
        time = arrays["times"].reshape(-1, *[1] * (arrays[column].ndim - 1))
        grows = time if column == "fields/v" else 1.0
        arrays[column] = arrays[column] * (1 + factor * grows) + added * grows

    found = result(tamper(path, change), check_name)
    assert (found.status, found.link) == ("fail", link)


def test_outside_the_box_of_the_scene(tmp_path):
    path = record(tmp_path, Simulation(scenes.make("hydrostatic_tank", dx=0.08)), 5)
    assert check_recording(path).ok

    def leak(arrays):
        arrays["fields/x"][3:, 7, 1] = -0.1

    found = result(tamper(path, leak), "escape")
    assert (found.status, found.link) == ("fail", "walls")
    assert "particle 7" in found.message


@pytest.mark.parametrize("n", [0, 1, 2, 5])
def test_hardly_any_particles(tmp_path, n):
    x = np.random.default_rng(0).random((4, n, 2))
    run = {"x": x, "v": np.zeros_like(x), "rho": np.ones((4, n)), "p": np.zeros((4, n))}
    assert check(tmp_path, run).ok


def test_one_frame(tmp_path, runs):
    assert check(tmp_path, {name: array[:1] for name, array in runs["dam"].items()}).ok
