import math
from dataclasses import replace

import pytest

from sph_gym.studies.accuracy import lines, points, problems, promises
from sph_gym.studies.accuracy.settings import nominal

DROP = replace(problems.problem("elliptical_drop"), sizes=(6, 8, 10), nominal=8)


@pytest.fixture(autouse=True)
def steady_clock(monkeypatch):
    """A benchmark that takes no time."""
    monkeypatch.setattr(points, "rate", lambda: 1e6)
    monkeypatch.setattr(points, "PATIENCE", 0.0)


def drop(**changes):
    return nominal(DROP)._replace(**changes)


def test_a_promise_that_is_broken_is_a_row_that_fails(tmp_path):
    found = [
        points.point(DROP, "nominal", nominal(DROP, n), tmp_path, repeats=1) for n in (6, 8, 10)
    ]

    def told(found):
        rows = promises.rows(DROP, found, tmp_path)
        return [row for row in rows if row.quantity == "measured / promised error"]

    kept = told(found)
    assert kept
    assert all(row.holds for row in kept)
    lied = [point._replace(error=point.error / 4) for point in found]
    assert all(not row.holds for row in told(lied))
    [none] = promises.rows(DROP, found[:2], tmp_path)
    assert not none.holds


def test_promises_are_tried_between_the_resolutions(tmp_path, monkeypatch):
    found = [
        points.point(DROP, "nominal", nominal(DROP, n), tmp_path, repeats=1) for n in (6, 8, 10)
    ]
    tried = []
    real = promises.point
    monkeypatch.setattr(
        promises,
        "point",
        lambda *a, **k: (
            tried.append((a[2].across, a[6] if len(a) > 6 else k["other"])) or real(*a, **k)
        ),
    )
    list(promises.rows(replace(DROP, other={"rate": 60.0}), found, tmp_path))
    assert {across for across, other in tried if not other} <= {7, 9}
    elsewhere = [across for across, other in tried if other]
    # the coarsest: by which the promise is corrected, once
    assert elsewhere.count(6) == 1
    assert set(elsewhere) <= {6, 7, 8, 9, 10}
    assert len(elsewhere) > 1


def test_another_case_is_told_what_anybody_would_be():
    """The cheaper line fails in the other case, so that the dear one is advised."""
    cheap, dear = (
        [
            promises.Sample(DROP.scene, drop(across=n, kernel=kernel), 0.1 / n, effort * n**3)
            for n in (6, 8, 10)
        ]
        for kernel, effort in (("spiky", 1.0), ("wendland_c2", 9.0))
    )
    fitted = lines.fit([*cheap, *dear])

    def probe(setting):
        return (math.nan if setting.kernel == "spiky" else 0.1 / 6), 9.0 * 6**3

    answers = promises._elsewhere(fitted, probe)
    assert {choice.setting.kernel for choice in promises._between(fitted)} == {"spiky"}
    assert len(answers) == len(promises.ASKED)
    assert {choice.setting.kernel for choice in answers} == {"wendland_c2"}
    assert all(choice.setting.across != 6 for choice in answers)
    assert promises._elsewhere(fitted, lambda setting: (math.nan, 1.0)) == []


def test_times_of_promises_are_taken_anew_if_asked_for(tmp_path, monkeypatch):
    found = [
        points.point(DROP, "nominal", nominal(DROP, n), tmp_path, repeats=1) for n in (6, 8, 10)
    ]
    asked = []
    real = promises.point
    monkeypatch.setattr(promises, "point", lambda *a, **k: asked.append(a[5]) or real(*a, **k))
    for again in (False, True):
        list(promises.rows(DROP, found, tmp_path, again))
    half = len(asked) // 2
    assert asked == [False] * half + [True] * half
    assert half
