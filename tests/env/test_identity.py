"""What an environment says about its flow is enough to make it again."""

import json

import gymnasium as gym
import numpy as np
import pytest

import sph_gym
from sph_gym import scenes
from sph_gym.env import SCENES, contexts, instances, manifest
from sph_gym.env.distributions import FAMILIES, SHIFTS, draw
from sph_gym.env.fingerprint import fingerprint
from sph_gym.env.identity import identify
from sph_gym.env.vector import TuningVectorEnv


def identity(id_):
    return identify(id_, instances.parse(id_).build())


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("split", instances.SIZES)
def test_it_names_what_made_the_flow(scene, split):
    number = instances.SIZES[split] - 1
    found = identity(f"{scene}/{split}/{number}")
    assert (found.scene, found.split, found.number) == (scene, split, number)
    drawn = draw(scene, split, number, FAMILIES[scene].dx)
    assert (found.builder, dict(found.arguments)) == drawn[:2]
    if drawn.context is not None:
        context = contexts.Context(**found.context)
        assert context == pytest.approx(drawn.context) or drawn.context.viscosity == 0
        assert context.kind == drawn.context.kind
    listed = manifest.entry(found.id)
    assert found.manifest == ("" if listed is None else manifest.VERSION)
    assert listed is None or found.fingerprint == listed.fingerprint
    if split == "nominal":
        assert found.seed == ()
    else:
        rng = np.random.default_rng(found.seed)
        again = FAMILIES[scene].draw(rng, FAMILIES[scene].dx)
        changed = {"dx"} | ({FAMILIES[scene].odd[0]} if found.shift == "strength" else set())
        if found.shift != "scene":
            assert {**again, **{name: found.arguments[name] for name in changed}} == dict(
                found.arguments
            )


def test_it_says_which_shift_an_instance_of_ood_shows():
    assert set(instances.ODD) == set(SHIFTS)
    told = [identity(f"dam_break/ood/{k}").shift for k in range(16)]
    assert told == [*SHIFTS, *SHIFTS]
    assert instances.shift("dam_break/ood/9/dx=0.08") == SHIFTS[1]
    assert identity("dam_break/test/5").shift == instances.shift("dam_break/val/1") == ""
    assert identity("dam_break/ood/3").context["viscosity"] > 0
    assert identity("relaxation/ood/2").builder == "dam_break"


def test_only_what_a_manifest_lists_has_its_version():
    assert identity("dam_break/val/1/dx=0.08").manifest == ""
    other = instances.parse("dam_break/val/2").build()
    assert identify("dam_break/val/1", other).manifest == ""


def test_an_environment_tells_of_the_present_episode():
    env = gym.make("sph_gym/Mixed-v1", dx=0.08).unwrapped
    with pytest.raises(gym.error.ResetNeeded):
        _ = env.instance
    _, info = env.reset(seed=0, options={"instance": "drop_impact/ood/0"})
    assert env.instance == identity("drop_impact/ood/0")
    assert env.instance.id == info["instance_id"]
    assert json.loads(json.dumps(env.instance._asdict()))["shift"] == "resolution"
    envs = TuningVectorEnv(2, scene="drop_impact", dx=0.08, instances="train")
    envs.reset(seed=0)
    assert [each.id for each in envs.get_attr("instance")] == list(envs.get_attr("instance_id"))


def test_a_scene_of_ones_own_is_told_by_its_fingerprint():
    scene = scenes.make("drop_impact", dx=0.08)
    env = sph_gym.TuningEnv(scene)
    env.reset(seed=0)
    found = env.instance
    assert (found.scene, found.split, found.number) == ("drop_impact", "custom", None)
    assert (found.builder, found.arguments, found.seed, found.manifest) == ("", {}, (), "")
    assert found.fingerprint == fingerprint(scene)
    assert found.id == env.instance_id
