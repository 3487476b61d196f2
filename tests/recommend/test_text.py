import json
import math
import subprocess
import sys

import pytest

from sph_gym import recommend, scenes
from sph_gym.__main__ import main
from sph_gym.recommend import advice, published
from sph_gym.recommend.runs import execute
from sph_gym.recommend.tables import write
from sph_gym.scenes.shared.refinement import names, refinement
from tests.recommend.made_up import DROP, SPEED, advise, samples


@pytest.mark.parametrize("text", ["10s", "10", " 10 S", "10000ms"])
def test_budgets_are_read(text):
    assert recommend.parse_budget(text) == pytest.approx(10.0)
    assert recommend.parse_budget("2min") == 120.0
    assert recommend.parse_budget("1h") == 3600.0


@pytest.mark.parametrize("text", ["", "s", "ten", "-1s", "0s", "nan", "inf", "10 parsecs"])
def test_budgets_that_are_none_are_refused(text):
    with pytest.raises(ValueError, match=r"budget: expected a time above 0 such as 10s.*got"):
        recommend.parse_budget(text)


@pytest.mark.parametrize("text", ["0.01", "1%", " 1 % ", "1e-2"])
def test_errors_are_read(text):
    assert recommend.parse_error(text) == pytest.approx(0.01)


@pytest.mark.parametrize("text", ["", "%", "one", "-1%", "0", "nan%", "inf"])
def test_errors_that_are_none_are_refused(text):
    with pytest.raises(ValueError, match=r"error: expected a share above 0 such as 0\.01.*got"):
        recommend.parse_error(text)


def test_one_without_a_sign_is_a_percent_that_lacks_it():
    with pytest.raises(ValueError, match=r"did you mean 1%\?"):
        recommend.parse_error("1")
    assert recommend.parse_error("100%") == 1.0


def test_what_is_told_can_be_set(table):
    told = dict(recommend.describe(advise(table, error=0.01)))
    assert told["dx"].startswith("0.05 m (radius / 20)")
    assert told["h / dx"] == "3.4"
    assert told["precision"] == "float32"
    assert told["expected error"] == "about 1 %, at most 1 % of the exact semi-axis"
    assert told["epsilon"] == "no XSPH"


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"controller": "tuned_cfl"},
        pytest.param({"density": "continuity"}, marks=pytest.mark.slow),
    ],
)
def test_the_program_runs_what_was_recommended(tmp_path, changes):
    path = tmp_path / "lines.csv"
    rows = samples(sizes=(6, 8, 10), dtype="float32", step=1.5, **changes)
    write(rows, path, "made up")
    found = recommend.advise(DROP.scene, error=0.2 / 8, table=path, speed=SPEED)
    variables = {}
    exec(recommend.program(found), variables)
    error = scenes.reference(DROP.scene).error(variables["sim"]) / 100
    assert error == execute(DROP, found.choice.setting).error


@pytest.mark.parametrize(
    ("tried", "said"),
    [(None, None), (math.nan, "not in this case"), (0.012, "in this case, with an error of 1.2 %")],
)
def test_what_was_tried_is_told(table, tried, said):
    told = dict(recommend.describe(advise(table, error=0.01)._replace(tried=tried)))
    assert said is None or told["tried"].startswith(said)
    assert ("tried" in told) == (said is not None)


def test_what_is_left_of_a_budget_is_told(table):
    told = dict(recommend.describe(advise(table, budget=10.0)))
    assert told["budget"] == "uses 2.1 of 10 s: nothing finer was measured"
    told = dict(recommend.describe(advise(table, budget=1.0)))
    assert told["budget"].endswith("of 1 s")
    assert "budget" not in dict(recommend.describe(advise(table, error=0.01)))


def test_the_program_of_a_run_that_blows_up_ends(tmp_path):
    path = tmp_path / "lines.csv"
    write(samples(sizes=(6, 8, 10)), path, "made up")
    found = recommend.advise(DROP.scene, error=0.9, table=path, speed=SPEED)
    bad = found.choice.setting._replace(step=40.0, sound=5.0)
    found = found._replace(choice=found.choice._replace(setting=bad))
    with pytest.raises(SystemExit, match=r"blew up at t = "):
        exec(recommend.program(found), {})


def test_the_program_takes_no_step_of_a_rounding_error(tmp_path, capsys):
    path = tmp_path / "lines.csv"
    write(samples(sizes=(6, 8, 10)), path, "made up")
    found = recommend.advise(DROP.scene, error=0.9, table=path, speed=SPEED)
    text = recommend.program(found).replace("    report = sim.advance(", "    report = advance(")
    taken, variables = [], {}

    def advance(seconds):
        taken.append(seconds)
        return variables["sim"].advance(seconds - 1e-17 if len(taken) == 1 else seconds)

    variables["advance"] = advance
    exec(text, variables)
    assert min(taken) > 1e-3 * max(taken)
    assert "error now: " in capsys.readouterr().out


@pytest.mark.parametrize("scene", names())
def test_what_is_known_of_a_scene_is_told(scene, capsys):
    assert main(["recommend", scene]) == 0
    printed = capsys.readouterr().out
    assert refinement(scene).note in printed
    targets = [row["target"] for row in published.read("cheapest", scene)]
    assert targets == ["0.05", "0.02", "0.01", "0.005"]
    for share in ("5 %", "2 %", "1 %", "0.5 %"):
        assert f"  {share}" in printed
    if refinement(scene).erratic:
        assert printed.count("not reached") == 4
    assert "resolution" in printed


def test_the_command_prints_it(table, capsys, monkeypatch):
    monkeypatch.setattr(advice, "rate", lambda seconds: SPEED)
    command = ["recommend", "elliptical_drop", "--table", str(table)]
    assert main([*command, "--error", "0.01"]) == 0
    printed = capsys.readouterr().out
    for name in ("dx:", "h / dx:", "dt:", "stiffness:", "epsilon:", "kernel:", "precision:"):
        assert name in printed
    assert "expected error: about 1 %, at most 1 %" in printed
    assert main([*command, "--error", "0.01", "--json", "-"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["promised_error"] == pytest.approx(0.01)
    assert data["arguments"]["dx"] == pytest.approx(0.05)
    assert data["controls"]["dt"] > 0
    assert main([*command, "--json", "-"]) == 2
    capsys.readouterr()
    assert main([*command, "--budget", "1s"]) == 0
    assert "expected time:" in capsys.readouterr().out
    for wrong in (["--error", "1e-9"], ["--budget", "soon"], ["--error", "0.01", "--set", "dx=1"]):
        assert main([*command, *wrong]) == 2
        assert "expected" in capsys.readouterr().err


def test_recommendations_need_no_extra():
    """Neither the import nor the commands use what comes with the extra "studies"."""
    code = """
import sys
for name in ("h5py", "jinja2", "matplotlib", "pandas", "pyarrow", "rich", "scipy", "tyro"):
    sys.modules[name] = None
from sph_gym.__main__ import main
assert main(["recommend", "elliptical_drop"]) == 0
assert main(["recommend", "elliptical_drop", "--error", "1%", "--set", "rate=60"]) == 0
assert not [name for name in sys.modules if name.startswith("sph_gym.studies")]
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "tried:" in done.stdout
