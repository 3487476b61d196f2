"""Searches for static settings, on a made-up landscape instead of episodes."""

import json

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest

from agents import static_search
from agents.evaluate import MEASURES
from agents.policies import STATIC, Settings, Spec, build
from agents.static_search import StaticSearchArgs
from sph_gym import Controls

METHODS = STATIC[:-1]
# The best sound speed of each instance.
BEST = {"dam_break/train/0": 0.3, "dam_break/train/1": 0.5, "drop_impact/train/0": 0.9}


@pytest.fixture
def played(monkeypatch):
    """Rewards settings by their distance from the best; returns the batches that were played."""
    batches = []

    def run_episodes(jobs, folder, title, backend):
        batches.append(jobs)
        rows = []
        for job in jobs:
            courant, sound, xsph = job.spec.settings
            gap = (courant - 0.8) ** 2 + (xsph - 0.4) ** 2
            gap += np.log(sound / BEST.get(job.instance, 0.4)) ** 2
            rows.append(dict.fromkeys(MEASURES, 0.0) | {"return": 1.0 - gap})
        return rows

    monkeypatch.setattr(static_search, "run_episodes", run_episodes)
    return batches


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_a_good_setting_and_the_same_one_again(tmp_path, played, method):
    if method not in ("grid_search", "random_search"):
        pytest.importorskip("optuna")
    args = StaticSearchArgs(method, n_instances=2, trials=60, output=tmp_path)
    found = static_search.search(args)
    first = found.loc[0]
    assert first["return"] == found["return"].max() > (0.8 if method == "random_search" else 0.88)
    assert 0.2 <= first["sound"] <= 1.0
    assert len(found) == (120 if method == "grid_search" else 60)
    again = static_search.search(args)
    assert again.equals(found)


def test_scenes_and_instances_get_settings_of_their_own(tmp_path, played):
    sounds = tuple(BEST.values())
    common = {"courant": (0.8,), "sound": sounds, "xsph": (0.4,), "output": tmp_path}
    late = StaticSearchArgs(n_instances=2, per="instance", **common)
    static_search.search(late)
    table = json.loads(late.table.read_text())
    assert table == {f"dam_break/train/{k}": [0.8, s, 0.4] for k, s in enumerate((0.3, 0.5))}
    # the groups are played side by side
    early = StaticSearchArgs(scene="benchmark", n_instances=1, **common)
    static_search.search(early)
    assert len(played) == 2
    table = json.loads(early.table.read_text())
    assert len(table) == 6
    assert table["drop_impact"] == [0.8, 0.9, 0.4]


def test_a_sampler_tries_the_settings_of_tables_first(tmp_path, played):
    own, general = Settings(0.7, 0.5, 0.2), Settings(0.9, 0.6, 0.3)
    for name, table in (("a", {"dam_break/test/1": own}), ("b", {"dam_break": general})):
        (tmp_path / f"{name}.json").write_text(json.dumps(table))
    tables = tuple(tmp_path / f"{name}.json" for name in ("a", "b"))
    search = StaticSearchArgs(
        "tpe", n_instances=2, instances="test", per="instance", first=tables, trials=3,
        output=tmp_path,
    )  # fmt: skip
    static_search.search(search)
    runs = pd.read_csv(search.runs)
    tried = {
        id_: list(map(tuple, own[static_search.SETTINGS].to_numpy()))
        for id_, own in runs.groupby("instance")
    }
    assert tried["dam_break/test/0"][0] == general
    assert tried["dam_break/test/1"][:2] == [own, general]
    assert len(tried["dam_break/test/1"]) == 3


def test_the_best_setting_of_a_group_comes_first(tmp_path, played):
    found = static_search.search(StaticSearchArgs(n_instances=1, output=tmp_path))
    assert static_search.best(found) == {"dam_break": Settings(0.8, 0.3, 0.3)}


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"method": "magic"}, "method: expected one of grid_search, random_search, tpe, cma_es"),
        ({"per": "family"}, "per: expected one of scene, instance"),
        ({"scene": "nothing"}, "scene: expected one of"),
        ({"n_instances": 0}, "n_instances: expected 1 to 256"),
        ({"method": "tpe", "trials": 0}, "trials: expected"),
    ],
    ids=str,
)
def test_wrong_arguments_are_refused(tmp_path, given, text):
    with pytest.raises(ValueError, match=text):
        static_search.search(StaticSearchArgs(**given, output=tmp_path))


def test_a_table_is_looked_up_by_instance_then_by_scene(tmp_path):
    table = tmp_path / "best.json"
    table.write_text(json.dumps({"drop_impact/val/1": [0.5, 0.3, 0.2], "drop_impact": [0.9, 1, 0]}))
    env, policy = gym.make("sph_gym/DropImpact-v1"), build(Spec("hindsight", table=str(table)), 0)
    for instance, (courant, sound, xsph) in (
        ("drop_impact/val/1", (0.5, 0.3, 0.2)),
        ("drop_impact/val/2", (0.9, 1.0, 0.0)),
    ):
        observation, _ = env.reset(options={"instance": instance})
        scene = env.unwrapped.sim.scene
        c = sound * scene.fluid.c0
        wanted = Controls(courant * scene.h / c, scene.fluid.stiffness(c), xsph)
        expected = env.unwrapped.action_toward(wanted)
        assert policy(env, observation) == pytest.approx(expected, abs=1e-6)
    table.write_text("{}")
    with pytest.raises(ValueError, match="table: expected settings of drop_impact/val/2"):
        build(Spec("hindsight", table=str(table)), 0)(env, observation)
