"""Validations during a training: which episodes, what is kept, what a resumed one takes over."""

import pandas as pd
import pytest

pytest.importorskip("stable_baselines3")

from agents import validation
from agents.validation import Validation, validation_ids
from sph_gym.env.instances import DIAGNOSTIC
from tests.networks import tiny

RETURNS = {"dam_break/val/0": 0.5, "dam_break/val/1": 0.3, "drop_impact/val/0": 0.1}


@pytest.fixture
def returns(monkeypatch):
    """Episodes that earn what a test says, without being played."""
    earned = dict(RETURNS)

    def play_episode(network, action_mode, id_):
        scene = id_.split("/")[0]
        return {"return": earned[id_], "work": 1.0, "blowup": 0.0, "scene": scene}

    monkeypatch.setattr(validation, "play_episode", play_episode)
    return earned


def test_each_scene_has_as_many_episodes():
    assert validation_ids("dam_break", 2) == ["dam_break/val/0", "dam_break/val/1"]
    found = validation_ids("benchmark", 3)
    assert len(found) == len(set(found)) == 18
    assert not {id_.split("/")[0] for id_ in found} & set(DIAGNOSTIC)
    for count in (0, 17):
        with pytest.raises(ValueError, match="n_evaluations: expected"):
            validation_ids("dam_break", count)


def test_the_best_network_and_the_curve_are_kept(tmp_path, returns):
    kept = Validation(list(RETURNS), tmp_path, "absolute")
    networks = [tiny(seed=seed) for seed in range(3)]
    assert kept.judge(networks[0], 10)
    best = kept.network.read_bytes()
    returns["drop_impact/val/0"] = 0.0
    assert not kept.judge(networks[1], 20)
    assert kept.network.read_bytes() == best
    curve = pd.read_csv(tmp_path / "validation.csv")
    assert curve["steps"].tolist() == [10, 20]
    assert curve["return"].tolist() == pytest.approx([0.3, 0.8 / 3])
    assert curve["dam_break"].tolist() == pytest.approx([0.4, 0.4])
    # the best of the first run is the one to beat
    again = Validation(list(RETURNS), tmp_path, "absolute", resume=True)
    assert not again.judge(networks[1], 30)
    returns["drop_impact/val/0"] = 0.2
    assert again.judge(networks[2], 40)
    assert kept.network.read_bytes() != best
    assert len(pd.read_csv(tmp_path / "validation.csv")) == 4


def test_a_new_run_forgets_the_former_one(tmp_path, returns):
    Validation(list(RETURNS), tmp_path, "absolute").judge(tiny(), 10)
    fresh = Validation(list(RETURNS), tmp_path, "absolute")
    # it stays until there is another one
    former = fresh.network.read_bytes()
    returns["drop_impact/val/0"] = -1.0
    assert fresh.judge(tiny(seed=1), 10)
    assert fresh.network.read_bytes() != former


def test_a_damaged_curve_is_said_and_starts_again(tmp_path, returns):
    Validation(list(RETURNS), tmp_path, "absolute").judge(tiny(), 10)
    (tmp_path / "validation.csv").write_text("steps,what\n1,2\n")
    with pytest.warns(UserWarning, match="is damaged"):
        again = Validation(list(RETURNS), tmp_path, "absolute", resume=True)
    assert again.judge(tiny(), 20)
