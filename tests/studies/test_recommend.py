import math
from dataclasses import replace

import numpy as np
import pytest

from sph_gym import scenes
from sph_gym.__main__ import main
from sph_gym.studies.accuracy import asking, names, recommend, telling
from sph_gym.studies.accuracy import lines as measured
from sph_gym.studies.accuracy.problems import problem
from sph_gym.studies.accuracy.running import execute
from sph_gym.studies.accuracy.samples import Sample, read, shipped, write
from sph_gym.studies.accuracy.settings import nominal

DROP = problem("elliptical_drop")
SPEED = 1e6


def samples(factor=1.0, order=1.0, sizes=(10, 20, 40), **changes):
    """A line whose error goes as dx^order and whose effort as dx^-3."""
    return [
        Sample(
            DROP.scene, nominal(DROP, n)._replace(**changes), 0.2 * n**-order, factor * 100.0 * n**3
        )
        for n in sizes
    ]


@pytest.fixture
def table(tmp_path):
    """Two lines: one that takes a third of the other's time."""
    path = tmp_path / "lines.csv"
    write([*samples(), *samples(1 / 3, dtype="float32")], path, "made up")
    return path


def advise(table, **wanted):
    return recommend.advise(DROP.scene, table=table, speed=SPEED, **wanted)


def test_the_cheapest_line_at_the_coarsest_resolution_that_does(table):
    advice = advise(table, error=0.2 / 27.5)
    assert advice.choice.setting == nominal(DROP, 28)._replace(dtype="float32")
    assert advice.choice.error == pytest.approx(0.2 / 28)
    assert advice.seconds == pytest.approx(100 * 28**3 / 3 / SPEED)


def test_the_budget_is_the_other_way_round(table):
    advice = advise(table, error=0.2 / 27.5)
    back = advise(table, budget=1.001 * advice.seconds)
    assert back.choice.setting == advice.choice.setting
    assert advise(table, budget=1e9).choice.setting.across == 40


def test_more_error_than_was_measured_takes_the_coarsest(table):
    assert advise(table, error=0.9).choice.setting.across == 10


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"error": 1e-4}, "error: expected at least 0.005.* 0.005 to 0.02 was measured"),
        ({"budget": 1e-9}, "budget: expected at least .* s was measured"),
        ({"error": 0.0}, "error: expected a number above 0"),
        ({"error": math.nan}, "error: expected a finite number"),
        ({"budget": -1.0}, "budget: expected a number above 0"),
        ({}, "expected one of the two"),
        ({"error": 0.01, "budget": 1.0}, "expected one of the two"),
        ({"error": 0.01, "arguments": {"dx": 0.1}}, "expected one of radius, rate"),
        ({"error": 0.01, "arguments": {"depth": 0.1}}, "expected one of radius, rate"),
        ({"error": 0.01, "arguments": {"radius": "abc"}}, "radius: expected a number, got 'abc'"),
        ({"error": 0.01, "arguments": {"radius": 0}}, "radius: expected a number above 0"),
    ],
)
def test_wrong_wishes_are_told_what_was_expected(table, wanted, said):
    with pytest.raises(ValueError, match=said):
        advise(table, **wanted)


@pytest.mark.parametrize("text", ["10s", "10", " 10 S", "10000ms"])
def test_budgets_are_read(text):
    assert asking.parse_budget(text) == pytest.approx(10.0)
    assert asking.parse_budget("2min") == 120.0
    assert asking.parse_budget("1h") == 3600.0


@pytest.mark.parametrize("text", ["", "s", "ten", "-1s", "0s", "nan", "inf", "10 parsecs"])
def test_budgets_that_are_none_are_refused(text):
    with pytest.raises(ValueError, match=r"budget: expected a time above 0 such as 10s.*got"):
        asking.parse_budget(text)


def test_a_lucky_run_promises_nothing():
    errors = np.array([0.08, 0.001, 0.02])
    assert measured.envelope(errors).tolist() == [0.08, 0.02, 0.02]
    assert measured.doubt(np.array([10.0, 20.0, 40.0]), errors) == 1.0


def test_an_unlucky_run_raises_the_promise():
    across = np.array([10.0, 20.0, 40.0])
    assert measured.doubt(across, np.array([0.04, 0.02, 0.01])) == pytest.approx(1.0)
    assert measured.doubt(across, np.array([0.04, 0.06, 0.01])) == pytest.approx(3.0)


def test_lines_of_which_little_is_known_are_not_offered():
    blown = samples(0.1, kernel="spiky")
    blown[1] = blown[1]._replace(error=math.nan)
    short = samples(0.1, sizes=(10, 20), kernel="cubic_spline")
    coarse = samples(0.1, sizes=(10, 20, 28), integrator="symplectic_euler")
    bold = samples(0.1, step=2.0)
    agent = samples(0.1, controller="lookahead")
    lines = measured.fit([*samples(), *blown, *short, *coarse, *bold, *agent])
    assert [line.setting for line in lines] == [nominal(DROP).line]


def test_promises_fall_with_resolution(table):
    for line in measured.fit(read(DROP.scene, table)):
        errors = [choice.promised for choice in line.choices()]
        efforts = [choice.effort for choice in line.choices()]
        assert errors == sorted(errors, reverse=True)
        assert efforts == sorted(efforts)


def test_what_is_expected_is_less_than_what_is_promised(tmp_path):
    path = tmp_path / "lines.csv"
    errors = (0.04, 0.06, 0.01)
    made = [sample._replace(error=e) for sample, e in zip(samples(), errors, strict=True)]
    write(made, path, "made up")
    advice = advise(path, error=0.19)
    assert (advice.choice.error, advice.choice.promised) == pytest.approx((0.06, 0.18))
    told = dict(telling.describe(advice))
    assert told["expected error"].startswith("about 6 %, at most 18 % of")
    with pytest.raises(ValueError, match=r"expected at least 0\.03"):
        advise(path, error=0.02)


def test_what_is_told_can_be_set(table):
    told = dict(telling.describe(advise(table, error=0.01)))
    assert told["dx"].startswith("0.05 m (radius / 20)")
    assert told["h / dx"] == "3.4"
    assert told["precision"] == "float32"
    assert told["expected error"] == "about 1 %, at most 1 % of the exact semi-axis"
    assert told["epsilon"] == "no XSPH"


@pytest.mark.parametrize("changes", [{}, {"controller": "tuned_cfl"}, {"density": "continuity"}])
def test_the_program_runs_what_was_recommended(tmp_path, changes):
    path = tmp_path / "lines.csv"
    write(samples(sizes=(6, 8, 10), dtype="float32", step=1.5, **changes), path, "made up")
    advice = recommend.advise(DROP.scene, error=0.2 / 8, table=path, speed=SPEED)
    variables = {}
    exec(telling.program(advice), variables)
    found = scenes.reference(DROP.scene).error(variables["sim"]) / 100
    assert found == execute(DROP, advice.choice.setting).error


def test_another_case_corrects_what_is_promised():
    [line] = measured.fit(samples())
    probed = []

    def probe(setting):
        probed.append(setting.across)
        return 3 * 0.02, 2 * 100.0 * 10**3

    better = recommend.corrected(line, probe)
    assert probed == [10]
    assert better.promised == pytest.approx(3 * line.promised)
    assert better.error == pytest.approx(3 * line.error)
    assert better.effort == pytest.approx(2 * line.effort)
    lucky = recommend.corrected(line, lambda setting: (1e-4, line.effort[0]))
    assert lucky.promised == pytest.approx(line.promised)
    assert recommend.corrected(line, lambda setting: (math.nan, 1.0)) is None


def test_the_choice_is_made_anew_until_it_is_corrected():
    lines = measured.fit([*samples(), *samples(1 / 3, dtype="float32")])

    def probe(setting):
        return (0.2 if setting.dtype == "float32" else 0.02), 100.0 * 10**3

    def choose(lines):
        return recommend.for_error(lines, 0.01)

    choice, _ = recommend.settle(lines, choose, probe)
    assert choice.setting == nominal(DROP, 20)
    assert recommend.settle(lines, choose, lambda setting: (math.nan, 1.0)) == (None, [])


def test_a_case_without_a_reference_is_refused():
    column = problem("dam_break")
    flat = replace(column, arguments=column.arguments | {"height": 0.6})
    with pytest.raises(ValueError, match="dam_break: expected arguments for which there is a ref"):
        execute(flat, nominal(flat, 10))


def test_no_table_is_told_of(tmp_path, table):
    with pytest.raises(ValueError, match="table: expected a file of samples, got"):
        advise(tmp_path / "missing.csv", error=0.01)
    with pytest.raises(ValueError, match="scene: expected one of"):
        recommend.advise("lake", error=0.01)
    with pytest.raises(ValueError, match="expected a line of 3 resolutions of couette"):
        recommend.advise("couette", error=0.01, table=table)


HEAD = "scene,across,width,step,sound,kernel,density,dtype,integrator,xsph,controller,error,effort"
ROW = "elliptical_drop,10,3.4,1.0,1.0,wendland_c2,summation,float64,symplectic_euler,0,fixed,0.1,9"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\xff\xfe\x00\x01", "codec can't decode"),
        (b"a,b\n1,2\n", "expected columns scene, across"),
        (HEAD.replace("effort", "work").encode(), "expected columns effort, got"),
        (b"", "expected columns"),
        (HEAD.encode(), "expected rows below its columns, got none"),
        (f"{HEAD}\n{ROW.replace(',10,', ',0,')}".encode(), "across: expected a number above 0"),
        (f"{HEAD}\n{ROW.replace(',10,', ',,')}".encode(), "across: expected a number, got ''"),
        (f"{HEAD}\n{ROW.replace(',0.1,', ',-1,')}".encode(), "error: expected a share"),
        (f"{HEAD}\n{ROW.replace(',9', ',inf')}".encode(), "effort: expected a finite number"),
        (f"{HEAD}\nelliptical_drop,10".encode(), "width: expected a number, got None"),
    ],
)
def test_a_table_that_is_none_is_told_of_with_its_name(tmp_path, content, said):
    path = tmp_path / "other.csv"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=rf"other\.csv is no table of samples: .*{said}"):
        advise(path, error=0.01)


@pytest.mark.parametrize("text", ["0.01", "1%", " 1 % ", "1e-2"])
def test_errors_are_read(text):
    assert asking.parse_error(text) == pytest.approx(0.01)


@pytest.mark.parametrize("text", ["", "%", "one", "-1%", "0", "nan%", "inf"])
def test_errors_that_are_none_are_refused(text):
    with pytest.raises(ValueError, match=r"error: expected a share above 0 such as 0\.01.*got"):
        asking.parse_error(text)


def test_more_than_everything_is_asked_back(table):
    for ask in (lambda: asking.parse_error("5"), lambda: advise(table, error=5.0)):
        with pytest.raises(ValueError, match=r"at most 1, got 5: did you mean 0\.05\?"):
            ask()


def scattered(*changes):
    """Samples of the drop whose own errors hardly depend on dx, and a lucky line."""
    own = [s._replace(error=e) for s, e in zip(samples(), (0.039, 0.035, 0.036), strict=True)]
    lucky = [s._replace(error=0.03) for s in samples(0.5, kernel="mueller")]
    return [*own, *lucky]


def test_scatter_is_not_sold(tmp_path):
    path = tmp_path / "lines.csv"
    write(scattered(), path, "made up")
    rich, poor = advise(path, budget=1e9), advise(path, error=0.05)
    assert rich.choice == poor.choice
    assert rich.choice.setting.across == 10
    assert (rich.choice.error, rich.choice.promised) == pytest.approx((0.039, 0.039))
    assert "more time buys nothing" in dict(telling.describe(rich))["caution"]
    with pytest.raises(ValueError, match=r"expected at least 0\.039.*within their scatter"):
        advise(path, error=0.034)


def test_errors_that_fall_come_without_caution(table):
    assert measured.scatter(samples()) == 0.0
    assert "caution" not in dict(telling.describe(advise(table, error=0.01)))


def test_the_program_of_a_run_that_blows_up_ends(tmp_path):
    path = tmp_path / "lines.csv"
    write(samples(sizes=(6, 8, 10)), path, "made up")
    advice = recommend.advise(DROP.scene, error=0.9, table=path, speed=SPEED)
    bad = advice.choice.setting._replace(step=40.0, sound=5.0)
    advice = advice._replace(choice=advice.choice._replace(setting=bad))
    with pytest.raises(SystemExit, match=r"blew up at t = "):
        exec(telling.program(advice), {})


def test_the_program_takes_no_step_of_a_rounding_error(tmp_path, capsys):
    path = tmp_path / "lines.csv"
    write(samples(sizes=(6, 8, 10)), path, "made up")
    advice = recommend.advise(DROP.scene, error=0.9, table=path, speed=SPEED)
    text = telling.program(advice).replace("    report = sim.advance(", "    report = advance(")
    taken, known = [], {}

    def advance(seconds):
        taken.append(seconds)
        return known["sim"].advance(seconds - 1e-17 if len(taken) == 1 else seconds)

    known["advance"] = advance
    exec(text, known)
    assert min(taken) > 1e-3 * max(taken)
    assert "error now: " in capsys.readouterr().out


@pytest.mark.parametrize("scene", shipped())
def test_what_is_shipped_gives_advice(scene):
    assert scene in names()
    lines = measured.fit(read(scene))
    best = min(float(line.promised[-1]) for line in lines)
    advice = recommend.advise(scene, error=1.01 * best, speed=SPEED)
    assert advice.choice.promised <= 1.01 * best
    assert advice.seconds > 0
    assert dict(telling.describe(advice))["kernel"] == advice.choice.setting.kernel


def test_all_scenes_that_can_be_recommended_for_are_shipped():
    assert set(shipped()) == {name for name in names() if not problem(name).erratic}


def test_nothing_is_recommended_for_what_is_erratic():
    with pytest.raises(ValueError, match="scene: expected one whose errors fall"):
        recommend.advise("hydrostatic_tank", error=0.01)


@pytest.mark.parametrize("scene", shipped())
def test_efforts_that_are_shipped_rise_with_resolution(scene):
    for line in measured.fit(read(scene)):
        # a machine that is shared is slower now and then
        assert np.all(line.effort[1:] > 0.8 * line.effort[:-1])
        assert line.effort[-1] > 2 * line.effort[0]


@pytest.mark.parametrize("scene", ["elliptical_drop", "taylor_green"])
def test_errors_that_are_shipped_are_those_of_the_solver(scene):
    found = problem(scene)
    start = nominal(found, found.sizes[0])
    [kept] = [sample for sample in read(scene) if sample.setting == start]
    assert execute(found, start).error == pytest.approx(kept.error, rel=1e-5)


def test_the_command_prints_it(table, capsys, monkeypatch):
    monkeypatch.setattr(recommend, "rate", lambda seconds: SPEED)
    command = ["recommend", "elliptical_drop", "--table", str(table)]
    assert main([*command, "--error", "0.01"]) == 0
    printed = capsys.readouterr().out
    for name in ("dx:", "h / dx:", "dt:", "stiffness:", "epsilon:", "kernel:", "precision:"):
        assert name in printed
    assert "expected error: about 1 %, at most 1 %" in printed
    assert main([*command, "--budget", "1s"]) == 0
    assert "expected time:" in capsys.readouterr().out
    for wrong in (["--error", "1e-9"], ["--budget", "soon"], ["--error", "0.01", "--set", "dx=1"]):
        assert main([*command, *wrong]) == 2
        assert "expected" in capsys.readouterr().err
