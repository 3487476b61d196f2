import gc
import json

import gymnasium as gym
import numpy as np
import pytest

import sph_gym  # noqa: F401
from agents.policies import Spec, build
from sph_gym import scenes
from sph_gym.env import manifest
from sph_gym.env.dataset import record
from sph_gym.env.fingerprint import fingerprint
from sph_gym.env.rewards import TERMS

minari = pytest.importorskip("minari")

ID, ARGUMENTS = "sph_gym/DropImpact-v1", {"dx": 0.08}
INSTANCES = ["drop_impact/train/5/dx=0.08", "drop_impact/train/2/dx=0.08"]
NAME = "sph_gym/drop_impact/random-v0"


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

    for wrong in ("", "no spaces allowed-v0", "sph_gym/unversioned", None):
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


OWN = {"scene": scenes.make("drop_impact", dx=0.08)}


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
    env.create_dataset("test/collected-v0")
    env.close()
    del env
    gc.collect()
    data = minari.load_dataset("test/collected-v0")
    (episode,) = data
    assert np.array_equal(episode.observations, seen)
    assert ("time" in (episode.infos or {})) == infos
    assert np.array_equal(data.recover_environment().reset(seed=0)[0], seen[0])
