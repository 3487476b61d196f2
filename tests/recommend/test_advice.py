import math
from dataclasses import replace

import pytest

from sph_gym import recommend
from sph_gym.recommend import advice
from sph_gym.recommend.runs import execute
from sph_gym.recommend.settings import nominal
from sph_gym.recommend.tables import read, shipped, write
from sph_gym.scenes.shared.refinement import names, refinement
from tests.recommend.made_up import DROP, SPEED, advise, offered, samples


def test_the_cheapest_line_at_the_coarsest_resolution_that_does(table):
    found = advise(table, error=0.2 / 27.5)
    assert found.choice.setting == nominal(DROP, 28)._replace(dtype="float32")
    assert found.choice.error == pytest.approx(0.2 / 28)
    assert found.seconds == pytest.approx(100 * 28**3 / 3 / SPEED)


def test_the_budget_is_the_other_way_round(table):
    found = advise(table, error=0.2 / 27.5)
    back = advise(table, budget=1.001 * found.seconds)
    assert back.choice.setting == found.choice.setting
    assert advise(table, budget=1e9).choice.setting.across == 40


def test_more_error_than_was_measured_takes_the_coarsest(table):
    assert advise(table, error=0.9).choice.setting.across == 10


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"error": 1e-4}, "error: expected at least 0.005.* 0.005 to 0.02 can be promised"),
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


def test_what_is_expected_is_less_than_what_is_promised(tmp_path):
    path = tmp_path / "lines.csv"
    errors = (0.04, 0.05, 0.03)
    made = [replace(sample, error=e) for sample, e in zip(samples(), errors, strict=True)]
    write(made, path, "made up")
    found = advise(path, error=0.19)
    assert found.choice.error == pytest.approx(0.05)
    assert found.choice.promised == pytest.approx(0.05 * 1.25**0.5)
    told = dict(recommend.describe(found))
    assert told["expected error"].startswith("about 5 %, at most 5.59 %")
    with pytest.raises(ValueError, match=r"expected at least 0\.05"):
        advise(path, error=0.02)


def test_an_error_out_of_reach_is_told_before_anything_is_timed(table, monkeypatch):
    monkeypatch.setattr(advice, "rate", lambda seconds: pytest.fail("the benchmark was run"))
    with pytest.raises(ValueError, match="can be promised"):
        recommend.advise(DROP.scene, error=1e-4, table=table)


def test_a_case_without_a_reference_is_refused():
    column = refinement("dam_break")
    flat = replace(column, arguments=column.arguments | {"height": 0.6})
    with pytest.raises(ValueError, match="dam_break: expected arguments for which there is a ref"):
        execute(flat, nominal(flat, 10))


def test_more_than_everything_is_asked_back(table):
    for ask in (lambda: recommend.parse_error("5"), lambda: advise(table, error=5.0)):
        with pytest.raises(ValueError, match=r"at most 1, got 5: did you mean 0\.05\?"):
            ask()


def scattered(*changes):
    """Samples of the drop whose own errors hardly depend on dx, and a lucky line."""
    own = [replace(s, error=e) for s, e in zip(samples(), (0.039, 0.035, 0.036), strict=True)]
    lucky = [replace(s, error=0.03) for s in samples(0.5, width=3.0)]
    return [*own, *lucky]


def test_nothing_below_the_noise_floor_is_promised(tmp_path):
    path = tmp_path / "lines.csv"
    write(scattered(), path, "made up")
    rich, poor = advise(path, budget=1e9), advise(path, error=0.05)
    assert rich.choice == poor.choice
    assert rich.choice.setting.across == 10
    assert (rich.choice.error, rich.choice.promised) == pytest.approx((0.039, 0.039))
    assert "more time buys nothing" in dict(recommend.describe(rich))["caution"]
    with pytest.raises(ValueError, match=r"expected at least 0\.039.*within their scatter"):
        advise(path, error=0.034)


# Scenes whose advice needs no version of the solver beyond those of other tests.
QUICK = ("couette", "taylor_green")


@pytest.mark.parametrize(
    "scene",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in shipped()],
)
def test_what_is_shipped_gives_advice(scene):
    assert scene in names()
    found = offered(read(scene))
    best = min(float(line.promised[-1]) for line in found)
    found = recommend.advise(scene, error=1.01 * best, speed=SPEED)
    assert found.choice.promised <= 1.01 * best
    assert found.seconds > 0
    assert dict(recommend.describe(found))["kernel"] == found.choice.setting.kernel


def test_nothing_is_recommended_for_what_is_erratic():
    with pytest.raises(ValueError, match="scene: expected one whose errors fall"):
        recommend.advise("hydrostatic_tank", error=0.01)
