import math
from dataclasses import replace

import pytest

from sph_gym.recommend import advice
from sph_gym.recommend.series import MeasuredRun
from sph_gym.recommend.settings import nominal
from sph_gym.scenes.shared.refinement import refinement
from sph_gym.studies.accuracy import points, promises
from sph_gym.studies.accuracy.points import Sampling

DROP = replace(refinement("elliptical_drop"), sizes=(6, 8, 10), nominal=8)


@pytest.fixture(autouse=True)
def steady_clock(monkeypatch):
    """A benchmark that takes no time."""
    monkeypatch.setattr(points, "rate", lambda: 1e6)
    monkeypatch.setattr(points, "PATIENCE", 0.0)
    monkeypatch.setattr(points, "AGREED", math.inf)


def drop(**changes):
    return nominal(DROP)._replace(**changes)


def own_series(tmp_path):
    once = Sampling(tmp_path, 1)
    return [points.measure_point(DROP, "nominal", nominal(DROP, n), once) for n in (6, 8, 10)]


def rows_of(case, trials, quantity="measured / promised error"):
    return [row for row in promises.rows(case, trials) if row.quantity.startswith(quantity)]


def test_a_promise_that_is_broken_is_a_row_that_fails(tmp_path):
    found = own_series(tmp_path)
    trials = promises.try_out(DROP, found, Sampling(tmp_path))
    kept = rows_of(DROP, trials)
    assert kept
    assert all(row.holds for row in kept)
    lied = [replace(point, error=point.error / 4) for point in found]
    broken = rows_of(DROP, promises.try_out(DROP, lied, Sampling(tmp_path)))
    assert not any(row.holds for row in broken)
    timid = [t._replace(choice=t.choice._replace(error=9 * t.choice.error)) for t in trials]
    assert not any(row.holds for row in rows_of(DROP, timid, "expected / measured error"))


def test_what_is_not_tried_has_a_row_that_says_so(tmp_path):
    found = own_series(tmp_path)
    # too short for a line
    assert promises.try_out(DROP, found[:2], Sampling(tmp_path)) == []
    flat = [replace(point, error=0.03 + 1e-4 * k) for k, point in enumerate(found)]
    assert promises.try_out(DROP, flat, Sampling(tmp_path)) == []
    [none, alone] = promises.rows(DROP, [])
    assert "nothing to tell apart" in none.case
    assert "only change the units" in alone.case


def test_promises_are_tried_between_the_resolutions_and_in_other_cases(tmp_path, monkeypatch):
    found = own_series(tmp_path)
    tried = []
    real = promises.measure_point

    def watched(*given):
        tried.append((given[2].across, given[4]))
        return real(*given)

    monkeypatch.setattr(promises, "measure_point", watched)
    both = replace(DROP, others=({"rate": 60.0}, {"rate": 70.0}), single="")
    trials = promises.try_out(both, found, Sampling(tmp_path))
    assert {across for across, other in tried if not other} <= {7, 9}
    for other in (1, 2):
        elsewhere = [across for across, case in tried if case == other]
        # the coarsest: by which the promise is corrected, once
        assert elsewhere.count(6) == 1
        assert set(elsewhere) <= {6, 7, 8, 9, 10}
        assert len(elsewhere) > 1
    reached = rows_of(both, trials, "within reach")
    assert [row.bound for row in reached] == [promises.LEAST_REACHED] * 2
    assert all(row.holds for row in reached)
    assert {trial.found.key for trial in trials} == {r["key"] for r in promises.records(trials)}
    blown = [t._replace(answered=False, early=math.inf) for t in trials]
    assert not any(row.holds for row in rows_of(both, blown, "within reach"))
    assert all(row.value > 0 for row in rows_of(both, blown, "blew up"))
    missed = [t._replace(early=1.6) for t in trials]
    assert all(row.value > 0 for row in rows_of(both, missed, "missed its promise"))


def test_another_case_is_answered_as_a_user_would_be():
    """The cheaper line fails in the other case, so that the dear one is advised."""
    kinds = [(drop(kernel="spiky"), 1.0), (drop(kernel="wendland_c2"), 9.0)]
    cheap, dear = (
        [MeasuredRun("", own._replace(across=n), 0.1 / n, pace * n**3) for n in (6, 8, 10)]
        for own, pace in kinds
    )
    fitted = advice.offered([*cheap, *dear], 0.0)

    def probe(setting):
        bad = setting.kernel == "spiky"
        return math.nan if bad else 0.1 / setting.across, 9.0 * setting.across**3

    answers = list(promises._in_other_case(fitted, probe))
    assert {choice.setting.kernel for choice in promises._between(fitted)} == {"spiky"}
    assert len(answers) == len(promises.ASKED)
    assert all(answered for _, _, answered, _ in answers)
    assert {choice.setting.kernel for _, choice, *_ in answers} == {"wendland_c2"}
    # none is the very run that made the answer, and some promises had to be corrected by it
    assert not {choice.setting.across for _, choice, *_ in answers} & {6, 8, 10}
    assert all(early <= 1.001 or math.isnan(early) for *_, early in answers)

    def worse(setting):
        return 0.1 / setting.across * (1 + (setting.across > 6)), 9.0 * setting.across**3

    answers = list(promises._in_other_case(fitted, worse))
    assert max(early for *_, early in answers if early > 0) > 1.5
    assert list(promises._in_other_case(fitted, lambda setting: (math.nan, 1.0))) == []


def test_times_of_promises_are_taken_anew_if_asked_for(tmp_path, monkeypatch):
    found = own_series(tmp_path)
    asked = []
    real = promises.measure_point
    monkeypatch.setattr(promises, "measure_point", lambda *a: asked.append(a[3].again) or real(*a))
    for again in (False, True):
        promises.try_out(DROP, found, Sampling(tmp_path, again=again))
    half = len(asked) // 2
    assert asked == [False] * half + [True] * half
    assert half
