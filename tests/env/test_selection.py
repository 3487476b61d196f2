"""Lists of flows, lengths of episodes, and specs that make an environment again."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from sph_gym import Scene, TuningEnv, scenes
from sph_gym.env import instances
from sph_gym.env.reference import n_frames
from sph_gym.env.selection import members
from sph_gym.env.vector import TuningVectorEnv

ID, CUSTOM = "sph_gym/DropImpact-v1", "sph_gym/Custom-v1"
LIST = ["drop_impact/test/3/dx=0.08", "drop_impact/val/1/dx=0.08", "drop_impact/train/7/dx=0.08"]
SCENE = scenes.make("drop_impact", dx=0.08)


def shown(env, n):
    """Return the ids of n resets."""
    return [env.reset()[1]["instance_id"] for _ in range(n)]


# --- Lists ----------------------------------------------------------------------------------


@pytest.mark.parametrize("chosen", [LIST, tuple(LIST)])
def test_a_list_is_shown_in_turn(chosen):
    env = gym.make(ID, instances=chosen)
    assert shown(env, 4) == [*LIST, LIST[0]]
    _, info = env.reset(seed=4)
    assert info["instance_id"] == LIST[1]
    assert shown(env, 2) == [LIST[2], LIST[0]]


def test_options_come_first_and_take_no_turn():
    env = TuningEnv("drop_impact", instances=LIST)
    other = "drop_impact/val/2/dx=0.08"
    assert env.reset(seed=1, options={"instance": other})[1]["instance_id"] == other
    assert shown(env, 1) == [LIST[1]]


def test_a_list_may_hold_flows_of_all_scenes_in_mixed():
    chosen = ["drop_impact/val/1/dx=0.08", "patch_impact/val/0/dx=0.08"]
    assert shown(TuningEnv("mixed", instances=chosen), 3) == [*chosen, chosen[0]]


def test_dx_is_that_of_ids_that_name_none():
    env = TuningEnv("drop_impact", 0.09, ["drop_impact/test/3", LIST[1]])
    assert shown(env, 2) == ["drop_impact/test/3/dx=0.09", LIST[1]]


@pytest.mark.parametrize(
    ("chosen", "text"),
    [
        ([], "instances: expected one of nominal, .* or a list of ids"),
        ({"drop_impact/val/1"}, "instances: expected one of"),
        (3, "instances: expected one of"),
        (["drop_impact/val/16"], "instance: expected a number from 0 to 15"),
        (["dam_break/val/1"], "scene of the instance: expected one of drop_impact"),
        (["val"], "instance: expected an id"),
        ([None], "instance: expected an id"),
        ("val/1", "instances: expected one of"),
        (LIST[0], r"instances: expected one of .* a list for a single flow, \['drop_impact/test/3"),
    ],
    ids=str,
)
def test_wrong_lists_are_refused(chosen, text):
    with pytest.raises(ValueError, match=text):
        TuningEnv("drop_impact", instances=chosen)


def test_a_state_remembers_the_turn():
    env = TuningEnv("drop_impact", instances=LIST)
    env.reset(seed=1)
    state = env.get_state()
    first = shown(env, 3)
    env.set_state(state)
    assert env.instance_id == LIST[1]
    assert shown(env, 3) == first == [LIST[2], LIST[0], LIST[1]]


@pytest.mark.parametrize("seed", [None, 5])
def test_the_environments_of_a_vector_show_a_list_from_different_places_on(seed):
    envs = TuningVectorEnv(2, scene="drop_impact", instances=LIST, max_episode_steps=2)
    _, info = envs.reset(seed=seed)
    first = seed or 0
    assert info["instance_id"].tolist() == [LIST[(first + k) % 3] for k in (0, 1)]
    for _ in range(3):  # to the autoreset
        *_, info = envs.step(envs.action_space.sample())
    assert info["instance_id"].tolist() == [LIST[(first + 1 + k) % 3] for k in (0, 1)]


def test_a_vector_shows_what_single_environments_do():
    def make():
        return gym.make(ID, instances=LIST, max_episode_steps=2)

    mode = AutoresetMode.SAME_STEP
    ours = gym.make_vec(ID, 2, instances=LIST, max_episode_steps=2, autoreset_mode=mode)
    theirs = SyncVectorEnv([make] * 2, autoreset_mode=mode)
    assert np.array_equal(ours.reset(seed=7)[0], theirs.reset(seed=7)[0])
    ours.action_space.seed(0)
    for _ in range(5):
        actions = ours.action_space.sample()
        assert np.array_equal(ours.step(actions)[0], theirs.step(actions)[0])


# --- Specs ----------------------------------------------------------------------------------


@pytest.mark.parametrize("given", [SCENE, SCENE.to_dict()], ids=["scene", "dictionary"])
def test_a_spec_with_a_scene_of_ones_own_is_json(given):
    env = gym.make(CUSTOM, scene=given, action_mode="delta")
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.selection.find(again.reset()[1]["instance_id"])
    for one in (env, again):
        one.reset(seed=0)
    for _ in range(3):
        action = env.action_space.sample()
        for a, b in zip(env.step(action), again.step(action), strict=True):
            assert np.array_equal(a, b)


def test_numbers_of_numpy_become_json_too():
    weights, chosen = {"work": np.float32(2.0)}, ("drop_impact/val/1",)
    env = gym.make(ID, dx=np.float32(0.0625), reward_weights=weights, instances=chosen)
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert np.array_equal(env.reset(seed=0)[0], again.reset(seed=0)[0])


def test_a_vector_of_ones_own_scene_can_be_made_again():
    envs = gym.make_vec(CUSTOM, 2, scene=SCENE, autoreset_mode=AutoresetMode.SAME_STEP)
    again = gym.make_vec(EnvSpec.from_json(envs.spec.to_json()))
    assert again.num_envs == 2
    assert again.autoreset_mode == AutoresetMode.SAME_STEP
    assert np.array_equal(envs.reset(seed=0)[0], again.reset(seed=0)[0])


@pytest.mark.parametrize("wrong", [{}, {"class": "Scene"}, SCENE.to_dict() | {"h": 0.0}])
def test_dictionaries_that_are_no_scene_are_refused(wrong):
    for make in (lambda: gym.make(CUSTOM, scene=wrong), lambda: TuningVectorEnv(2, scene=wrong)):
        with pytest.raises(ValueError, match="expected"):
            make()


@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
@pytest.mark.parametrize(
    ("id_", "scene", "right"),
    [
        ("sph_gym/DamBreak-v1", "drop_impact", ID),
        ("sph_gym/DamBreak-v1", "mixed", "sph_gym/Mixed-v1"),
        ("sph_gym/DamBreak-v1", SCENE, CUSTOM),
        ("sph_gym/DamBreak-v1", SCENE.to_dict(), CUSTOM),
        ("sph_gym/Benchmark-v1", "relaxation", "sph_gym/Relaxation-v1"),
        ("sph_gym/Mixed-v1", SCENE, CUSTOM),
    ],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_an_id_shows_no_other_scene_than_it_says(make, id_, scene, right):
    with pytest.raises(ValueError, match=rf"scene: expected '.*, which {id_} shows, .*'{right}'"):
        make(id_, scene=scene)


def test_an_id_may_be_told_its_own_scene_and_a_group_one_of_its_scenes():
    own = [(ID, "drop_impact"), ("sph_gym/Mixed-v1", "drop_impact"), (CUSTOM, "drop_impact")]
    for id_, name in [*own, ("sph_gym/Mixed-v1", "benchmark"), ("sph_gym/Benchmark-v1", None)]:
        given = {} if name is None else {"scene": name}
        for env in (gym.make(id_, **given).unwrapped, gym.make_vec(id_, 2, **given).envs[0]):
            assert env.selection.find("drop_impact/val/1/dx=0.08")


def test_a_group_without_one_scene_never_shows_it():
    env = gym.make("sph_gym/Benchmark-v1", scene="benchmark-long_fall", instances="val").unwrapped
    assert set(members("benchmark")) - set(members("benchmark-long_fall")) == {"long_fall"}
    with pytest.raises(ValueError, match="scene of the instance"):
        env.selection.find("long_fall/val/0")
    rng = np.random.default_rng(0)
    drawn = {env.selection.draw(rng, None)[0].split("/")[0] for _ in range(60)}
    assert drawn == set(members("benchmark-long_fall"))
    for wrong in ("benchmark-relaxation", "benchmark-", "dam_break-long_fall"):
        with pytest.raises(ValueError, match="scene"):
            members(wrong)
    with pytest.raises(ValueError, match="'sph_gym/Benchmark-v1'"):
        gym.make("sph_gym/DamBreak-v1", scene="benchmark-long_fall")


def test_an_id_of_ones_own_shows_any_scene():
    arguments = {"entry_point": "sph_gym.env.tuning:TuningEnv", "kwargs": {"scene": "dam_break"}}
    gym.register("mine/Flow-v0", **arguments)
    try:
        env = gym.make("mine/Flow-v0", scene="drop_impact")
    finally:
        del gym.registry["mine/Flow-v0"]
    assert env.unwrapped.selection.find(LIST[0])


@pytest.mark.parametrize(
    ("id_", "arguments", "n_steps"),
    [
        ("sph_gym/PatchImpact-v1", {}, 75),
        ("sph_gym/PatchImpact-v1", {"instances": "val"}, 75),
        ("sph_gym/LongFall-v1", {"instances": "test"}, 125),
        ("sph_gym/HydrostaticTank-v1", {"instances": "val"}, 120),
        ("sph_gym/PatchImpact-v1", {"instances": "ood"}, None),
        ("sph_gym/PatchImpact-v1", {"on_blowup": "rollback"}, None),
        ("sph_gym/DamBreak-v1", {}, 73),
        ("sph_gym/DamBreak-v1", {"instances": "val"}, None),
        ("sph_gym/DamBreak-v1", {"instances": ["dam_break/val/3"]}, 63),
        ("sph_gym/DamBreak-v1", {"instances": ["dam_break/val/3", "dam_break/val/4"]}, None),
        (ID, {"dx": 0.08}, 71),
        ("sph_gym/Mixed-v1", {}, None),
        (CUSTOM, {"scene": SCENE}, n_frames(SCENE)),
    ],
    ids=str,
)
def test_the_spec_tells_the_length_that_all_episodes_have(id_, arguments, n_steps):
    env, envs = gym.make(id_, **arguments), gym.make_vec(id_, 2, **arguments)
    assert env.spec.max_episode_steps == envs.spec.max_episode_steps == n_steps
    # it only tells: the environment itself truncates
    assert not isinstance(env, gym.wrappers.TimeLimit)
    assert envs.max_episode_steps is None


@pytest.mark.parametrize("name", ["patch_impact", "long_fall", "hydrostatic_tank"])
def test_the_length_is_that_of_the_flows(name):
    env = TuningEnv(name, instances="val")
    built = {n_frames(instances.instance(name, "val", k).build()) for k in range(16)}
    assert built == {env.fixed_length()}


def test_an_episode_is_as_long_as_the_spec_says_with_and_without_a_time_limit():
    env = gym.make(CUSTOM, scene=SCENE)
    limited = gym.make(env.spec)
    assert isinstance(limited, gym.wrappers.TimeLimit)
    action = np.array([0.2, -0.5, 0.0], np.float32)
    for one in (env, limited):
        one.reset(seed=0)
        ends = [one.step(action)[2:4] for _ in range(env.spec.max_episode_steps)]
        assert ends == [(False, False)] * (len(ends) - 1) + [(False, True)]


def test_a_limit_of_the_users_own_comes_first():
    assert gym.make(CUSTOM, scene=SCENE, max_episode_steps=5).spec.max_episode_steps == 5
    envs = gym.make_vec(CUSTOM, 2, scene=SCENE, max_episode_steps=5)
    again = gym.make_vec(EnvSpec.from_json(envs.spec.to_json()))
    assert again.max_episode_steps == envs.max_episode_steps == 5


def test_an_own_scene_keeps_its_name_and_number():
    env = gym.make(CUSTOM, scene=SCENE.to_dict())
    assert isinstance(env.unwrapped.selection.find(env.reset()[1]["instance_id"])[1], Scene)
    assert env.unwrapped.instance_id.startswith("drop_impact/custom/")
