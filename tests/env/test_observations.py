"""Observations and info: entries from their definitions, bounds, contexts, and what is hidden."""

import math
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

import sph_gym
from sph_gym.controllers.adaptive import no_memory
from sph_gym.env import actions, contexts, env_id, instances, observations
from sph_gym.env.observations import CONTEXT, FEATURES
from sph_gym.env.reference import ReferenceRun
from sph_gym.solver.stepping import COURANT, FORCE

# One of each kind of context, at a spacing at which an episode is quick.
NOISY, DAMPED, PLAIN = (f"drop_impact/val/{number}/dx=0.08" for number in (0, 1, 8))
NAMES = [feature.name for feature in FEATURES]
MOVE = np.array([-0.3, 0.2, 0.4], np.float32)


def made(observation="features", **more):
    return sph_gym.TuningEnv("drop_impact", dx=0.08, observation=observation, **more)


def begin(env, id_, n_steps=0):
    observation, info = env.reset(seed=0, options={"instance": id_})
    for _ in range(n_steps):
        observation, _, _, _, info = env.step(MOVE)
    return observation, info


def squash(x):
    return x / (1 + x)


@pytest.mark.parametrize(
    ("arguments", "size"),
    [
        ({}, 23),
        ({"observation": "features+context"}, 27),
        ({"on_blowup": "rollback"}, 24),
        ({"observation": "features+context", "on_blowup": "rollback"}, 28),
    ],
    ids=str,
)
def test_the_space_has_an_entry_a_row(arguments, size):
    env = made(**arguments)
    assert env.observation_space.shape == (size,)
    assert env.observation_space.dtype == np.float32
    rows = env.rules.observations.rows
    assert len(rows) == size
    assert len({row.name for row in rows}) == size
    assert all(row.meaning for row in rows)
    assert env.observation_space.low.tolist() == [row.low for row in rows]
    assert env.observation_space.high.tolist() == [row.high for row in rows]


@pytest.mark.parametrize("id_", [NOISY, DAMPED, PLAIN])
def test_entries_are_those_of_their_definitions(id_):
    env = made()
    begin(env, id_, 4)
    before = env.sim.diagnostics()
    seen, *_, info = env.step(MOVE)
    sim, scene, now = env.sim, env.episode.scene, env.sim.diagnostics()
    unit, mass = scene.fluid.c0 / 10, sim.mass * sim.n_fluid

    def speed2(numbers):
        return 2 * numbers["kinetic_energy"] / mass

    force = FORCE * math.sqrt(scene.h / now["max_acceleration"])
    expected = {
        "progress": 5 / env.n_steps,
        "log_dt": MOVE[0],
        "log_stiffness": MOVE[1],
        "xsph": MOVE[2],
        "substeps": squash(math.log(info["n_substeps"])),
        "mach": squash(10 * now["max_speed"] / sim.sound_speed),
        "max_speed": squash(now["max_speed"] / unit),
        "mean_speed": squash(4 * math.sqrt(speed2(now)) / unit),
        "flow_speed": squash(now["flow_speed"] / unit),
        "force_limit": squash(force / (COURANT * scene.h / sim.sound_speed)),
        "compression": squash(now["density_error"] / 0.01),
        "compression_p99": squash(now["density_error_p99"] / 0.04),
        "compression_rate": math.tanh((now["density_error"] - before["density_error"]) / 0.01),
        "clumping": now["clumping"],
        "spacing": now["median_spacing"] / 2,
        "kinetic_rate": math.tanh(10 * (speed2(now) - speed2(before)) / unit**2),
        "sinking": math.tanh(4 * now["momentum_y"] / mass / unit),
        "height": squash((now["com_y"] - now["lowest"]) / math.sqrt(sim.n_fluid * scene.dx**2)),
        "energy_excess": math.tanh(now["energy_excess"]),
        "surface": now["surface"],
        "free_fall": now["adrift"],
        "noise": squash(now["velocity_noise"] / (0.01 * unit**2)),
    }
    assert [*expected, "noise_share"] == NAMES
    assert seen[:-1] == pytest.approx(list(expected.values()), rel=1e-5, abs=1e-6)
    assert info["noise"] == pytest.approx(now["velocity_noise"] / unit**2)


def test_the_share_of_noise_is_remembered():
    env = made()
    begin(env, NOISY)
    memory = no_memory(env.episode.scene)
    for k in range(30):
        if k:
            seen, *_ = env.step(MOVE)
        sim, numbers = env.sim, env.sim.diagnostics()
        motion = 2 * numbers["kinetic_energy"] / (sim.mass * sim.n_fluid)
        memory = memory.after(numbers["velocity_noise"], motion)
    assert seen[-1] == pytest.approx(squash(100 * memory.share), rel=1e-5)


def test_a_noisy_fluid_shows_more_noise_than_a_damped_one():
    env, shown = made(), {}
    for id_ in (NOISY, DAMPED):
        seen, _ = begin(env, id_, 40)
        shown[id_] = dict(zip(NAMES, seen, strict=True))
    assert shown[NOISY]["noise"] > 1.2 * shown[DAMPED]["noise"]


# --- Contexts -------------------------------------------------------------------------------


@pytest.mark.parametrize("id_", [NOISY, DAMPED, PLAIN, "drop_impact/ood/6/dx=0.08"])
def test_the_context_stands_at_the_end_where_it_is_asked_for(id_):
    env, plain = made("features+context"), made()
    (seen, _), (without, _) = begin(env, id_, 3), begin(plain, id_, 3)
    assert np.array_equal(seen[: len(FEATURES)], without)
    context = contexts.of(env.episode.scene)
    assert seen[len(FEATURES) :] == pytest.approx(
        [
            squash(50 * context.alpha),
            context.support / 5,
            float(context.kernel != "mueller"),
            squash(100 * context.viscosity),
        ]
    )
    assert env.observation_space.contains(seen)
    assert len(CONTEXT) == 4


def test_an_agent_does_not_see_the_context():
    # at the start, two contexts of one flow look alike
    flow = instances.parse(NOISY)
    start = []
    for context in (contexts.Context(0.007), contexts.Context(0.2)):
        drawn = flow.drawn._replace(context=context)
        env = sph_gym.TuningEnv(flow._replace(drawn=drawn).build())
        start.append(env.reset(seed=0)[0])
    # but for the step that friction allows: what the controls of the start are
    others = [k for k, name in enumerate(NAMES) if name not in ("log_dt", "force_limit")]
    assert np.array_equal(start[0][others], start[1][others])


@pytest.mark.parametrize("id_", [NOISY, DAMPED, PLAIN])
def test_info_and_the_identity_tell_the_context(id_):
    env = made()
    _, info = begin(env, id_, 2)
    context = contexts.of(env.episode.scene)
    assert info["context"] == context.kind
    assert (info["alpha"], info["support"]) == (context.alpha, context.support)
    assert info["reward_noise"] <= 0.0
    assert env.instance.context == context._asdict()


@pytest.mark.parametrize("observation", ["features", "features+context", "field"])
def test_nothing_comes_from_the_reference(observation):
    plain, other = made(observation), made(observation)
    for env in (plain, other):
        env.reset(seed=0, options={"instance": NOISY})
    fine, spread, substeps = other.episode.reference
    wrong = type(fine)(*(7.0 * column + 1.0 for column in fine))
    other.episode.reference = ReferenceRun(wrong, 3.0 * spread, 2.0 * substeps)
    other.episode._judge._fine = [[9.0] * 5] * len(other.episode._judge._fine)
    for _ in range(5):
        ours, theirs = plain.step(MOVE), other.step(MOVE)
        assert np.array_equal(ours[0], theirs[0])
        assert ours[1] != theirs[1]


def test_observations_are_finite_and_bounded_whatever_the_numbers_are():
    env = made("features+context", on_blowup="rollback")
    begin(env, NOISY, 1)
    episode = env.episode
    for value in (0.0, 1e-300, 1e300, np.inf):
        numbers = dict.fromkeys(episode._numbers, value)
        # shares can't be more than 1
        numbers |= {name: min(value, 1.0) for name in ("clumping", "surface", "adrift")}
        moment = observations.Moment(
            env.sim, numbers, dict.fromkeys(numbers, 0.0), np.ones(3), 1.0, 10**9, 1.0,
            contexts.Context(1e6, 5.0, "wendland_c2", 1e6),
        )  # fmt: skip
        assert env.observation_space.contains(env.rules.observations.observe(moment)), value


# --- Versions -------------------------------------------------------------------------------


@pytest.mark.parametrize("module", [actions, observations])
def test_a_state_of_another_layout_is_refused(module, monkeypatch):
    env = made()
    begin(env, NOISY, 2)
    state = env.get_state()
    monkeypatch.setattr(module, "VERSION", module.VERSION + 1)
    with pytest.raises(ValueError, match="state: of an environment with versions = "):
        env.set_state(state)
    monkeypatch.undo()
    env.set_state(state)


def test_every_id_takes_every_kind_of_observation():
    for scene in ("dam_break", "mixed"):
        for kind in observations.TYPES:
            env = gym.make(env_id(scene), dx=0.08, observation=kind)
            assert env.unwrapped.rules.observation == kind
    with pytest.raises(ValueError, match="observation: expected one of features, field, feat"):
        made("everything")


def test_the_same_numerics_in_ones_own_scene_are_told_too():
    scene = sph_gym.scenes.make("drop_impact", dx=0.08)
    own = replace(scene, effects=replace(scene.effects, artificial_viscosity=0.15))
    _, info = sph_gym.TuningEnv(own).reset(seed=0)
    assert (info["context"], info["alpha"]) == ("damped", 0.15)
