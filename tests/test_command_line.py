import csv
import importlib
import inspect
import json
import os
import shlex
import subprocess
import sys

import numpy as np
import pytest

from sph_gym import Simulation, studies, trajectory
from sph_gym.__main__ import main
from sph_gym.command_line import INTERRUPTED, PIPE_CLOSED
from sph_gym.command_line.parser import FAILED, WRONG
from sph_gym.extras import progress_bar
from sph_gym.readings import Readings
from sph_gym.scenes import droplet
from sph_gym.solver.warnings import Warning
from tests.networks import tiny

RELAXATION = ["run", "relaxation", "--set", "dx=0.08", "--seconds", "0.1"]


def test_run_logs_densities_and_pressures(capsys):
    assert main(["run", "relaxation", "--set", "dx=0.08", "--seconds", "0.1", "--log", "2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "rho/rho0 #0" in lines[0]
    assert len(lines) == 1 + 3


def test_every_assignment_counts_and_words_are_values(monkeypatch):
    made = []
    monkeypatch.setattr(
        "sph_gym.run.run", lambda sim, *rest, **options: made.append(sim.scene) or 0
    )
    command = ["run", "droplet", "--set", "dx=0.04", "side=1", "--set", "shape=ellipse"]
    assert main([*command, "--set", "dx=0.05"]) == 0
    assert made[0].dx == 0.05
    assert not droplet.is_square(made[0])


def test_run_reads_gauges(tmp_path, capsys):
    table = tmp_path / "gauges.csv"
    gauges = ["--gauge", "P1=pressure:0.2,0.1", "--gauge", "velocity:0.2,0.1"]
    command = ["run", "relaxation", "--set", "dx=0.08", "--seconds", "0.1", *gauges]
    assert main([*command, "--gauges", str(table), "--every", "0.01"]) == 0
    heading, *lines = capsys.readouterr().out.splitlines()
    assert "P1 [Pa]  velocity:0.2 0.1 x [m/s]" in heading
    assert "rho/rho0" not in heading
    rows = list(csv.reader(table.read_text().splitlines()))
    assert rows[0] == [
        "time [s]", "P1 [Pa]", "velocity:0.2 0.1 x [m/s]", "velocity:0.2 0.1 y [m/s]",
    ]  # fmt: skip
    values = np.array(rows[1:], float)
    assert len(values) >= 11
    assert values[-1, 0] == pytest.approx(0.1)
    assert np.diff(values[:, 0]).max() <= 0.01 + 1e-12
    assert float(lines[-2].split()[-3]) == pytest.approx(values[-1, 1], rel=1e-3, abs=1e-3)


def test_run_reports_a_blowup(capsys):
    status = main(["run", "hydrostatic_tank", "--set", "dx=0.08", "--dt", "0.05"])
    assert status == 1
    assert "the run blew up: the time step was too long (cause cfl)" in capsys.readouterr().out


def test_brute_force_gives_the_same_log(capsys):
    logs = []
    for neighbors in ("grid", "brute"):
        main(
            ["run", "relaxation", "--set", "dx=0.08", "--seconds", "0.1", "--neighbors", neighbors]
        )
        logs.append(capsys.readouterr().out)
    assert logs[0] == logs[1]


def test_a_video_is_written(tmp_path):
    path = tmp_path / "film.gif"
    assert (
        main(["run", "relaxation", "--set", "dx=0.08", "--seconds", "0.1", "--video", str(path)])
        == 0
    )
    assert path.stat().st_size > 1000


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "lake"],
        ["run", "relaxation", "--set", "dx"],
        ["run", "relaxation", "--set", "depth=1"],
        ["run", "relaxation", "--seconds", "-1"],
        ["run", "relaxation", "--dt", "0"],
        ["run", "relaxation", "--dtype", "float16"],
        ["run", "relaxation", "--color", "smell"],
        ["run", "relaxation", "--arrows"],
        ["run", "relaxation", "--video", "film.avi"],
        ["run", "relaxation", "--save", "run.csv"],
        ["run", "relaxation", "--gauge", "pressure"],
        ["run", "relaxation", "--gauge", "force:right"],
        ["run", "relaxation", "--gauges", "nowhere.csv"],
        ["run", "relaxation", "--gauge", "level:0.1", "--every", "0"],
        ["run", "droplet", "--set", "shape=star"],
        ["run", "relaxation", "--set", "dx=small"],
        ["run", "relaxation", "--set", "dx=1e-60", "diameter=1e-59"],
        ["run", "dam_break", "--set", "dx=1e-6"],
        ["run", "dam_break", "--set", "tank=1e300"],
        ["run", "drop_impact", "--set", "width=1e300"],
        ["run", "elliptical_drop", "--set", "dx=1e-9"],
        ["run", "hydrostatic_tank", "--set", "gravity=1e300"],
        ["run", "standing_wave", "--set", "gravity=1e308"],
        ["study", "weather"],
    ],
    ids=" ".join,
)
def test_wrong_words_give_one_clear_line(arguments, capsys):
    assert main(arguments) == 2
    out, error = capsys.readouterr()
    assert error.startswith("sph_gym: ")
    assert "expected" in error
    # nothing was run before
    assert not out


def test_an_interrupted_run_tells_what_it_has_written(tmp_path, capsys, monkeypatch):
    real, frames = Readings.advance, []

    def advance(self, seconds):
        frames.append(seconds)
        if len(frames) > 2:
            raise KeyboardInterrupt
        return real(self, seconds)

    monkeypatch.setattr(Readings, "advance", advance)
    monkeypatch.chdir(tmp_path)
    words = "--gauge level:0 --gauges levels.csv --save run.npz"
    assert main(["run", "relaxation", "--set", "dx=0.08", *words.split()]) == INTERRUPTED
    assert capsys.readouterr().out.endswith("table: levels.csv\ntrajectory: run.npz\n")
    assert len(trajectory.read("run.npz").times) == 3
    assert len((tmp_path / "levels.csv").read_text().splitlines()) >= 3


@pytest.mark.parametrize("arguments", [["doctor", "--list"], ["run", "--help"]], ids=" ".join)
def test_a_closed_pipe_is_no_fault(arguments):
    command = [sys.executable, "-m", "sph_gym", *arguments]
    # argparse itself swallows what fails at once
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, env=buffered, **pipes) as process:
        # before anything is printed, so that the very first write fails
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait() == PIPE_CLOSED


def test_without_any_output_a_command_still_runs():
    command = f"{shlex.quote(sys.executable)} -m sph_gym doctor --list >&-"
    done = subprocess.run(["sh", "-c", command], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize("name", studies.STUDIES)
def test_the_list_says_what_every_study_takes(name):
    study = importlib.import_module(f"sph_gym.studies.{name}")
    _, *takes = inspect.signature(study.measure).parameters
    assert sorted(takes) == sorted(studies.STUDIES[name])
    assert hasattr(study, "names") == ("chosen" in takes)


def test_run_tells_each_warning_once_and_all_at_the_end(capsys, monkeypatch):
    def warnings(sim):
        found = (Warning("start", 0.3, 0.9, 0.0, "mean distance 0.3 dx: expect a burst"),)
        if sim.time < 0.05:
            return found
        late = Warning("energy", sim.time, 0.05, 0.05, f"{sim.time:g} of the energy is spurious")
        return (*found, late)

    monkeypatch.setattr(Simulation, "warnings", property(warnings))
    assert main(["run", "relaxation", "--set", "dx=0.1", "--seconds", "0.2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "warning: mean distance 0.3 dx: expect a burst"
    assert [line.split(":")[0] for line in lines].count("warning") == 2
    assert lines[-1] == "warnings: start 0.3 (limit 0.9), energy 0.2 (limit 0.05)"


def test_json_is_all_that_a_program_reads(capsys):
    assert main([*RELAXATION, "--gauge", "level:0", "--json", "-"]) == 0
    printed = capsys.readouterr()
    outcome = json.loads(printed.out)
    assert outcome["scene"] == "relaxation"
    assert outcome["time"] == pytest.approx(0.1)
    assert outcome["n_substeps"] >= 3
    assert not outcome["diverged"]
    assert set(outcome["controls"]) == {"dt", "stiffness", "xsph"}
    assert [*outcome["readings"]] == ["level:0 [m]"]
    assert "level:0 [m]" in printed.err


def test_json_tells_what_broke(tmp_path):
    path = tmp_path / "outcome.json"
    command = ["run", "hydrostatic_tank", "--set", "dx=0.08", "--dt", "0.05", "--json", str(path)]
    assert main(command) == FAILED
    outcome = json.loads(path.read_text())
    assert outcome["diverged"]
    assert outcome["cause"] == "cfl"


def test_a_diagnosis_is_printed_as_json(capsys):
    assert main(["doctor", "--fault", "attracts", "--json", "-"]) == FAILED
    printed = capsys.readouterr()
    assert json.loads(printed.out)["link"] == "force"
    assert "force" in printed.err


def steered(capsys, *words):
    """Return the outcome of a run."""
    assert main([*RELAXATION, *words, "--json", "-"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_controller_steers_a_run(tmp_path, capsys):
    tiny(seed=5).save(tmp_path / "n.npz")
    plain = steered(capsys)
    assert steered(capsys, "--controller", "default")["controls"] == plain["controls"]
    tuned, network = (
        steered(capsys, "--controller", name) for name in ("tuned_cfl", str(tmp_path / "n.npz"))
    )
    found = [outcome["controls"]["stiffness"] for outcome in (plain, tuned, network)]
    assert len(set(found)) == 3
    assert network["controller"].endswith("n.npz")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--controller", "ppoo"], "sph_gym: --controller: expected one of default, "),
        (["--dt", "-1"], "sph_gym: --dt: expected a number above 0"),
        (["--log", "rho", "--particles", "9999"], "sph_gym: --particles: expected indices below"),
        (["--controller", "none.npz"], "path: none.npz is no exported network"),
        (["--controller", "cfl", "--dt", "1e-3"], "--controller: expected no --dt beside it"),
    ],
)
def test_what_is_wrong_with_an_option_is_told_by_its_name(words, message, capsys):
    assert main([*RELAXATION, *words]) == WRONG
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("is_terminal", [True, False])
def test_progress_is_shown_on_a_terminal_only(is_terminal, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: is_terminal)
    with progress_bar(3) as bar:
        assert bar.disable != is_terminal
