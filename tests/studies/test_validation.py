import json
from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Simulation, scenes
from sph_gym.__main__ import main
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference
from sph_gym.solver.warnings import Warning
from sph_gym.studies import gallery, run_study, validation

QUICKLY = {"diameter": 0.3, "jitter": 0.01}


def observe(sim):
    return {"kinetic": sim.diagnostics()["kinetic_energy"]}


def judge(run):
    error = 3.0 * run.sim.scene.dx**2
    return [
        Measure("planted error", error, "m^2", None if run.sim.scene.dx > 0.06 else 1e-2),
        Measure("observations", len(run.seen), ""),
    ]


def chart(run):
    kinetic = run.series("kinetic")
    return Chart(
        "time [s]",
        "kinetic energy [J/m]",
        [Curve("simulated", run.times, kinetic), Curve("rest", run.times, 0 * kinetic, True)],
    )


@pytest.fixture
def planted(monkeypatch):
    """A reference whose error is of second order, and the runs that were made for it."""
    runs = []

    def counted(sim):
        if sim.time == 0.0:
            runs.append(sim.scene.dx)
        return observe(sim)

    reference = Reference(
        source="nobody",
        unit="m^2",
        error=lambda sim: sim.scene.dx**2,
        observe=counted,
        judge=judge,
        chart=chart,
        resolutions=({"dx": 0.08, **QUICKLY}, {"dx": 0.05, **QUICKLY}),
    )
    monkeypatch.setattr(
        scenes, "reference", lambda name: reference if name == "relaxation" else None
    )
    return runs


def rows(folder, **options):
    return list(validation.measure(False, folder, **options))


def test_rows_of_every_resolution_and_the_order_between_them(planted, tmp_path):
    found = rows(tmp_path)
    assert [row.quantity for row in found] == [
        "planted error", "observations", "wall clock",
        "planted error", "observations", "wall clock",
        "order of convergence, planted error",
    ]  # fmt: skip
    assert found[-1].value == pytest.approx(2.0)
    assert found[-1].case == "relaxation, dx = 0.08 to 0.05"
    assert [row.bound for row in found[:4:3]] == [None, 1e-2]
    assert planted == [0.08, 0.05]
    assert (tmp_path / "validation" / "relaxation.png").stat().st_size > 10_000


def test_finished_runs_are_not_repeated_unless_asked_for(planted, tmp_path):
    first = rows(tmp_path)
    assert rows(tmp_path) == first
    assert planted == [0.08, 0.05]
    assert [row.quantity for row in rows(tmp_path, again=True)] == [row.quantity for row in first]
    assert planted == [0.08, 0.05] * 2


def test_quick_is_the_coarsest(planted, tmp_path):
    assert len(list(validation.measure(True, tmp_path))) == 3
    assert planted == [0.08]


def test_other_sources_arguments_or_numpy_are_another_run(tmp_path, monkeypatch):
    def path(arguments=(0.08,)):
        return validation.results(tmp_path).path(validation.run_key("relaxation", arguments))

    paths = {path(), path((0.05,))}
    assert path() in paths
    with monkeypatch.context() as patch:
        patch.setattr(np, "__version__", "9.9")
        paths.add(path())
    with monkeypatch.context() as patch:
        patch.setattr("sph_gym.studies.results.source_hash", lambda *places: "edited")
        paths.add(path())
    with monkeypatch.context() as patch:
        patch.setattr("sph_gym.solver.jit.source_hash", lambda: "another compiler")
        paths.add(path())
    assert len(paths) == 5


def test_a_run_depends_on_solver_scenes_and_study(tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr("sph_gym.studies.results.source_hash", lambda *places: seen.extend(places))
    validation.results(tmp_path)
    assert seen == ["solver", "scenes", "studies/validation.py"]


def test_a_part_of_the_study_leaves_the_files_of_the_whole_alone(planted, tmp_path, monkeypatch):
    (tmp_path / "validation").mkdir()
    whole = [tmp_path / name for name in ("validation.csv", "validation.json")]
    picture = tmp_path / "validation" / "relaxation.png"
    for path in (*whole, picture):
        path.write_text("of the whole")
    run_study("validation", quick=True, folder=tmp_path)
    assert picture.read_text() == "of the whole"
    run_study("validation", folder=tmp_path, chosen=["relaxation"])
    assert all(path.read_text() == "of the whole" for path in whole)
    for part in ("quick", "relaxation"):
        assert "planted error" in (tmp_path / f"validation_{part}.csv").read_text()
        assert (tmp_path / f"validation_{part}.json").exists()
    with pytest.raises(ValueError, match="scenes: expected one of"):
        run_study("validation", folder=tmp_path / "new", chosen=["../relaxation"])
    assert not (tmp_path / "new").exists()


def result(curves, **arguments):
    chart = Chart("x", "y", curves)
    return validation.Validated("planted", arguments, arguments["dx"], [], chart, 1.0, 1)


def test_every_reference_is_drawn_once():
    x = np.linspace(0.0, 1.0, 5)
    seen, first, second = Curve("seen", x, x), Curve("a", x, x, True), Curve("b", x, 2 * x, True)
    coarser = Curve("a", x[::2], x[::2], True)
    for results, expected in (
        # the last one has none of its own
        ([result([seen, first], dx=0.1, roll=1.0), result([seen], dx=0.1)], [first]),
        ([result([first, seen], dx=0.1, roll=1.0), result([second], dx=0.1)], [first, second]),
        ([result([first], dx=0.1, kind="k"), result([first], dx=0.1, kind="l")], [first]),
        # the finest is enough where only dx differs
        ([result([coarser], dx=0.2), result([first, second], dx=0.1)], [first, second]),
    ):
        found = gallery._references(results)
        assert [id(curve) for curve in found] == [id(curve) for curve in expected]


def test_an_interrupted_study_keeps_what_is_done(planted, tmp_path, monkeypatch):
    went, kept = validation.run, []

    def interrupted(name, arguments, folder, again=False):
        if arguments["dx"] == 0.05 and not kept:
            kept.append(True)
            raise KeyboardInterrupt
        return went(name, arguments, folder, again)

    monkeypatch.setattr(validation, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_study("validation", folder=tmp_path)
    assert "planted error" in (tmp_path / "validation.csv").read_text()
    assert run_study("validation", folder=tmp_path) == 0
    assert planted == [0.08, 0.05]


def test_what_is_on_disk_says_all(planted, tmp_path):
    rows(tmp_path)
    [first, _] = sorted((tmp_path / "validation").glob("*.json"), key=lambda p: p.stat().st_mtime)
    kept = json.loads(first.read_text())["result"]
    assert kept["arguments"] == {"dx": 0.08, **QUICKLY}
    assert kept["work"] > 0
    assert kept["seconds"] > 0
    assert np.shape(kept["chart"][2][0][1]) == (kept["measures"][1][1],)


def test_a_missed_bound_fails_the_command(planted, tmp_path, monkeypatch):
    command = ["study", "validation", "--output", str(tmp_path), "--scenes", "relaxation"]
    assert main(command) == 0
    bad = scenes.reference("relaxation")
    object.__setattr__(bad, "judge", lambda run: [Measure("planted error", 2.0, "", 1.0)])
    assert main([*command, "--again"]) == 1


def test_scenes_without_a_reference_are_refused(planted, tmp_path, capsys):
    output = ["--output", str(tmp_path)]
    assert main(["study", "validation", "--scenes", "dam_break", *output]) == 2
    assert "expected one of relaxation" in capsys.readouterr().err
    assert main(["study", "startup", "--again", *output]) == 2
    assert "only the studies validation and accuracy" in capsys.readouterr().err


def test_a_blow_up_fails_its_row_and_not_the_study(planted, tmp_path, monkeypatch, capsys):
    ran = Reference.run

    def run(self, sim, look):
        if sim.scene.dx == 0.08:
            raise RuntimeError("relaxation: blew up at t = 0 s")
        return ran(self, sim, look)

    monkeypatch.setattr(Reference, "run", run)
    found = rows(tmp_path)
    assert [row.quantity for row in found] == [
        "blow-ups", "planted error", "observations", "wall clock"
    ]  # fmt: skip
    assert not found[0].holds
    assert "blew up at t = 0 s" in capsys.readouterr().err


def test_a_run_to_a_blow_up_names_time_and_cause(planted):
    scene = scenes.make("relaxation", dx=0.08, diameter=0.3)
    violent = np.random.default_rng(0).normal(0.0, 1e5, np.shape(scene.x))
    with pytest.raises(RuntimeError, match=r"relaxation: blew up at t = .* cause"):
        scenes.reference("relaxation").run(Simulation(replace(scene, v=violent)))


def test_a_warning_is_a_row_that_fails(planted, tmp_path, monkeypatch):
    told = Warning("energy", 0.39, 0.05, 0.1, "39 % of the energy at stake is spurious")
    monkeypatch.setattr(Simulation, "warnings", (told,))
    found = [row for row in rows(tmp_path) if row.quantity == "warning: energy"]
    assert [(row.value, row.bound, row.holds) for row in found] == [(0.39, 0.05, False)] * 2
