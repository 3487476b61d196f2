import gc
import json

import gymnasium as gym
import numpy as np
import pytest

import sph_gym  # noqa: F401
from agents.policies import Spec, build
from sph_gym import scenes
from sph_gym.__main__ import main
from sph_gym.env import build_datasets, dataset, manifest, observations
from sph_gym.env.dataset import record
from sph_gym.env.fingerprint import fingerprint
from sph_gym.env.oracle import Oracle, Search
from sph_gym.env.policies import draw_at_random
from sph_gym.env.rewards import TERMS

minari = pytest.importorskip("minari")

ID, ARGUMENTS = "sph_gym/DropImpact-v1", {"dx": 0.08}
INSTANCES = ["drop_impact/train/5/dx=0.08", "drop_impact/train/2/dx=0.08"]
NAME = "sph_gym/drop_impact/random-v1"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))


def random_agent():
    return build(Spec("random"), seed=1)


def test_episodes_come_back_and_can_be_played_again():
    written = record(ID, random_agent(), 2, NAME, INSTANCES, seed=3, arguments=ARGUMENTS)
    assert NAME in minari.list_local_datasets()
    read = minari.load_dataset(NAME)
    assert written.total_steps == read.total_steps > 2
    env = read.recover_environment()
    described = list(read.storage.get_episode_metadata([0, 1]))
    for episode, about, instance in zip(read, described, INSTANCES, strict=True):
        assert about["options"]["instance"] == instance
        assert about["instance_id"] == instance
        assert about["rewards_sum"] == pytest.approx(episode.rewards.sum())
        assert {name.decode() for name in episode.infos["instance_id"]} == {about["instance_id"]}
        assert episode.terminations[-1] or episode.truncations[-1]
        observation, info = env.reset(seed=about["seed"], options=about["options"])
        seen, reward = [observation], 0.0
        for k, action in enumerate(episode.actions):
            observation, reward, _, _, info = env.step(action)
            seen.append(observation)
            assert reward == episode.rewards[k]
            assert info["work"] == episode.infos["work"][k + 1]
        assert np.array_equal(seen, episode.observations)
        assert len(episode.infos["time"]) == len(episode) + 1


def test_pictures_come_back_as_they_were():
    arguments = {**ARGUMENTS, "observation": "field"}
    seen = []

    def watch(env, observation):
        seen.append(observation)
        return random_agent()(env, observation)

    (episode,) = record(ID, watch, 1, NAME, INSTANCES, arguments=arguments)
    assert np.array_equal(seen, episode.observations[:-1])


def test_vector_rewards_come_back_term_by_term():
    arguments = {**ARGUMENTS, "reward": "vector"}
    written = record(ID, random_agent(), 1, NAME, INSTANCES, arguments=arguments)
    (about,) = written.storage.get_episode_metadata([0])
    (episode,) = minari.load_dataset(NAME)
    terms = [episode.infos[f"reward_{term}"][1:] for term in TERMS]
    assert np.allclose(episode.rewards, np.stack(terms, axis=1), rtol=1e-6)
    assert about["rewards_sum"] == pytest.approx(np.sum(terms))
    env = written.recover_environment()
    env.reset(seed=about["seed"], options=about["options"])
    assert np.array_equal(env.step(episode.actions[0])[1], episode.rewards[0])


def test_instances_are_drawn_where_none_are_named():
    arguments = {**ARGUMENTS, "instances": "val"}
    data = record(ID, random_agent(), 2, NAME, arguments=arguments)
    first, second = data.storage.get_episode_metadata([0, 1])
    assert first["instance_id"].startswith("drop_impact/val/")
    assert first["instance_id"] != second["instance_id"]
    assert (first["seed"], second["seed"]) == (0, 1)


def test_what_cannot_be_written_is_refused_before_playing():
    def never(env, observation):
        raise AssertionError

    for wrong in ("", "no spaces allowed-v1", "sph_gym/unversioned", None):
        with pytest.raises(ValueError, match="dataset"):
            record(ID, never, 1, wrong, INSTANCES)
    with pytest.raises(ValueError, match="n_episodes"):
        record(ID, never, 0, NAME, INSTANCES)
    record(ID, random_agent(), 1, NAME, INSTANCES, arguments=ARGUMENTS)
    with pytest.raises(ValueError, match="exists"):
        record(ID, never, 1, NAME, INSTANCES)


def test_a_dataset_tells_what_made_its_flows():
    instances = ["drop_impact/ood/1", "drop_impact/ood/1/dx=0.08"]
    record(ID, random_agent(), 2, NAME, instances)
    data = minari.load_dataset(NAME)
    assert data.storage.metadata["manifest_version"] == manifest.VERSION
    listed, coarse = (
        json.loads(about["instance"]) for about in data.storage.get_episode_metadata([0, 1])
    )
    assert listed["context"]["alpha"] > 0
    assert listed["fingerprint"] == manifest.entry(instances[0]).fingerprint
    assert listed["arguments"] == manifest.entry(instances[0]).drawn.arguments
    assert (listed["manifest"], coarse["manifest"]) == (manifest.VERSION, "")
    assert listed["shift"] == coarse["shift"] == "strength"
    assert scenes.make(coarse["builder"], **coarse["arguments"]).dx == 0.08


def test_a_scene_of_ones_own_is_told_by_its_fingerprint_and_recovered():
    scene = scenes.make("drop_impact", dx=0.08)
    data = record("sph_gym/Custom-v1", random_agent(), 1, NAME, arguments={"scene": scene})
    (about,) = data.storage.get_episode_metadata([0])
    assert json.loads(about["instance"])["fingerprint"] == fingerprint(scene)
    env = minari.load_dataset(NAME).recover_environment()
    (episode,) = data
    observation, info = env.reset(seed=about["seed"])
    assert info["instance_id"] == about["instance_id"]
    assert np.array_equal(observation, episode.observations[0])
    for k, action in enumerate(episode.actions[:3]):
        assert np.array_equal(env.step(action)[0], episode.observations[k + 1])


def test_a_dataset_is_complete_or_absent(monkeypatch, tmp_path):
    def interrupt(episode):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        # the last thing that is written
        patch.setattr(dataset, "_summary", interrupt)
        with pytest.raises(KeyboardInterrupt):
            record(ID, random_agent(), 1, NAME, INSTANCES, arguments=ARGUMENTS)
    assert NAME not in minari.list_local_datasets()
    assert not any("random" in path.name for path in tmp_path.rglob("*"))
    record(ID, random_agent(), 1, NAME, INSTANCES, arguments=ARGUMENTS)
    assert minari.load_dataset(NAME).total_episodes == 1


# --- One command for all --------------------------------------------------------------------


@pytest.fixture
def small(tmp_path, monkeypatch):
    """A quick oracle, and a cache of its own for episodes."""
    search = Search(width=1, hold=25, courant=(), sound=(), xsph=())
    quick = build_datasets.POLICIES["oracle"]._replace(make=lambda seed: Oracle(search))
    monkeypatch.setitem(build_datasets.POLICIES, "oracle", quick)
    kept = tmp_path / "cache" / "episodes"
    monkeypatch.setattr(build_datasets, "cache_home", lambda: kept.parent)
    return kept


COMMAND = ["dataset", "--scenes", "patch_impact", "--instances", "val", "--episodes", "2"]


def ids(*policies):
    return [f"sph_gym/patch_impact/{policy}-val-v1" for policy in policies]


def test_one_command_records_the_rule_the_oracle_and_random(small, capsys):
    assert main(COMMAND) == 0
    usual = ids("tuned-rule", "oracle", "random")
    assert capsys.readouterr().out.split() == usual
    assert set(minari.list_local_datasets()) == set(usual)
    assert list(small.iterdir()) == []
    returns = {}
    for id_ in usual:
        data = minari.load_dataset(id_)
        about = list(data.storage.get_episode_metadata([0, 1]))
        assert [one["instance_id"] for one in about] == ["patch_impact/val/0", "patch_impact/val/1"]
        returns[id_] = sum(one["rewards_sum"] for one in about)
        assert data.storage.metadata["manifest_version"] == manifest.VERSION
        assert data.storage.metadata["algorithm_name"] in id_
        # it can be played again
        env = data.recover_environment()
        observation, _ = env.reset(seed=about[1]["seed"], options=about[1]["options"])
        assert np.array_equal(observation, data[1].observations[0])
        reward = env.step(data[1].actions[0])[1]
        assert reward == data[1].rewards[0]
    assert returns[usual[0]] > returns[usual[2]]


def test_what_is_there_is_left_alone_and_other_episodes_are_refused(small, monkeypatch, capsys):
    command = [*COMMAND, "--policies", "random"]
    assert main(command) == 0
    monkeypatch.setattr(dataset, "play", lambda *rest: pytest.fail("played again"))
    assert main(command) == 0
    assert capsys.readouterr().out.split() == ids("random", "random")
    assert main([*command[:-3], "1", *command[-2:]]) == 2
    assert "is there with other episodes (2 of them)" in capsys.readouterr().err


def test_a_dataset_of_older_layouts_is_not_taken_for_a_present_one(small, monkeypatch, capsys):
    command = [*COMMAND, "--policies", "random"]
    assert main(command) == 0
    monkeypatch.setattr(observations, "VERSION", observations.VERSION + 1)
    assert main(command) == 2
    assert "has the layouts features v" in capsys.readouterr().err


def test_finished_episodes_survive_ctrl_c(small, monkeypatch, capsys):
    command, played, play = [*COMMAND, "--policies", "random"], [], dataset.play

    def interrupted(env, policy, seed, instance):
        if played:
            raise KeyboardInterrupt
        played.append(seed)
        return play(env, policy, seed, instance)

    with monkeypatch.context() as patch:
        patch.setattr(dataset, "play", interrupted)
        assert main(command) == 130
    (kept,) = small.glob("*.npz")
    assert minari.list_local_datasets() == {}
    seeds = []
    with monkeypatch.context() as patch:
        patch.setattr(dataset, "play", lambda *rest: seeds.append(rest[2]) or play(*rest))
        assert main(command) == 0
    assert (played, seeds) == ([0], [1])
    # what was kept is what would have been played
    (id_,) = ids("random")
    first = minari.load_dataset(id_)[0]
    env = gym.make("sph_gym/PatchImpact-v1")
    again = play(env, draw_at_random(0), 0, "patch_impact/val/0")
    assert np.array_equal(first.observations, again.observations)
    assert np.array_equal(first.actions, again.actions)
    assert first.rewards.tolist() == again.rewards
    for name, values in again.infos.items():
        found = first.infos[name].tolist()
        assert [v.decode() if isinstance(v, bytes) else v for v in found] == values, name
    assert not kept.exists()


@pytest.mark.filterwarnings("ignore:.*is damaged, its episode is played again")
def test_a_damaged_episode_is_played_again(small):
    plan = build_datasets.Plan("patch_impact", "random", "val", 1)
    path = build_datasets._kept(plan, 0)
    path.parent.mkdir(parents=True)
    path.write_bytes(b"PK torn")
    assert list(build_datasets.collect(["patch_impact"], ["random"], 1, "val")) == [plan.id]
    assert minari.load_dataset(plan.id).total_episodes == 1


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--scenes", "lake"], "scenes: expected one of"),
        (["--policies", "luck"], "policies: expected one of tuned-rule, oracle, random"),
        (["--episodes", "0"], "episodes: expected"),
        (["--episodes", "17", "--instances", "val"], "episodes: expected at most 16"),
        (["--instances", "exam"], "instances: expected one of"),
    ],
)
def test_wrong_words_are_refused_before_anything_is_played(arguments, text, small, capsys):
    assert main(["dataset", *arguments]) == 2
    assert text in capsys.readouterr().err


OWN = {"scene": scenes.make("drop_impact", dx=0.08)}


@pytest.mark.every(4)
@pytest.mark.filterwarnings("ignore:.* is set to None")
# minari leaves its temporary folder to the garbage collector
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("infos", [False, True])
@pytest.mark.parametrize(
    ("id_", "arguments"),
    [(ID, ARGUMENTS), ("sph_gym/Custom-v1", OWN), (ID, {**ARGUMENTS, "observation": "field"})],
    ids=["named", "own", "field"],
)
def test_the_collector_of_minari_works(id_, arguments, infos):
    pytest.importorskip("jax")
    env = minari.DataCollector(gym.make(id_, **arguments), record_infos=infos)
    seen, over = [env.reset(seed=0)[0]], False
    while not over:
        observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
        seen.append(observation)
        over = terminated or truncated
    env.create_dataset("test/collected-v1")
    env.close()
    del env
    gc.collect()
    data = minari.load_dataset("test/collected-v1")
    (episode,) = data
    assert np.array_equal(episode.observations, seen)
    assert ("time" in (episode.infos or {})) == infos
    assert np.array_equal(data.recover_environment().reset(seed=0)[0], seen[0])
