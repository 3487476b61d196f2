import math

import numpy as np
import pytest

from sph_gym.env.oracle import COARSE
from sph_gym.studies import headroom
from sph_gym.studies.episodes import Episode, Grid, best_static, kept, run

INSTANCE = "colliding_patches/val/3"
GRID = Grid(sound=(0.4, 0.6), xsph=(0.3,), substeps=12)


def episode(substeps=100, reward=0.5, beyond=0.0):
    return Episode(substeps, reward, 0.5, beyond, False)


def contest(static=300, oracle=100, beyond=0.0, frozen=()):
    return headroom.Contest(
        episode(), episode(static), (0.0, 0.0, 0.0), episode(oracle, 0.8, beyond), frozen
    )


def test_headroom_is_the_ratio_of_work_within_tolerance():
    assert contest().headroom == 3.0
    assert math.isnan(contest(beyond=0.06).headroom)
    assert math.isnan(contest()._replace(static=None).headroom)
    assert headroom.headroom([contest(200), contest(800), contest(beyond=1.0)]) == pytest.approx(4)


def test_a_loss_is_what_the_oracle_earned_more():
    frozen = tuple(episode(reward=reward) for reward in (0.7, 0.8, 0.6))
    losses = headroom.losses([contest(frozen=frozen), contest()])
    assert list(losses) == list(headroom.CONTROLS)
    assert list(losses.values()) == pytest.approx([0.1, 0.0, 0.2])


def test_the_summary_counts_scenes_that_are_games():
    frozen = tuple(episode(reward=reward) for reward in (0.7, 0.8, 0.7))
    good = [contest(frozen=frozen)]
    found = dict.fromkeys(headroom.SCENES, good)
    rows = list(headroom.summary(headroom.FULL, found))
    assert [row.holds for row in rows] == [True, True, False, True]
    assert rows[0].value == len(headroom.SCENES) - len(headroom.instances.DIAGNOSTIC)
    poor = {scene: [contest(static=110)] for scene in headroom.SCENES}
    assert not next(headroom.summary(headroom.FULL, poor)).holds


def test_the_best_static_setting_keeps_within_tolerance():
    found = best_static("colliding_patches", INSTANCE, GRID)
    assert found is not None
    setting, best = found
    assert best.within
    action = np.array(setting, np.float32)
    assert run("colliding_patches", INSTANCE, lambda env, _: action) == best
    assert best_static("colliding_patches", INSTANCE, GRID._replace(substeps=1)) is None


def test_a_quick_study_is_kept_on_disk(tmp_path, monkeypatch):
    plan = headroom.Plan(("colliding_patches",), 1, 0, COARSE, GRID)
    monkeypatch.setattr(headroom, "QUICK", plan)
    first = list(headroom.measure(True, tmp_path))
    monkeypatch.setattr(headroom, "run", lambda *arguments: pytest.fail("played twice"))
    assert list(headroom.measure(True, tmp_path)) == first
    found = {row.quantity: row for row in first}
    assert found["headroom over the best static"].case == "colliding_patches, benchmark"
    assert found["headroom over the best static"].value > 1.0


def test_what_is_kept_belongs_to_its_key(tmp_path):
    assert kept(tmp_path, ["a", 1], lambda: 1.5) == 1.5
    assert kept(tmp_path, ["a", 1], lambda: pytest.fail("computed twice")) == 1.5
    assert kept(tmp_path, ["a", 2], lambda: [2, None]) == [2, None]


def test_a_frozen_oracle_is_no_worse_than_the_static_setting():
    frozen = (episode(reward=-1.0), episode(reward=0.7), episode(reward=0.8))
    losses = headroom.losses([contest(frozen=frozen)])
    assert losses["Courant multiple"] == pytest.approx(0.3)
