import copy
import gc
import os
import pickle
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

import sph_gym
from sph_gym import scenes
from sph_gym.env import SCENES, env_id, registration, rewards, scene_of, selection
from sph_gym.env.episode import INFO
from sph_gym.env.fingerprint import digest, fingerprint
from sph_gym.env.instances import DIAGNOSTIC
from sph_gym.studies import contract

IDS = [env_id(scene) for scene in SCENES]
FLOATS = [name for name, (unit, _) in INFO.items() if unit != "text"]
TEXTS = ["instance_id", "context", "blowup_cause"]
COARSE = {"dx": 0.08}
MUSH = np.array([1.0, -1.0, 0.0], np.float32)
GENTLE = np.array([-0.3, -0.2, 0.0], np.float32)


@pytest.fixture
def env():
    made = gym.make("sph_gym/DamBreak-v1", **COARSE).unwrapped
    yield made
    made.close()


def rollout(env, seed, n_steps=30):
    env.action_space.seed(seed)
    observation, info = env.reset(seed=seed)
    trace = [(observation, 0.0, info)]
    for _ in range(n_steps):
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        trace.append((observation, reward, info))
        if terminated or truncated:
            break
    return trace


@pytest.mark.parametrize("id_", IDS)
def test_rollouts_are_equal_to_the_last_bit(id_):
    first, second = (rollout(gym.make(id_, **COARSE).unwrapped, seed=3) for _ in range(2))
    assert len(first) == len(second)
    for (one, reward, info), (other, same_reward, same_info) in zip(first, second, strict=True):
        assert np.array_equal(one, other)
        assert reward == same_reward
        assert info == same_info


@pytest.mark.every(3)
@pytest.mark.parametrize("id_", IDS)
def test_observations_stay_in_their_space_whatever_is_done(id_):
    env = gym.make(id_, instances="train", **COARSE).unwrapped
    rng = np.random.default_rng(0)
    for seed in range(3):
        env.reset(seed=seed)
        over = False
        while not over:
            action = rng.choice([-1.0, 0.0, 1.0], 3).astype(np.float32)
            observation, reward, terminated, truncated, info = env.step(action)
            assert env.observation_space.contains(observation)
            assert np.isfinite(reward)
            assert all(np.isfinite(info[name]) for name in FLOATS)
            over = terminated or truncated


def test_info_is_flat_and_the_terms_sum_to_the_reward(env):
    for _, reward, info in rollout(env, 0):
        assert sorted(info) == sorted([*FLOATS, *TEXTS])
        assert all(type(info[name]) is float for name in FLOATS)
        assert reward == pytest.approx(sum(info[f"reward_{term}"] for term in rewards.TERMS))


def test_an_episode_is_truncated_after_its_duration(env):
    env.reset(seed=0)
    truncated = terminated = False
    steps = 0
    while not (truncated or terminated):
        *_, terminated, truncated, info = env.step(GENTLE)
        steps += 1
    assert truncated
    assert not terminated
    assert steps == env.n_steps == round(env.sim.scene.duration / env.sim.scene.frame)
    assert info["time"] == pytest.approx(env.n_steps * env.sim.scene.frame)
    with pytest.raises(ResetNeeded):
        env.step(GENTLE)


def test_a_blowup_terminates_with_the_worst_for_all_that_is_left():
    env = gym.make("sph_gym/HydrostaticTank-v1").unwrapped
    env.reset(seed=0)
    total, steps, terminated = 0.0, 0, False
    while not terminated:
        observation, reward, terminated, truncated, info = env.step(MUSH)
        total, steps = total + reward, steps + 1
        assert not truncated
    assert info["blowup"] == 1.0
    assert info["blowup_cause"] in {"cfl", "stiffness", "clumping", "tunnelling", "energy", "nan"}
    assert info["reward_blowup"] == -rewards.WORST * (env.n_steps - steps + 1)
    assert env.observation_space.contains(observation)
    assert total < -rewards.WORST * (env.n_steps - steps)


def test_the_environments_generator_draws_the_instance(env):
    env = gym.make("sph_gym/Relaxation-v1", instances="train", **COARSE).unwrapped
    drawn = []
    env.reset(seed=5)
    for _ in range(4):
        drawn.append(env.instance_id)
        env.reset()
    env.reset(seed=5)
    assert env.instance_id == drawn[0]
    assert len(set(drawn)) > 1


def test_options_choose_the_instance(env):
    _, info = env.reset(options={"instance": "dam_break/val/3"})
    # an id means one flow, whatever the environment's own spacing
    assert info["instance_id"] == "dam_break/val/3"
    assert env.episode.scene.dx == 0.04
    _, info = env.reset(options={"instance": "dam_break/val/3/dx=0.08"})
    assert info["instance_id"] == "dam_break/val/3/dx=0.08"
    assert env.episode.scene.dx == 0.08
    with pytest.raises(ValueError, match="instance"):
        env.reset(options={"instance": "dam_break/val/300"})


@pytest.mark.parametrize(
    "action",
    [
        [np.nan] * 3, [2.0, 0, 0], [0.0], [[0.0] * 3], [0.0, [1.0], 0.0], "fast", None, {},
        ["0", "0", "0"], [True] * 3, [1j, 0, 0], [10**400, 0, 0],
    ],
    ids=str,
)  # fmt: skip
def test_wrong_actions_are_refused_and_nothing_moves(env, action):
    env.reset(seed=0)
    with pytest.raises(ValueError, match="action: expected"):
        env.step(action)
    assert env.sim.time == 0.0


@pytest.mark.parametrize("choice", [-1, 27, 10**400, 3.0, "3", None, [3], True, np.zeros(1, int)])
def test_wrong_choices_are_refused_and_nothing_moves(choice):
    made = sph_gym.TuningEnv("dam_break", **COARSE, action_mode="discrete")
    made.reset(seed=0)
    with pytest.raises(ValueError, match="action: expected"):
        made.step(choice)
    assert made.sim.time == 0.0


def test_step_and_render_before_reset_are_refused():
    env = gym.make("sph_gym/DamBreak-v1", render_mode="rgb_array", **COARSE).unwrapped
    with pytest.raises(ResetNeeded):
        env.step(GENTLE)
    with pytest.raises(ResetNeeded):
        env.render()


@pytest.mark.parametrize(
    "arguments",
    [
        {"dx": -1.0}, {"dx": "fine"}, {"instances": "exam"}, {"action_mode": "x"},
        {"on_blowup": "ignore"}, {"observation": "all"}, {"render_mode": "film"},
        {"reward_weights": {"luck": 1.0}}, {"scene": "lake"}, {"reward": "sum"},
        {"tolerances": {"luck": 1.0}}, {"tolerances": {"com_drift": 0.0}}, {"rate_limit": 0.5},
    ],
    ids=str,
)  # fmt: skip
def test_wrong_arguments_are_refused(arguments):
    (name,) = arguments
    with pytest.raises(ValueError, match=name):
        sph_gym.TuningEnv(**({"scene": "dam_break"} | arguments))


def test_unknown_arguments_are_named():
    with pytest.raises(TypeError, match="'luck'"):
        gym.make("sph_gym/DamBreak-v1", luck=1.0)


def test_weights_scale_their_terms():
    env = gym.make("sph_gym/DamBreak-v1", reward_weights={"work": 2.0}, **COARSE).unwrapped
    plain = gym.make("sph_gym/DamBreak-v1", **COARSE).unwrapped
    for one in (env, plain):
        one.reset(seed=0)
    reward, same = env.step(GENTLE)[1], plain.step(GENTLE)[1]
    assert same > 0
    assert reward == pytest.approx(2 * same)


def test_a_scene_of_the_users_own():
    scene = scenes.make("drop_impact", dx=0.06)
    env = gym.make("sph_gym/Custom-v1", scene=scene).unwrapped
    _, info = env.reset(seed=0)
    assert info["instance_id"] == f"drop_impact/custom/{fingerprint(scene)}"
    env.step(GENTLE)
    with pytest.raises(ValueError, match="instances"):
        gym.make("sph_gym/Custom-v1", scene=scene, instances="train")


def test_pickle_and_deepcopy_go_on_alike(env):
    env.reset(seed=0)
    env.step(GENTLE)
    for twin in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        ours = copy.deepcopy(env).step(GENTLE)
        theirs = twin.step(GENTLE)
        assert np.array_equal(ours[0], theirs[0])
        assert ours[1:] == theirs[1:]


def test_work_is_counted_in_substeps_of_the_tuned_rule(env):
    env.reset(seed=0)
    info = env.step(GENTLE)[4]
    assert info["work"] == info["n_substeps"] / env.episode.reference.cfl_substeps


def test_ids_and_scenes_name_each_other():
    assert [scene_of(id_) for id_ in IDS] == list(SCENES)
    with pytest.raises(ValueError, match="DamBreak"):
        scene_of("sph_gym/Lake-v1")


def test_vector_environments_draw_and_agree_with_single_ones():
    envs = gym.make_vec("sph_gym/Relaxation-v1", num_envs=2, vectorization_mode="sync", **COARSE)
    observations, _ = envs.reset(seed=7)
    for k in range(2):
        single, _ = gym.make("sph_gym/Relaxation-v1", **COARSE).reset(seed=7 + k)
        assert np.array_equal(observations[k], single)


# --- Rollback, states, limits ---------------------------------------------------------------

RECKLESS = np.array([1.0, 1.0, -1.0], np.float32)
TANK = {"scene": "hydrostatic_tank", "dx": 0.03}


def blow_up(env):
    """Step recklessly until the solver blows up; that step's result."""
    env.reset(seed=0)
    for _ in range(env.n_steps):
        result = env.step(RECKLESS)
        if result[4]["blowup"]:
            return result
    pytest.fail("nothing blew up")


def test_a_rollback_pays_and_goes_back_to_where_the_step_began():
    env = sph_gym.TuningEnv(**TANK, on_blowup="rollback")
    env.reset(seed=0)
    before = info = None
    while info is None or not info["blowup"]:
        before = env.sim.snapshot()
        observation, reward, terminated, truncated, info = env.step(RECKLESS)
    assert reward == -rewards.WORST
    assert not terminated
    assert not truncated
    assert (info["rollbacks"], info["blowup_cause"] != "") == (1.0, True)
    assert observation[-1] == pytest.approx(1 / 3)
    after = env.sim.snapshot()
    assert after["time"] == before["time"] < info["time"] == info["time_to_failure"]
    assert all(np.array_equal(after["fluid"][k], before["fluid"][k]) for k in before["fluid"])
    # a careful step goes on from there, and the count begins anew
    observation, *_, info = env.step(np.array([-0.8, 0.6, 0.0], np.float32))
    assert (info["blowup"], info["rollbacks"], observation[-1]) == (0.0, 0.0, 0.0)


def test_rollbacks_in_a_row_end():
    env = sph_gym.TuningEnv(**TANK, on_blowup="rollback")
    env.reset(seed=0)
    in_a_row, terminated = [], False
    while not terminated:
        *_, terminated, _, info = env.step(RECKLESS)
        if info["blowup"]:
            in_a_row.append(info["rollbacks"])
    assert in_a_row == [1.0, 2.0, 3.0, 0.0]
    # steps that were taken back are no part of the flow
    numbers = env.sim.diagnostics()
    for name in ("blowup_substep", "time_to_failure"):
        assert info[name] == numbers[name] > 0
    assert info["blowup_substep"] * info["dt"] < 2 * info["time_to_failure"]
    assert info["reward_blowup"] < -rewards.WORST


def test_a_blowup_tells_when():
    *_, terminated, _, info = blow_up(sph_gym.TuningEnv(**TANK))
    assert terminated
    assert info["blowup_substep"] >= info["n_substeps"] > 0
    assert 0 <= info["time_to_failure"] == info["time"]


@pytest.mark.parametrize("on_blowup", ["terminate", "rollback"])
def test_a_state_that_is_taken_back_goes_on_alike(on_blowup):
    made = sph_gym.TuningEnv("drop_impact", dx=0.06, instances="train", on_blowup=on_blowup)
    made.action_space.seed(0)
    made.reset(seed=4)
    for _ in range(5):
        made.step(made.action_space.sample())
    state = pickle.loads(pickle.dumps(made.get_state()))
    actions = [made.action_space.sample() for _ in range(10)]
    first = [made.step(action) for action in actions if not made.episode.over]
    made.reset()
    other = sph_gym.TuningEnv("drop_impact", dx=0.06, instances="train", on_blowup=on_blowup)
    for env in (made, other):
        env.set_state(state)
        again = [env.step(action) for action in actions if not env.episode.over]
        assert len(again) == len(first)
        for one, two in zip(first, again, strict=True):
            assert np.array_equal(one[0], two[0])
            assert one[1:] == two[1:]
        env.reset()
    assert made.instance_id == other.instance_id


def test_a_state_tells_the_spacing_of_its_flow():
    arguments = {"scene": "dam_break", "dx": 0.08, "instances": "train"}
    made, other = sph_gym.TuningEnv(**arguments), sph_gym.TuningEnv(**arguments)
    # sizes are multiples of dx, so that both flows have as many particles
    made.reset(seed=0, options={"instance": "dam_break/train/17"})
    other.set_state(made.get_state())
    assert other.instance_id == made.instance_id == "dam_break/train/17"
    assert other.episode.scene.dx == made.episode.scene.dx == 0.04
    assert made.step(GENTLE)[1:] == other.step(GENTLE)[1:]


def test_states_of_another_scene_of_ones_own_are_refused():
    one, other = (
        sph_gym.TuningEnv(scenes.make("patch_impact", dx=0.1, gap=gap)) for gap in (0.2, 0.4)
    )
    one.reset(seed=0)
    with pytest.raises(ValueError, match="instance"):
        other.set_state(one.get_state())


CHANGES = {
    "coordinates": lambda old: old + 1e-12,
    "past": lambda old: old[:-1],
    "numbers": lambda old: {**old, "mach": np.nan},
    "step": lambda old: old + 1,
    "over": lambda old: True,
    "rollbacks": lambda old: old + 1,
    "control_work": lambda old: None,
    "report": lambda old: old[:-1],
    "info": lambda old: {**old, "work": 0.0},
    "simulation": lambda old: {**old, "time": 9.0},
}


@pytest.mark.parametrize("part", CHANGES)
def test_a_state_that_was_changed_is_refused_and_nothing_moves(env, part):
    env.reset(seed=0)
    for _ in range(2):
        env.step(GENTLE)
    state = env.get_state()
    env.step(GENTLE)
    before = env.get_state()
    episode = state["episode"]
    changed = {**episode, part: CHANGES[part](episode[part])}
    without = {name: value for name, value in episode.items() if name != part}
    for wrong in (changed, without):
        with pytest.raises(ValueError, match=r"state: .*checksum"):
            env.set_state({**state, "episode": wrong})
        assert contract.same(env.get_state(), before)


def sealed(state, **changes):
    """A changed state whose checksum is right."""
    changed = {name: value for name, value in (state | changes).items() if name != "checksum"}
    return changed | {"checksum": digest(changed)}


def test_whatever_the_checksum_says_the_solver_and_the_generator_check_their_own(env):
    env.reset(seed=0)
    env.step(GENTLE)
    state = env.get_state()
    env.step(GENTLE)
    before, episode = env.get_state(), state["episode"]
    wrongs = [{"episode": {**episode, "simulation": wrong}} for wrong in (None, {})]
    wrongs += [{"generator": wrong} for wrong in ({}, None, {"bit_generator": "MT19937"})]
    wrongs += [{"version": 0}, {"instance": "dam_break/val/x"}, {"instance": "relaxation/val/1"}]
    for wrong in wrongs:
        with pytest.raises(ValueError, match=r"state|snapshot|instance"):
            env.set_state(sealed(state, **wrong))
        assert contract.same(env.get_state(), before)
    env.set_state(sealed(state))


@pytest.mark.parametrize(
    "other",
    [
        {"action_mode": "delta"}, {"on_blowup": "rollback"}, {"observation": "field"},
        {"rate_limit": 2.0}, {"reward_weights": {"work": 2.0}}, {"tolerances": {"spread": 1.0}},
    ],
    ids=str,
)  # fmt: skip
def test_states_of_environments_with_other_rules_are_refused(env, other):
    theirs = sph_gym.TuningEnv("dam_break", **COARSE, **other)
    (name,) = other
    for one, two in ((env, theirs), (theirs, env)):
        one.reset(seed=0)
        two.reset(seed=1)
        before = two.get_state()
        with pytest.raises(ValueError, match=f"state: of an environment with {name} = "):
            two.set_state(one.get_state())
        assert contract.same(two.get_state(), before)


def test_a_state_is_made_of_plain_arrays_numbers_and_texts(env):
    def look_at(value):
        if isinstance(value, dict):
            assert all(type(key) is str for key in value)
            for each in value.values():
                look_at(each)
        elif type(value) in (list, tuple):
            for each in value:
                look_at(each)
        else:
            assert type(value) in (np.ndarray, int, float, bool, str, type(None)), value

    env.reset(seed=0)
    env.step(GENTLE)
    look_at(env.get_state()["episode"])


@pytest.mark.parametrize("on_blowup", ["terminate", "rollback"])
def test_every_state_of_an_episode_can_be_taken_back(on_blowup):
    made = sph_gym.TuningEnv(**TANK, on_blowup=on_blowup)
    made.reset(seed=0)
    blowups = 0.0
    while not made.episode.over:
        *_, info = made.step(RECKLESS)
        blowups += info["blowup"]
        state = made.get_state()
        made.set_state(state)
        assert contract.same(made.get_state(), state)
    assert blowups == (4 if on_blowup == "rollback" else 1)


@pytest.mark.parametrize("arguments", [{"scene": "dam_break"}, {"scene": "mixed"}], ids=str)
def test_a_spacing_that_is_too_coarse_is_refused_at_the_door(arguments):
    with pytest.raises(ValueError, match="dx"):
        sph_gym.TuningEnv(**arguments, dx=10.0)


def test_other_states_are_refused(env):
    env.reset(seed=0)
    for wrong in (None, {}, {"instance": "dam_break/nominal/0", "episode": {}, "generator": {}}):
        with pytest.raises(ValueError, match="state"):
            env.set_state(wrong)


def test_a_rate_limit_holds_the_sound_speed_back():
    made = sph_gym.TuningEnv("dam_break", **COARSE, rate_limit=2.0)
    made.reset(seed=0)
    c = made.sim.sound_speed
    for factor in (1 / 2, 1 / 4):
        made.step(np.array([-1.0, -1.0, 0.0], np.float32))
        assert made.sim.sound_speed == pytest.approx(factor * c)


def test_the_work_of_the_controls_is_told(env):
    env.reset(seed=0)
    for _ in range(20):
        env.step(GENTLE)
    held = env.sim.diagnostics()["internal_energy"]
    wanted = env.sim.controls._replace(stiffness=1.5 * env.sim.controls.stiffness)
    info = env.step(env.action_toward(wanted))[4]
    assert info["control_work"] == pytest.approx(0.5 * held, rel=1e-5)
    assert env.step(env.action_toward(wanted))[4]["control_work"] == pytest.approx(0.0, abs=1e-9)


# --- Variants -------------------------------------------------------------------------------


def test_a_vector_reward_holds_the_terms():
    made = sph_gym.TuningEnv("dam_break", **COARSE, reward="vector")
    made.reset(seed=0)
    _, reward, _, _, info = made.step(GENTLE)
    assert made.reward_space.contains(reward)
    assert reward.shape == (made.reward_dim,)
    assert reward.tolist() == pytest.approx([info[f"reward_{term}"] for term in rewards.TERMS])
    assert made.reward_space.contains(blow_up(sph_gym.TuningEnv(**TANK, reward="vector"))[1])


def test_masks_leave_no_action_that_does_what_another_does():
    made = sph_gym.TuningEnv("dam_break", **COARSE, action_mode="discrete")
    made.reset(seed=0)
    masks = made.action_masks()
    assert masks.shape == (27,)
    assert masks[13]
    act, present = made.rules.actions.act, made.episode.coordinates
    allowed = {tuple(act(k, present, made.episode.scene)) for k in np.flatnonzero(masks)}
    assert len(allowed) == masks.sum()
    assert allowed == {tuple(act(k, present, made.episode.scene)) for k in range(27)}
    plain = sph_gym.TuningEnv("dam_break", **COARSE)
    plain.reset(seed=0)
    with pytest.raises(AttributeError, match="discrete"):
        plain.action_masks()


def test_masks_leave_out_what_does_nothing_in_this_environment():
    made = sph_gym.TuningEnv("dam_break", **COARSE, action_mode="discrete", rate_limit=1.0)
    made.reset(seed=0)
    assert made.action_masks().sum() <= 9
    free = sph_gym.TuningEnv("dam_break", **COARSE, action_mode="discrete").rules
    plain = replace(made.episode.scene, effects=sph_gym.Effects())
    assert free.masks(plain, np.zeros(3)).sum() == 9


def test_a_field_shows_where_the_fluid_is_and_goes():
    made = sph_gym.TuningEnv("dam_break", dx=0.04, observation="field")
    picture, _ = made.reset(seed=0)
    assert made.observation_space.contains(picture)
    assert picture[0, :, :8].max() > 100  # the column at the left
    assert picture[0, :, 20:].max() == 0
    assert (picture[1:3] == 128).all()
    for _ in range(20):
        picture, *_ = made.step(GENTLE)
    assert picture[1, -4].max() > 140  # to the right
    assert picture[2, :, :4].min() < 120  # downwards
    assert len(np.unique(picture[3, :9])) == 1


def test_mixed_draws_from_all_scenes():
    made = gym.make("sph_gym/Mixed-v1", dx=0.06).unwrapped
    made.reset(seed=0)
    drawn = set()
    for _ in range(40):
        drawn.add(made.selection.draw(made.np_random, None)[0].split("/")[0])
    assert drawn == set(SCENES)
    _, info = made.reset(options={"instance": "patch_impact/val/1"})
    assert info["instance_id"] == "patch_impact/val/1"


def test_the_groups_that_have_an_id_are_those_that_scenes_are_drawn_from():
    assert tuple(selection.GROUPS) == registration.GROUPS


def test_benchmark_draws_from_all_scenes_that_are_no_diagnostics():
    made = gym.make("sph_gym/Benchmark-v1", dx=0.06).unwrapped
    rng = np.random.default_rng(0)
    drawn = {made.selection.draw(rng, None)[0].split("/")[0] for _ in range(40)}
    assert drawn == set(SCENES) - set(DIAGNOSTIC)
    with pytest.raises(ValueError, match="scene of the instance: expected one of dam_break"):
        made.reset(options={"instance": "relaxation/val/1"})


def test_without_a_screen_the_environment_says_so_once_and_goes_on(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "nonsense")
    env = sph_gym.TuningEnv("dam_break", render_mode="human", **COARSE)
    with pytest.warns(UserWarning, match="human.*no screen.*nothing is shown"):
        env.reset(seed=0)
    env.step(GENTLE)
    assert os.environ["SDL_VIDEODRIVER"] == "nonsense"
    env.close()


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # moviepy leaves a pipe open
def test_a_video_is_recorded(tmp_path):
    pytest.importorskip("moviepy")
    env = gym.make("sph_gym/DamBreak-v1", render_mode="rgb_array", **COARSE)
    env = gym.wrappers.RecordVideo(env, str(tmp_path / "films"), video_length=3)
    env.reset(seed=0)
    for _ in range(4):
        env.step(GENTLE)
    env.close()
    gc.collect()
    (film,) = tmp_path.glob("films/*.mp4")
    assert film.stat().st_size > 1000


@pytest.mark.parametrize("wrong", [(-1e-3, 1e5, 0.3), (1e-3, 1e5), None])
def test_only_controls_have_an_action(env, wrong):
    env.reset(seed=0)
    with pytest.raises(ValueError, match="controls"):
        env.action_toward(wrong)


def test_plain_numbers_are_controls(env):
    env.reset(seed=0)
    wanted = env.sim.controls
    assert np.array_equal(env.action_toward(tuple(wanted)), env.action_toward(wanted))
