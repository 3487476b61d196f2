import csv

import numpy as np
import pytest

from sph_gym import Simulation, scenes
from sph_gym.__main__ import main
from sph_gym.readings import Every, Readings
from sph_gym.solver import break_on
from sph_gym.solver.break_on import BreakOn
from sph_gym.solver.particle_log import ParticleLog

SCENE = ["run", "relaxation", "--set", "dx=0.08", "--seconds", "0.1"]
TANK = ["run", "hydrostatic_tank", "--set", "dx=0.08"]


def relaxation():
    return Simulation(scenes.make("relaxation", dx=0.08))


def test_every_step_of_some_particles_is_logged_and_written(tmp_path, capsys):
    table = tmp_path / "log.csv"
    log = ["--log", "rho,p", "--particles", "0,20", "--every", "1", "--csv", str(table)]
    assert main([*SCENE, *log]) == 0
    heading, *lines = capsys.readouterr().out.splitlines()
    assert "p #0 [Pa]  rho #20 [kg/m^3]" in heading
    rows = list(csv.reader(table.read_text().splitlines()))
    assert rows[0] == [
        "time [s]", "rho #0 [kg/m^3]", "p #0 [Pa]", "rho #20 [kg/m^3]", "p #20 [Pa]",
    ]  # fmt: skip
    values = np.array(rows[1:], float)
    sim = relaxation()
    np.testing.assert_allclose(values[0, 1:], [sim.rho[0], sim.p[0], sim.rho[20], sim.p[20]])
    steps = sum(sim.advance(t).n_substeps for t in (0.04, 0.04, 0.02))
    assert len(values) == len(lines) - 1 == 1 + steps
    np.testing.assert_allclose(values[-1, 1::2], sim.rho[[0, 20]], rtol=1e-9)


def test_a_log_does_not_change_the_run():
    plain, logged = relaxation(), relaxation()
    readings = Readings(logged, every=Every(2, "steps"), log=ParticleLog(["x"], [3]))
    assert readings.advance(0.05).n_substeps == plain.advance(0.05).n_substeps
    np.testing.assert_allclose(logged.x, plain.x, rtol=1e-12)


def test_names_without_particles_take_three_and_a_number_is_still_a_number(capsys):
    main([*SCENE, "--log", "v"])
    assert "v x #0 [m/s]  v y #0 [m/s]" in capsys.readouterr().out
    main([*SCENE, "--log", "1"])
    assert "rho/rho0 #0" in capsys.readouterr().out
    main([*SCENE, "--particles", "5"])
    assert "rho #5 [kg/m^3]" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("0.002", "s", (0.002, "s")),
        ("0.002s", "steps", (0.002, "s")),
        ("5", "steps", (5, "steps")),
        ("5steps", "s", (5, "steps")),
        ("1step", "s", (1, "steps")),
    ],
)
def test_distances_of_rows(text, unit, expected):
    assert Every.parse(text, unit) == expected


@pytest.mark.parametrize(("every", "counts"), [(1, [1] * 7), (3, [3, 3, 1]), (9, [7])])
def test_parts_are_whole_steps(every, counts):
    parts = Every(every, "steps").parts(0.07, 0.01)
    np.testing.assert_allclose(parts, np.array(counts) * 0.01)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--log", "rho,q"],
        ["--log", "2", "--particles", "1"],
        ["--log", "rho", "--particles", "1;2"],
        ["--log", "rho", "--particles", "-1"],
        ["--log", "rho", "--particles", "100000"],
        ["--log", "rho", "--every", "1.5"],
        ["--log", "rho", "--every", "0"],
        ["--log", "rho", "--every", "often"],
        ["--every", "0.1"],
        ["--break-on", "boredom"],
        ["--break-on", "escape"],
        ["--csv", "table.csv"],
    ],
    ids=" ".join,
)
def test_wrong_words_give_one_clear_line(arguments, capsys):
    assert main([*SCENE, *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("sph_gym: ")
    assert "expected" in error


def test_a_blow_up_prints_the_neighbourhood(capsys):
    assert main([*TANK, "--dt", "0.05", "--break-on", "nan"]) == 1
    lines = capsys.readouterr().out.splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith("break: "))
    assert "particle " in lines[start]
    assert "cause" in lines[start]
    assert lines[start + 1].split()[:3] == ["particle", "distance", "[m]"]
    assert " neighbours of particle " in "\n".join(lines[start:])


def test_the_run_stops_at_the_step_in_which_a_density_is_wrong(capsys, monkeypatch):
    start = Simulation(scenes.make("hydrostatic_tank", dx=0.08))
    densest = start.rho[: start.n_fluid].max() / start.scene.fluid.rho0
    # so that a sound fluid has an offender as soon as it is a little denser than at the start
    monkeypatch.setattr(break_on, "DENSEST", densest + 1e-6)
    assert main([*TANK, "--break-on", "density", "--log", "rho"]) == 1
    out = capsys.readouterr().out
    assert "link 'density': rho = " in out
    assert out.count("break: ") == 1
    assert "before the first step" not in out


def test_a_start_that_is_bad_is_told_before_the_first_step(capsys, monkeypatch):
    monkeypatch.setattr(break_on, "DENSEST", 0.999)
    assert main([*TANK, "--break-on", "density"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "before the first step, the start is bad already:"
    assert lines[2].startswith("break: t = 0 s, particle ")


def test_rows_end_with_the_break(monkeypatch):
    sim = relaxation()
    monkeypatch.setattr(break_on, "DENSEST", 0.5)
    condition = BreakOn(sim, ["density"])
    readings = Readings(sim, log=ParticleLog(["rho"], [0]), break_on=condition)
    assert readings.advance(0.04).n_substeps == 1
    assert readings.offender.link == "density"
    assert len(readings.rows) == 2


def test_a_particle_outside_its_walls_has_escaped():
    sim = Simulation(scenes.make("hydrostatic_tank", dx=0.08))
    condition = BreakOn(sim, ["nan", "density", "escape"])
    assert condition.find() is None
    sim.engine.fluid.y[:] -= 10.0
    found = condition.find()
    assert (found.link, found.quantity) == ("walls", "x")
    assert any(f"particle {found.particle}" in line for line in condition.describe(found))


def test_sound_runs_have_no_offender(capsys):
    assert main([*TANK, "--seconds", "0.1", "--break-on", "nan,density,escape"]) == 0
    assert "break" not in capsys.readouterr().out
