"""A vector of environments is as many single ones, to the last bit."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import sph_gym
from sph_gym.env.rewards import TERMS
from sph_gym.env.vector import TuningVectorEnv

ID, SHORT = "sph_gym/DropImpact-v1", 12
ARGUMENTS = {"dx": 0.08, "instances": "train"}


def vector(mode=AutoresetMode.NEXT_STEP, n=3, **more):
    arguments = ARGUMENTS | {"max_episode_steps": SHORT} | more
    return gym.make_vec(ID, num_envs=n, autoreset_mode=mode, **arguments)


def singles(mode=AutoresetMode.NEXT_STEP, n=3, **more):
    def make():
        return gym.make(ID, max_episode_steps=SHORT, **ARGUMENTS, **more)

    return SyncVectorEnv([make] * n, autoreset_mode=mode)


def assert_same(one, other):
    if isinstance(one, dict):
        assert set(one) == set(other)
        for key in one:
            assert_same(one[key], other[key])
    elif getattr(one, "dtype", None) == np.object_:
        assert other.dtype == object
        for a, b in zip(one, other, strict=True):
            assert type(a) is type(b)
            assert np.array_equal(a, b)
    else:
        one, other = np.asarray(one), np.asarray(other)
        assert one.dtype == other.dtype
        assert np.array_equal(one, other)


def test_gymnasium_makes_it():
    envs = vector()
    assert isinstance(envs.unwrapped, TuningVectorEnv)
    assert envs.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    assert envs.observation_space.shape == (3, 23)
    envs.close()


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize(
    "more", [{}, {"action_mode": "discrete", "on_blowup": "rollback"}], ids=str
)
def test_it_is_the_synchronous_vector(mode, more):
    ours, theirs = vector(mode, **more), singles(mode, **more)
    for one, other in zip(ours.reset(seed=1), theirs.reset(seed=1), strict=True):
        assert_same(one, other)
    ours.action_space.seed(0)
    for _ in range(2 * SHORT + 3):
        actions = ours.action_space.sample()
        for one, other in zip(ours.step(actions), theirs.step(actions), strict=True):
            assert_same(one, other)


def test_without_autoreset_the_mask_resets():
    ours, theirs = (make(AutoresetMode.DISABLED) for make in (vector, singles))
    for envs in (ours, theirs):
        envs.reset(seed=[5, 6, 7])
    action = np.zeros((3, 3), np.float32)
    for _ in range(SHORT):
        *_, truncated, _ = ours.step(action)
        theirs.step(action)
    assert truncated.all()
    with pytest.raises(ResetNeeded):
        ours.step(action)
    mask = np.array([True, False, True])
    results = [envs.reset(seed=9, options={"reset_mask": mask.copy()}) for envs in (ours, theirs)]
    for one, other in zip(*results, strict=True):
        assert_same(one, other)
    assert results[0][1]["_time"].tolist() == mask.tolist()


@pytest.mark.parametrize("threads", [1, 2])
def test_threads_change_nothing(threads):
    usual, other = vector(), vector(threads=threads)
    for envs in (usual, other):
        envs.reset(seed=3)
    usual.action_space.seed(1)
    for _ in range(5):
        actions = usual.action_space.sample()
        for one, two in zip(usual.step(actions), other.step(actions), strict=True):
            assert_same(one, two)


def test_scenes_with_different_frames_go_together():
    envs = gym.make_vec("sph_gym/Mixed-v1", num_envs=4, dx=0.06)
    envs.reset(seed=0)
    frames = [env.sim.scene.frame for env in envs.unwrapped.envs]
    assert len(set(frames)) > 1
    *_, infos = envs.step(np.zeros((4, 3), np.float32))
    assert infos["time"].tolist() == frames


def test_wrong_actions_move_nobody():
    envs = vector()
    envs.reset(seed=0)
    actions = np.zeros((3, 3), np.float32)
    actions[2, 1] = np.nan
    with pytest.raises(ValueError, match="action: expected"):
        envs.step(actions)
    assert [env.sim.time for env in envs.unwrapped.envs] == [0.0] * 3
    for wrong in (actions[:2], None, 0.0, "abc"):
        with pytest.raises(ValueError, match="expected"):
            envs.step(wrong)


def test_pictures_of_all():
    envs = vector(render_mode="rgb_array", n=2)
    envs.reset(seed=0)
    assert [picture.dtype for picture in envs.render()] == [np.uint8] * 2


@pytest.mark.parametrize(
    "arguments",
    [{"num_envs": 0}, {"threads": 0}, {"autoreset_mode": "never"}, {"max_episode_steps": 0},
     {"render_mode": "human"}, {"dx": -1.0}, {"num_envs": 2.5}, {"num_envs": "2"},
     {"max_episode_steps": 2.5}],
    ids=str,
)  # fmt: skip
def test_wrong_arguments_are_refused(arguments):
    (name,) = arguments
    with pytest.raises(ValueError, match=name):
        TuningVectorEnv(**({"scene": "dam_break"} | arguments))


@pytest.mark.parametrize("mask", [[True] * 3, np.zeros(3, bool), np.ones(2, bool), np.ones(3)])
def test_wrong_masks_are_refused(mask):
    envs = vector()
    with pytest.raises((TypeError, ValueError), match="reset_mask"):
        envs.reset(options={"reset_mask": mask})


def test_methods_and_attributes_of_all():
    envs = vector(n=2)
    envs.reset(seed=0)
    assert envs.unwrapped.get_attr("n_steps") == tuple(e.n_steps for e in envs.unwrapped.envs)
    states = envs.unwrapped.call("get_state")
    assert [state["instance"] for state in states] == list(envs.unwrapped.get_attr("instance_id"))
    assert sph_gym.TuningEnv is type(envs.unwrapped.envs[0])


def test_the_first_reset_is_of_all():
    envs = TuningVectorEnv(3, scene="drop_impact", **ARGUMENTS)
    with pytest.raises(ValueError, match=r"reset_mask: expected \[0, 2\] too"):
        envs.reset(seed=0, options={"reset_mask": np.array([False, True, False])})
    # and nothing has moved
    assert all(observation is None for observation in envs.observations)


def test_whole_numbers_may_be_written_as_floats():
    envs = TuningVectorEnv(2.0, scene="drop_impact", max_episode_steps=3.0, **ARGUMENTS)
    assert envs.reset(seed=4.0)[0].shape == envs.observation_space.shape == (2, 23)
    assert type(envs.num_envs) is type(envs.max_episode_steps) is int
    assert envs.np_random_seed == (4, 5)


@pytest.mark.parametrize("seed", [1.5, "12", -1, [0, 1.5], [0], {}, [0, -1], np.float64(0.5)])
def test_wrong_seeds_are_refused_and_nothing_is_reset(seed):
    envs = TuningVectorEnv(2, scene="drop_impact", **ARGUMENTS)
    with pytest.raises(ValueError, match="seed: expected"):
        envs.reset(seed=seed)
    assert envs.observations == [None, None]


def test_seeds_may_come_from_numpy_and_one_by_one():
    envs = TuningVectorEnv(2, scene="drop_impact", **ARGUMENTS)
    envs.reset(seed=np.int64(3))
    assert envs.np_random_seed == (3, 4)
    envs.reset(seed=np.array([7, 5]))
    assert envs.np_random_seed == (7, 5)
    envs.reset(seed=[None, 6])
    assert envs.np_random_seed == (7, 6)


def test_what_is_a_rounding_beyond_the_bounds_is_cut_off_in_vectors_too():
    ours, theirs = vector(n=2), vector(n=2)
    for envs in (ours, theirs):
        envs.reset(seed=0)
    beyond = np.full((2, 3), 1.000001, np.float32)
    results = zip(ours.step(beyond), theirs.step(np.ones((2, 3), np.float32)), strict=True)
    for one, other in results:
        assert_same(one, other)
    with pytest.raises(ValueError, match="action: expected"):
        ours.step(np.full((2, 3), 1.001, np.float32))


def test_the_spurious_energy_is_reported():
    envs = vector(n=2)
    _, info = envs.reset(seed=0)
    assert info["energy_excess"].tolist() == [0.0, 0.0]
    *_, info = envs.step(envs.action_space.sample())
    found = [env.sim.diagnostics()["energy_excess"] for env in envs.unwrapped.envs]
    assert info["energy_excess"].tolist() == found
    assert info["_energy_excess"].all()


def test_vector_rewards_have_all_terms_in_a_step_that_resets_too():
    envs = TuningVectorEnv(
        2, scene="drop_impact", dx=0.08, reward="vector", instances="val", max_episode_steps=2
    )
    envs.reset(seed=0)
    for _ in range(2):
        _, rewards, *_ = envs.step(envs.action_space.sample())
        assert rewards.shape == (2, len(TERMS))
    # the first plays its new episode, while the second is reset
    envs.reset(options={"reset_mask": np.array([True, False])})
    _, rewards, *_ = envs.step(envs.action_space.sample())
    assert rewards.shape == (2, len(TERMS))
    assert rewards[0].any()
    assert not rewards[1].any()
