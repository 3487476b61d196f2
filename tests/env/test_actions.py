import math
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sph_gym import Effects, Simulation, scenes
from sph_gym.controllers import TunedCfl
from sph_gym.controllers.rules import viscous_rate
from sph_gym.env import actions

SCENE = scenes.make("dam_break", dx=0.1)
COORDINATE = st.floats(-1, 1)


@given(st.tuples(COORDINATE, COORDINATE, COORDINATE))
def test_decoding_and_encoding_are_inverse(coordinates):
    there = actions.decode(SCENE, np.array(coordinates))
    assert actions.encode(SCENE, there) == pytest.approx(coordinates, abs=1e-9)


def test_plus_one_is_the_larger_of_the_documented_ranges():
    high = actions.decode(SCENE, np.ones(3))
    c = SCENE.fluid.sound_speed(high.stiffness)
    assert c == pytest.approx(actions.SOUND[1] * SCENE.fluid.c0)
    assert high.dt * c / SCENE.h == pytest.approx(actions.COURANT[1])
    assert high.xsph == actions.XSPH[1]
    low = actions.decode(SCENE, -np.ones(3))
    assert low.stiffness < high.stiffness
    assert low.xsph == 0.0


def test_dt_follows_the_stiffness_at_the_same_multiple():
    soft = actions.decode(SCENE, np.array([0.3, -1.0, 0.0]))
    stiff = actions.decode(SCENE, np.array([0.3, 1.0, 0.0]))
    ratio = math.sqrt(stiff.stiffness / soft.stiffness)
    assert soft.dt / stiff.dt == pytest.approx(ratio)


@pytest.mark.parametrize("mode", actions.MODES)
def test_toward_gets_there_in_the_end(mode):
    kind = actions.make(mode)
    wanted, present = np.array([0.5, -0.75, 1.0]), np.zeros(3)
    for _ in range(10):
        action = kind.toward(wanted, present, SCENE)
        assert kind.space().contains(action)
        present = kind.act(action, present, SCENE)
    assert present == pytest.approx(wanted, abs=1e-6)


def viscous(alpha=0.1, nu=None):
    """The scene with other viscosities."""
    effects = replace(SCENE.effects, artificial_viscosity=alpha, laminar_viscosity=nu)
    return replace(SCENE, effects=effects)


def stable_dt(scene, action):
    """The step [s] and the sound speed [m/s] that a stable action asks for."""
    there = actions.make("stable").act(np.array(action), np.zeros(3), scene)
    controls = actions.decode(scene, there)
    return controls.dt, scene.fluid.sound_speed(controls.stiffness)


@given(st.floats(-1, 1), st.floats(-1, 1), st.sampled_from([0.0, 0.005, 0.1, 0.2]))
def test_a_stable_step_makes_room_for_friction(step, sound, alpha):
    scene = viscous(alpha or None)
    asked = actions.decode(scene, np.array([step, sound, 0.0]))
    c0, c_asked = scene.fluid.c0, scene.fluid.sound_speed(asked.stiffness)
    multiple = asked.dt * c_asked / scene.h
    friction = actions.FRICTION * viscous_rate(scene)
    dt, c = stable_dt(scene, (step, sound, 0.0))
    longest = multiple / (c / scene.h + friction)
    assert dt == pytest.approx(max(longest, actions.COURANT[0] * scene.h / c))
    if longest >= actions.COURANT[0] * scene.h / c_asked:
        assert c == pytest.approx(c_asked)
    else:
        # never stiffer than what makes waves as fast as friction
        assert c <= max(c_asked, friction * scene.h, actions.SOUND[0] * c0) * (1 + 1e-9)


def test_room_for_friction_is_that_of_the_tuned_rule():
    assert TunedCfl().courant == actions.FRICTION


@pytest.mark.parametrize("mode", ["absolute", "stable", "delta"])
def test_a_sound_speed_that_is_held_back_keeps_the_step_as_safe(mode):
    scene, kind = viscous(0.2), actions.make(mode)
    low = actions.locate(0.5, actions.SOUND[0], 0.0)
    there = kind.act(np.array([0.9, 1.0, 0.0]), low, scene, rate_limit=2.0)
    controls = actions.decode(scene, there)
    c = scene.fluid.sound_speed(controls.stiffness)
    assert c <= 2.0001 * actions.SOUND[0] * scene.fluid.c0
    if mode == "stable":
        asked = math.exp(actions.LOG_COURANT[1] - 0.05 * np.diff(actions.LOG_COURANT)[0])
        rate = c / scene.h + actions.FRICTION * viscous_rate(scene)
        assert controls.dt * rate == pytest.approx(asked)


@pytest.mark.parametrize("alpha", [0.005, 0.2, 1.0])
def test_the_limit_of_the_sound_speed_holds_where_friction_raises_it(alpha):
    scene, kind, factor = viscous(alpha), actions.make("stable"), 1.2
    rng = np.random.default_rng(0)
    present = actions.locate(0.5, 1.0, 0.0)
    for action in rng.uniform(-1.0, 1.0, (200, 3)):
        there = kind.act(action, present, scene, rate_limit=factor)
        before, after = (actions.decode(scene, each).stiffness for each in (present, there))
        # c goes with the root of the stiffness
        assert factor**-2.001 <= after / before <= factor**2.001
        assert np.abs(there).max() <= 1.0
        present = there


@pytest.mark.parametrize("alpha", [0.005, 0.02, 0.2])
def test_the_tuned_rules_step_is_one_number_in_every_fluid(alpha):
    scene, rule = viscous(alpha), TunedCfl()
    wanted = rule.at(Simulation(scene), {"flow_speed": 0.07 * scene.fluid.c0, "max_speed": 0.0})
    action = actions.make("stable").toward(actions.encode(scene, wanted), np.zeros(3), scene)
    assert action[0] == pytest.approx(actions.locate(rule.courant, 1.0, 0.0)[0], abs=1e-5)
    assert stable_dt(scene, action) == pytest.approx(
        (wanted.dt, scene.fluid.sound_speed(wanted.stiffness)), rel=1e-5
    )


def test_without_friction_stable_and_absolute_actions_are_the_same():
    scene, action = viscous(None), np.array([0.3, -0.6, 0.2])
    absolute, stable = (actions.make(mode) for mode in ("absolute", "stable"))
    assert stable.act(action, np.zeros(3), scene) == pytest.approx(
        absolute.act(action, np.zeros(3), scene), abs=1e-12
    )


def test_a_step_below_the_lowest_multiple_is_reached_by_a_stiffer_fluid():
    scene = viscous(0.8)
    dt, c = stable_dt(scene, (1.0, -1.0, 0.0))
    assert c > 1.5 * actions.SOUND[0] * scene.fluid.c0
    assert dt * c / scene.h == pytest.approx(actions.COURANT[0])
    longest = actions.COURANT[1] / (c / scene.h + 0.75 * viscous_rate(scene))
    assert dt == pytest.approx(longest)


def test_the_middle_discrete_action_changes_nothing():
    present = np.array([0.1, -0.2, 0.3])
    assert np.array_equal(actions.make("discrete").act(13, present, SCENE), present)


@pytest.mark.parametrize(
    ("mode", "action"),
    [
        ("absolute", [np.nan, 0, 0]),
        ("absolute", [0, 0]),
        ("absolute", [1.5, 0, 0]),
        ("absolute", [np.inf, 0, 0]),
        ("stable", [0, 0, np.nan]),
        ("delta", [0, 0, -1.01]),
        ("discrete", 27),
        ("discrete", -1),
        ("discrete", 1.5),
    ],
)
def test_wrong_actions_are_refused(mode, action):
    with pytest.raises(ValueError, match="action: expected"):
        actions.make(mode).act(action, np.zeros(3), SCENE)


def test_an_unknown_mode_is_refused():
    with pytest.raises(ValueError, match="action_mode: expected one of absolute, stable, delta"):
        actions.make("relative")


@pytest.mark.parametrize("xsph", [True, False])
@pytest.mark.parametrize("factor", [None, 1.0, 2.0])
@pytest.mark.parametrize("present", [(0.0, 0.0, 0.0), (1.0, -1.0, 0.5)])
def test_masks_allow_every_outcome_once(xsph, factor, present):
    scene, here = replace(SCENE, effects=Effects(xsph=xsph)), np.array(present)
    kind = actions.make("discrete")

    def outcome(action):
        there = kind.act(action, here, SCENE, factor)
        return tuple(there[: 3 if xsph else 2])

    masks = kind.masks(here, actions.useful(scene, factor))
    allowed = [outcome(action) for action in np.flatnonzero(masks)]
    assert len(set(allowed)) == len(allowed)
    assert set(allowed) == {outcome(action) for action in range(27)}


def test_moves_are_what_actions_do():
    kind = actions.make("discrete")
    done = [kind.act(action, np.zeros(3), SCENE) / actions.STEP for action in range(27)]
    assert np.array_equal(done, actions.MOVES)


@pytest.mark.parametrize("mode", ["absolute", "stable", "delta"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_what_is_a_rounding_beyond_the_bounds_is_cut_off(mode, dtype):
    kind, present = actions.make(mode), np.zeros(3)
    beyond = np.array([1 + 1e-6, -1 - 1e-6, 0.25], dtype)
    exact = np.array([1.0, -1.0, 0.25])
    assert np.array_equal(kind.act(beyond, present, SCENE), kind.act(exact, present, SCENE))


@pytest.mark.parametrize("mode", ["absolute", "stable", "delta"])
@pytest.mark.parametrize("beyond", [1e-5, 1e-3, 1.0])
def test_more_than_a_rounding_is_refused(mode, beyond):
    for action in ([1 + beyond, 0, 0], [0, -1 - beyond, 0], np.float32([0, 0, 1 + beyond])):
        with pytest.raises(ValueError, match=r"3 finite numbers in \[-1, 1\]"):
            actions.make(mode).act(action, np.zeros(3), SCENE)


def test_the_ends_of_rescaled_spaces_are_actions():
    class Box(gym.Env):
        action_space, observation_space = actions.make("absolute").space(), gym.spaces.Discrete(1)

    rng = np.random.default_rng(0)
    for _ in range(500):
        low = rng.uniform(-5, 1)
        high = low + rng.uniform(0.1, 5)
        wrapped = gym.wrappers.RescaleAction(Box(), np.float32(low), np.float32(high))
        for end, wanted in ((wrapped.action_space.low, -1.0), (wrapped.action_space.high, 1.0)):
            found = actions.make("absolute").act(wrapped.action(end), np.zeros(3), SCENE)
            assert found == pytest.approx([wanted] * 3, abs=actions.ROUNDING)
            assert np.abs(found).max() <= 1.0
