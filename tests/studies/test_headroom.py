import csv
import math

import numpy as np
import pytest

from sph_gym import studies
from sph_gym.env.oracle import COARSE
from sph_gym.studies import headroom
from sph_gym.studies.episodes import Score, StaticGrid, best_static, results, run
from sph_gym.studies.table import Row

INSTANCE = "patch_impact/val/1"
GRID = StaticGrid(sound=(0.4, 0.6), xsph=(0.3,), substeps=12)


def episode(substeps=100, reward=0.5, beyond=0.0):
    return Score(substeps, reward, 0.5, beyond, False)


def contest(static=300, oracle=100, beyond=0.0, frozen=(), **others):
    best = episode(oracle, 0.8, beyond)
    players = dict(zip(headroom.PLAYERS, (episode(), episode(static), best), strict=True))
    others = dict(zip(map(headroom.frozen, headroom.CONTROLS), frozen, strict=False)) | others
    return headroom.Contest(players | others, (0.0, 0.0, 0.0))


def without_static(one):
    """The contest where no static setting keeps within tolerance."""
    scores = {player: score for player, score in one.scores.items() if player != headroom.STATIC}
    return headroom.Contest(scores)


def searched(*frozen, second):
    return contest(
        frozen=tuple(episode(reward=reward) for reward in frozen),
        **{headroom.ELSEWHERE: episode(reward=second)},
    )


def read(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def table(scene, contests):
    rows = list(headroom.rows(scene, contests))
    assert len({(row.quantity, row.case) for row in rows}) == len(rows)
    return {row.quantity: row for row in rows}


def test_headroom_is_the_ratio_of_work_within_tolerance():
    assert contest().headroom == 3.0
    assert math.isnan(contest(beyond=0.06).headroom)
    assert math.isnan(without_static(contest()).headroom)
    assert headroom.headroom([contest(200), contest(800), contest(beyond=1.0)]) == pytest.approx(4)


def test_a_loss_is_what_the_best_search_earned_more():
    losses = headroom.losses([searched(0.7, 0.8, 0.6, second=0.78), contest()])
    assert list(losses) == [*headroom.CONTROLS, headroom.NOISE_FLOOR]
    assert list(losses.values()) == pytest.approx([0.1, 0.0, 0.2, 0.02])


def test_a_control_is_needed_where_more_is_lost_than_the_noise_floor():
    found = [searched(0.7, 0.8, 0.6, second=second) for second in (0.78, 0.8)]
    assert headroom.needed(found) == ["Courant multiple", "xsph"]
    unlucky = [searched(0.7, 0.8, 0.6, second=0.65)]
    assert headroom.needed(unlucky) == ["xsph"]


def test_a_control_can_be_wanted_without_being_steered():
    one = searched(0.7, 0.7, 0.8, second=0.8)
    off = {headroom.UNSMOOTHED: episode(reward=0.5)}
    found = [one._replace(scores=one.scores | off)]
    assert "xsph" not in headroom.needed(found)
    row = table("dam_break", found)["reward lost with an epsilon of 0"]
    assert row.value == pytest.approx(0.3)
    assert "reward lost with an epsilon of 0" not in table("dam_break", [contest()])


def test_the_summary_counts_scenes_that_are_games():
    good = [searched(0.7, 0.8, 0.7, second=0.8)]
    found = dict.fromkeys(headroom.SCENES, good)
    rows = list(headroom.summary(headroom.FULL, found))
    assert [row.holds for row in rows] == [True, True, False, True]
    assert rows[0].value == len(headroom.SCENES) - len(headroom.instances.DIAGNOSTIC)
    poor = {scene: [contest(static=110)] for scene in headroom.SCENES}
    assert not next(headroom.summary(headroom.FULL, poor)).holds


def test_where_nothing_can_be_compared_nothing_is_gained():
    half = [contest(200), contest(beyond=1.0)]
    assert headroom.headroom(half) == pytest.approx(2.0)
    assert headroom.least_headroom(half) == pytest.approx(2**0.5)
    found = dict.fromkeys(headroom.SCENES, half)
    assert not next(headroom.summary(headroom.FULL, found)).holds


def test_the_best_static_setting_keeps_within_tolerance():
    found = best_static("patch_impact", INSTANCE, GRID)
    assert found is not None
    setting, best = found
    assert best.within
    action = np.array(setting, np.float32)
    assert run("patch_impact", INSTANCE, lambda env, _: action) == best
    assert best_static("patch_impact", INSTANCE, GRID._replace(substeps=1)) is None


def test_a_quick_study_is_kept_on_disk(tmp_path, monkeypatch):
    settings = headroom.ControlGrid((0.8,), (0.3, 0.5), (0.15, 1.0))
    plan = headroom.HeadroomPlan(
        ("patch_impact",), 1, 0, COARSE, GRID, held=2, settings=settings, honest=0
    )
    monkeypatch.setattr(headroom, "QUICK", plan)
    # a coarse oracle leaves its tolerance on the first flow
    monkeypatch.setattr(headroom, "_id", lambda scene, k: f"{scene}/val/{(k + 1) % 16}")
    first = list(headroom.measure(True, tmp_path))
    monkeypatch.setattr(headroom, "run", lambda *arguments: pytest.fail("played twice"))
    assert list(headroom.measure(True, tmp_path)) == first
    found = {row.quantity: row for row in first}
    row = found["headroom over the best static"]
    small = "" if row.value >= headroom.HEADROOM else ", small headroom"
    assert row.case == f"patch_impact, benchmark{small}"
    assert row.value > 1.0
    assert found["headroom"].case == INSTANCE
    assert found["headroom"].value == pytest.approx(row.value)
    told = read(tmp_path / "headroom_quick_instances.csv")
    assert [one["player"] for one in told] == list(headroom.PLAYERS)
    assert {one["instance"] for one in told} == {INSTANCE}
    assert {float(one["headroom"]) for one in told} == {found["headroom"].value}
    assert [one["within"] for one in told[1:]] == ["True", "True"]


def test_episodes_are_kept_by_their_key(tmp_path):
    store = results(tmp_path)
    assert store.get(["a", 1], lambda: 1.5) == 1.5
    assert store.get(["a", 1], lambda: pytest.fail("computed twice")) == 1.5
    assert store.get(["a", 2], lambda: [2, None]) == [2, None]


def test_a_frozen_oracle_is_no_worse_than_the_static_setting():
    frozen = (episode(reward=-1.0), episode(reward=0.7), episode(reward=0.8))
    losses = headroom.losses([contest(frozen=frozen)])
    assert losses["Courant multiple"] == pytest.approx(0.3)


def test_scenes_are_labelled_by_their_headroom():
    assert headroom.label("dam_break", [contest(150)]) == "benchmark"
    assert headroom.label("dam_break", [contest(149)]) == "benchmark, small headroom"
    assert headroom.label("dam_break", [contest(beyond=0.06)]) == "benchmark, unknown headroom"
    assert headroom.label("relaxation", [contest()]) == "diagnostic"
    assert table("dam_break", [contest(110)])["work, oracle"].case.endswith("small headroom")


def test_what_cannot_be_compared_is_counted():
    contests = [contest(200), contest(800), contest(beyond=1.0), without_static(contest())]
    found = table("dam_break", contests)
    assert found["headroom over the best static"].value == pytest.approx(4)
    told = {name: found[f"within tolerance, {name}"] for name in headroom.PLAYERS}
    assert [row.value for row in told.values()] == [4, 3, 3]
    both = found["static and oracle within tolerance"]
    assert (both.value, both.unit) == (2, "of 4 instances")
    assert found["the same, if elsewhere nothing is gained"].value == pytest.approx(2)
    single = [row for row in headroom.rows("dam_break", contests) if row.quantity == "headroom"]
    assert {row.case: row.value for row in single} == {"dam_break/val/0": 2, "dam_break/val/1": 8}


def test_where_all_can_be_compared_there_is_nothing_else_to_say():
    found = table("dam_break", [contest(200), contest(800)])
    assert found["headroom over the best static"].value == pytest.approx(4)
    assert found["static and oracle within tolerance"].value == 2
    assert not any(name.startswith("the same") for name in found)


def test_errors_are_shown_beside_the_work():
    worse = {headroom.ORACLE: Score(100, 0.8, 0.9, 0.0, False)}
    off = contest()._replace(scores=contest().scores | worse)
    found = table("dam_break", [contest(), off])
    assert found["error, oracle"].value == pytest.approx(0.7)
    assert found["error, best static"].value == pytest.approx(0.5)


def test_no_headroom_fails_benchmarks_alone():
    none = [without_static(contest()), contest(beyond=0.5)]
    assert not table("dam_break", none)["headroom over the best static"].holds
    assert all(row.holds for row in headroom.rows("relaxation", none))
    assert table("relaxation", none)["no headroom: both within tolerance nowhere"].value == 0


def test_all_episodes_are_written(tmp_path):
    frozen = (episode(reward=0.7), episode(reward=0.8), episode(reward=0.6))
    found = {"dam_break": [contest(frozen=frozen)], "relaxation": [without_static(contest())]}
    headroom.write_instances(found, tmp_path / "deep" / "i.csv")
    told = read(tmp_path / "deep" / "i.csv")
    names = [*headroom.PLAYERS, *(f"oracle without {one}" for one in headroom.CONTROLS)]
    assert [row["player"] for row in told] == [*names, "tuned CFL", "oracle"]
    assert [row["headroom"] for row in told[-2:]] == ["", ""]
    assert told[1] == {
        "instance": "dam_break/val/0", "label": "benchmark", "player": "best static",
        "substeps": "300", "reward": "0.5", "error": "0.5", "beyond": "0.0", "blowup": "False",
        "within": "True", "setting": "(0.0, 0.0, 0.0)", "headroom": "3.0",
    }  # fmt: skip


@pytest.mark.parametrize("name", ["headroom", "exploits"])
def test_the_table_says_why_a_scene_is_no_benchmark(name, tmp_path, monkeypatch, capsys):
    rows = [Row("work", "relaxation, diagnostic", 1.0, ""), Row("work", "dam_break", 1.0, "")]
    monkeypatch.setattr(f"sph_gym.studies.{name}.measure", lambda quick, folder: rows)
    assert studies.run_study(name, folder=tmp_path) == 0
    out = capsys.readouterr().out
    assert headroom.instances.DIAGNOSTIC["relaxation"] in out
    assert headroom.instances.DIAGNOSTIC["hydrostatic_tank"] not in out
    assert ("headroom_instances.csv" in out) == (name == "headroom")


def test_labels_are_written_for_the_pages(tmp_path, monkeypatch):
    good, small, none = [contest()], [contest(149)], [contest(beyond=0.06)]
    found = {"dam_break": good, "shaken_tank": small, "long_fall": none, "relaxation": none}
    rows = [row for scene, each in found.items() for row in headroom.rows(scene, each)]
    monkeypatch.setattr(headroom, "measure", lambda quick, folder: rows)
    studies.run_study("headroom", folder=tmp_path)
    with (tmp_path / "headroom_labels.csv").open(newline="") as file:
        written = [tuple(row.values()) for row in csv.DictReader(file)]
    assert written == [
        ("dam_break", "3", "benchmark"),
        ("shaken_tank", "1.49", "benchmark, small headroom"),
        ("long_fall", "", "benchmark, unknown headroom"),
        ("relaxation", "", "diagnostic"),
    ]
