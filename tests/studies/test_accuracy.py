import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from sph_gym import Simulation, scenes
from sph_gym.__main__ import main
from sph_gym.recommend import settings
from sph_gym.recommend.runs import execute
from sph_gym.recommend.settings import build, nominal
from sph_gym.scenes.shared.refinement import RMS, refinement
from sph_gym.studies import accuracy
from sph_gym.studies.accuracy import analysis, plan, points, study
from sph_gym.studies.accuracy.points import Sampling, measure_point
from sph_gym.studies.backends import LOCAL, Backend
from tests.studies.test_jobs import run_here

DROP = replace(refinement("elliptical_drop"), sizes=(6, 8, 10), nominal=8)
SMALL = plan.StudyPlan(
    scenes=("elliptical_drop",), repeats=1,
    values={
        "width": (0.9,), "step": (1.5,), "sound": (0.5,), "controller": ("cfl", "tuned_cfl"),
    },
)  # fmt: skip


@pytest.fixture(autouse=True)
def steady_clock(monkeypatch):
    """A benchmark that takes no time."""
    monkeypatch.setattr(points, "rate", lambda: 1e6)
    monkeypatch.setattr(points, "PATIENCE", 0.0)
    monkeypatch.setattr(points, "AGREED", math.inf)


@pytest.fixture
def small(monkeypatch):
    """The study of one small drop."""
    monkeypatch.setattr(study, "FULL", SMALL)
    monkeypatch.setattr(study, "refinement", lambda name: DROP)


def drop(**changes):
    return nominal(DROP)._replace(**changes)


# --- Settings ------------------------------------------------------------------


@pytest.mark.parametrize("name", accuracy.names())
def test_every_refinement_series_fits_its_scene(name):
    case = refinement(name)
    assert scenes.reference(name) is not None
    changed = {argument for other in case.others for argument in other}
    assert {case.length, *case.arguments, *changed} <= set(scenes.parameters(name))
    # two other cases, or why there is none
    assert case.erratic or len(case.others) == 2 or case.single
    assert list(case.sizes) == sorted(case.sizes)
    assert case.nominal in case.sizes
    assert case.build(case.sizes[0]).dx == pytest.approx(case.metres() / case.sizes[0], rel=0.1)


def test_every_scene_with_a_reference_is_measured_but_those_at_rest_and_impacts():
    with_reference = {name for name in scenes.names() if scenes.reference(name) is not None}
    assert with_reference - set(accuracy.names()) == {
        "perturbed_lattice", "relaxation", "drop_impact", "wall_impact",
    }  # fmt: skip


def test_a_setting_is_what_the_scene_then_has(monkeypatch):
    # a start that needs no version of the solver: the step has a test of its own
    begun = []
    monkeypatch.setattr(
        settings,
        "Simulation",
        lambda *arguments, **_: begun.append(arguments) or SimpleNamespace(stable_dt=lambda: 0.02),
    )
    setting = drop(
        width=3.0, step=0.5, sound=0.5, kernel="cubic_spline", density="continuity",
        integrator="symplectic_euler", xsph=0.2,
    )  # fmt: skip
    scene, plain = build(DROP, setting), DROP.build(8)
    assert scene.h == pytest.approx(3 * plain.dx)
    assert scene.fluid.kernel == "cubic_spline"
    assert scene.effects.continuity
    assert scene.effects.xsph
    assert scene.integrator == "symplectic_euler"
    assert scene.controls.stiffness == pytest.approx(plain.fluid.stiffness(plain.fluid.c0) / 4)
    assert scene.controls.xsph == 0.2
    assert scene.controls.dt == 0.5 * 0.02
    [(start, dtype)] = begun
    assert replace(start, controls=scene.controls).to_dict() == scene.to_dict()
    assert start.controls == scene.controls._replace(dt=1.0)
    assert dtype == "float64"


def test_the_step_of_a_setting_is_a_share_of_the_stable_one():
    changes = {"kernel": "mueller", "integrator": "symplectic_euler"}
    scene = build(DROP, drop(width=3.0, step=0.5, sound=0.5, **changes))
    assert (scene.fluid.kernel, scene.integrator) == ("mueller", "symplectic_euler")
    assert scene.controls.stiffness == pytest.approx(scene.fluid.stiffness(scene.fluid.c0) / 4)
    still = Simulation(replace(scene, controls=scene.controls._replace(dt=1.0)), threads=1)
    assert scene.controls.dt == pytest.approx(0.5 * still.stable_dt())


def test_the_nominal_setting_is_the_scene_itself():
    scene, plain = build(DROP, nominal(DROP)), DROP.build(8)
    assert scene.controls == Simulation(plain, threads=1).controls._replace(xsph=0.0)
    assert (scene.h, scene.effects, scene.integrator) == (plain.h, plain.effects, plain.integrator)


@pytest.mark.slow
def test_summation_takes_the_diffusion_with_it():
    case = refinement("colliding_patches")
    assert nominal(case).density == "continuity"
    scene = build(case, nominal(case, 14)._replace(density="summation"))
    assert not scene.effects.continuity
    assert scene.effects.density_diffusion is None


# --- points ---------------------------------------------------------------------------------


def test_a_point_is_the_same_to_the_last_bit_when_it_is_run_again(tmp_path):
    first, second = (
        measure_point(DROP, "nominal", drop(), Sampling(tmp_path / place, 1)) for place in "ab"
    )
    assert first.error == second.error
    assert (first.interactions, first.substeps) == (second.interactions, second.substeps)
    assert first.key == second.key
    assert 0 < first.error < 0.2


def test_the_error_is_that_of_the_scene(tmp_path):
    reference = scenes.reference("elliptical_drop")
    sim = Simulation(build(DROP, drop()), threads=1)
    run = reference.run(sim)
    found = measure_point(DROP, "nominal", drop(), Sampling(tmp_path, 1))
    assert found.error == reference.judge(run)[0].value / 100
    assert found.seconds == pytest.approx(sim.scene.duration)


def test_an_error_over_all_frames_is_a_root_mean_square():
    case = replace(DROP, measure=RMS)
    errors = []
    reference = scenes.reference("elliptical_drop")
    sim = Simulation(build(case, drop()), threads=1)
    watched = replace(reference, observe=lambda sim: errors.append(reference.error(sim)) or {})
    watched.run(sim)
    assert execute(case, drop()).error == pytest.approx(np.sqrt(np.mean(np.square(errors))) / 100)


def test_the_record_says_all_that_the_error_depends_on(tmp_path):
    found = measure_point(DROP, "nominal", drop(), Sampling(tmp_path, 1))
    stored = json.loads((tmp_path / "points" / f"{found.key}.json").read_text())
    key, result = stored["key"], stored["result"]
    assert key == json.loads(json.dumps(points.key_of(DROP, drop(), 0)))
    assert key["setting"] == drop()._asdict()
    assert {"processor", "numba", "numpy", "python"} <= set(result["versions"])
    assert result["outcome"]["error"] == found.error
    assert "wall" not in result["outcome"]


def test_what_is_kept_is_not_run_again_and_times_only_if_asked_for(tmp_path, monkeypatch):
    first = measure_point(DROP, "nominal", drop(), Sampling(tmp_path, 2))
    assert first.runs == 2
    runs = []
    monkeypatch.setattr(points, "execute", lambda *a: runs.append(a) or execute(*a))
    assert measure_point(DROP, "nominal", drop(), Sampling(tmp_path, 2)) == first
    assert not runs
    again = measure_point(DROP, "nominal", drop(), Sampling(tmp_path, 2, True))
    assert len(runs) == 2
    assert again.error == first.error
    assert again.wall != first.wall


def test_an_interrupted_point_loses_only_the_run_in_hand(tmp_path, monkeypatch):
    calls = []

    def interrupted(*arguments):
        calls.append(arguments)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return execute(*arguments)

    monkeypatch.setattr(points, "execute", interrupted)
    with pytest.raises(KeyboardInterrupt):
        measure_point(DROP, "nominal", drop(), Sampling(tmp_path, 3))
    assert measure_point(DROP, "nominal", drop(), Sampling(tmp_path, 3)).runs == 3
    assert len(calls) == 4


def test_a_run_that_gives_another_error_is_counted(tmp_path):
    found = measure_point(DROP, "nominal", drop(), Sampling(tmp_path, 1))
    path = tmp_path / "points" / f"{found.key}.json"
    record = json.loads(path.read_text())
    record["result"]["outcome"]["error"] = float(np.nextafter(found.error, 1))
    path.write_text(json.dumps(record))
    assert measure_point(DROP, "nominal", drop(), Sampling(tmp_path, 1, True)).differing == 1


def test_a_blow_up_is_a_point_without_an_error(tmp_path):
    found = measure_point(DROP, "step", drop(step=40.0, sound=5.0), Sampling(tmp_path, 3))
    assert math.isnan(found.error)
    assert not found.good
    assert "blew up" in found.cause
    assert found.runs == 1


def test_the_fluid_is_watched_without_being_touched():
    outcome = execute(DROP, drop())
    soft = execute(DROP, drop(sound=0.3))
    assert 0 < outcome.compression < 0.02
    assert soft.compression > outcome.compression
    # twice as soft, and hardly another flow
    assert soft.mach / outcome.mach == pytest.approx(1 / 0.3, rel=0.2)


@pytest.mark.slow
def test_what_counts_is_run_as_often_as_a_median_needs(tmp_path):
    made = [
        measure_point(DROP, "resolution", nominal(DROP, n), Sampling(tmp_path, 1))
        for n in (6, 8, 10)
    ]
    lone = measure_point(DROP, "kernel", drop(kernel="spiky"), Sampling(tmp_path, 1))
    topped = study.repeat_counted(DROP, [*made, lone], Sampling(tmp_path, 3))
    assert [point.runs >= 3 for point in topped] == [True, True, True, False]
    assert [point.error for point in topped] == [point.error for point in [*made, lone]]


def test_interactions_are_neighbours_times_steps():
    outcome = execute(DROP, drop())
    at_start = Simulation(build(DROP, drop()), threads=1).neighbor_counts.sum()
    assert outcome.interactions == pytest.approx(at_start * outcome.substeps, rel=0.3)
    assert outcome.particles == len(DROP.build(8).x)


def test_halving_the_step_doubles_the_steps():
    one, half = (execute(DROP, drop(step=step)) for step in (1.0, 0.5))
    assert half.substeps == pytest.approx(2 * one.substeps, rel=0.15)


# --- controllers ----------------------------------------------------------------------------


def test_a_rule_sets_the_controls_of_every_frame():
    fixed, tuned = (execute(DROP, drop(controller=name)) for name in ("fixed", "tuned_cfl"))
    assert tuned.substeps < fixed.substeps
    assert tuned.error != fixed.error


def test_what_an_agent_did_is_played():
    scene = build(DROP, drop())
    dt, stiffness, xsph = scene.controls
    played = [[dt / 3, stiffness, xsph]]
    assert execute(DROP, drop(controller="ppo"), False, played).substeps == pytest.approx(
        3 * execute(DROP, drop()).substeps, rel=0.2
    )


def test_an_agent_that_blows_up_has_no_error(tmp_path, monkeypatch):
    def blow_up(name, scene):
        raise RuntimeError("ppo: blew up")

    monkeypatch.setattr(points, "play", blow_up)
    found = measure_point(DROP, "controller", drop(controller="ppo"), Sampling(tmp_path, 1))
    assert not found.good
    assert found.cause == "its agent blew up"
    start = measure_point(DROP, "nominal", drop(), Sampling(tmp_path, 2))
    rows = list(study.rows(DROP, analysis.at_usual_speed([start, found])))
    [blown] = [row for row in rows if row.quantity == "runs that blew up"]
    assert blown.value == 1
    timed = [row for row in rows if "time" in row.quantity and "cheapest" not in row.quantity]
    assert timed
    assert all(math.isfinite(row.value) for row in timed)
    noisy = replace(start, spread=2.0)
    kept, broken = (
        next(row for row in study.rows(DROP, [run]) if row.quantity.startswith("spread of"))
        for run in (replace(start, spread=0.1), noisy)
    )
    assert kept.holds
    assert not broken.holds


# --- the study ------------------------------------------------------------------------------


def test_the_study_writes_rows_tables_and_pictures_and_goes_on_where_it_was(
    small, tmp_path, monkeypatch
):
    *rows, duration = study.measure(False, tmp_path)
    assert duration.quantity == "duration of the study"
    assert 0 < duration.value < duration.bound == 5400
    named = {row.quantity for row in rows}
    assert {
        "order of convergence",
        "elasticity over time: resolution",
        "measured / promised error",
    } <= named
    [differing] = [row for row in rows if row.quantity == "runs that differed when repeated"]
    assert (differing.value, differing.bound) == (0.0, 0.0)
    folder = tmp_path / "accuracy"
    table = pd.read_csv(folder / "points.csv")
    again = pd.read_parquet(folder / "points.parquet")
    assert len(table) == len(again) == next(row.value for row in rows if row.quantity == "runs")
    assert {"error", "wall", "interactions", "particles", "compression", "mach"} <= set(table)
    promised = pd.read_csv(folder / "promises.csv")
    for key in [*table["key"], *promised["key"]]:
        assert (folder / "points" / f"{key}.json").exists()
    assert (folder / "found" / "gains.csv").exists()
    assert "| elliptical drop |" in (folder / "found" / "cheapest.md").read_text()
    assert table["key"].is_unique
    gains = pd.read_csv(folder / "elliptical_drop_gains.csv")
    assert set(gains["knob"]) == {"resolution", "width", "step", "sound", "controller"}
    for name in ("elliptical_drop", "summary"):
        assert (folder / f"{name}.png").stat().st_size > 20_000
    monkeypatch.setattr(points, "execute", lambda *a: pytest.fail("run again"))
    assert list(study.measure(False, tmp_path))[:-1] == rows


def check_backend(backend, plan, folder, monkeypatch):
    """All points of the drop are the same from a backend as from this process, times apart."""
    expected = study.collect(DROP, plan, Sampling(folder / "here", 1))
    there = Sampling(folder / "there", 1)
    study.measure_ahead([DROP], plan, there, backend)
    monkeypatch.setattr(points, "execute", lambda *a: pytest.fail("run again"))
    found = study.collect(DROP, plan, there)
    assert all(point.wall > 0 for point in found)
    names = ("key", "knob", "setting", "error", "interactions", "substeps")
    for name in names:
        assert [getattr(p, name) for p in found] == [getattr(p, name) for p in expected]


def test_points_and_series_can_be_measured_on_a_backend(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "run_jobs", run_here)
    check_backend(LOCAL, SMALL, tmp_path, monkeypatch)


@pytest.mark.slow
def test_points_are_the_same_from_workers(tmp_path, monkeypatch):
    check_backend(Backend(workers=2), SMALL._replace(chain=False), tmp_path, monkeypatch)


def test_scenes_and_options_are_checked(tmp_path, capsys):
    command = ["study", "accuracy", "--output", str(tmp_path)]
    assert main([*command, "--scenes", "lake"]) == 2
    assert "expected one of elliptical_drop" in capsys.readouterr().err
    assert main([*command, "--peers", str(tmp_path)]) == 2
    assert "pysph_accuracy.py" in capsys.readouterr().err
