"""Whatever the arguments: a clear ValueError, or something that works. Few kernels, all values."""

import math
import re
from dataclasses import fields, replace
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

from sph_gym import (
    CentralGravity,
    Controls,
    Effects,
    Fluid,
    Gravity,
    Motion,
    RecordedGravity,
    RollingTank,
    Scene,
    ShakenGravity,
    Simulation,
    TuningEnv,
    Walls,
)
from sph_gym.env import reference
from sph_gym.env.stable_baselines import TuningVecEnv
from sph_gym.env.vector import TuningVectorEnv
from sph_gym.solver.geometry import lattice
from sph_gym.solver.integrators import INTEGRATORS
from sph_gym.solver.kernels import ALL_KERNELS
from sph_gym.studies.stability.checks import is_finite, is_silent
from tests.cases import ALL_EFFECTS, CONFIGURATIONS, WALLS, WATER, uncompiled

# An argument, then ": expected ..." or another sentence that says what was wrong.
CLEAR = re.compile(r"^[a-z][\w .\[\]/()=-]*: ", re.IGNORECASE)

numbers = st.one_of(
    st.floats(),
    st.floats(1e-3, 1e3),
    st.integers(-3, 10**6),
    st.sampled_from([0.0, -1.0, 1e-320, 1e308, 10**400, math.inf, math.nan]),
)
junk = st.sampled_from(
    [None, True, "", "water", b"x", (), [], {}, [[]], object(), 1j, [1, "a"], np.float32("nan")]
)
anything = st.one_of(numbers, junk)
vectors = st.one_of(st.lists(numbers, max_size=4), st.tuples(numbers, numbers), junk)
tables = st.one_of(
    st.lists(st.lists(numbers, min_size=1, max_size=4), max_size=5),
    st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=1, max_size=5),
    junk,
)
words = st.one_of(st.text(max_size=8), junk)


def attempt(action):
    """What it returns, and the text of the ValueError that it raised instead, or ""."""
    try:
        return action(), ""
    except ValueError as error:
        return None, str(error) or "nothing said"


def made(kind, arguments):
    """What the arguments make, or None after a clear refusal."""
    result, complaint = attempt(lambda: kind(**arguments))
    assert not complaint or CLEAR.match(complaint), complaint
    return result


@st.composite
def spoiled(draw, arguments, valid):
    """Valid arguments with up to three of them replaced by anything."""
    names = draw(st.sets(st.sampled_from(sorted(arguments)), max_size=3))
    return valid | {name: draw(arguments[name]) for name in names}


# --- What a scene is made of ----------------------------------------------------------------

PARTS = {
    Fluid: {
        "c0": anything,
        "rho0": anything,
        "gamma": anything,
        "kernel": words,
        "eos": words,
        "clamp": junk,
    },
    Effects: {
        "gravity": vectors,
        "xsph": junk,
        "artificial_viscosity": anything,
        "laminar_viscosity": anything,
        "surface_tension": anything,
        "quadratic_viscosity": anything,
        "tensile_correction": anything,
        "continuity": junk,
        "density_diffusion": anything,
        "shifting": anything,
    },
    Walls: {
        "particles": tables,
        "box": vectors,
        "restitution": anything,
        "pressure": words,
        "slip": words,
        "velocity": st.one_of(vectors, tables),
        "motion": junk,
        "plates": tables,
        "period_x": vectors,
        "period_y": vectors,
    },
    Motion: {
        "velocity": vectors,
        "amplitude": vectors,
        "frequency": anything,
        "particles": tables,
        "sides": words,
    },
    Gravity: {"x": anything, "y": anything, "ramp": anything},
    CentralGravity: {"omega": anything, "x": anything, "y": anything},
    ShakenGravity: {"x": anything, "y": anything, "amplitude": vectors, "frequency": anything},
    RecordedGravity: {"vectors": tables, "interval": anything},
    RollingTank: {"g": anything, "amplitude": anything, "frequency": anything, "pivot": vectors},
    Scene: {
        "name": words,
        "x": tables,
        "v": tables,
        "dx": anything,
        "h": anything,
        "fluid": st.one_of(st.just(WATER), junk),
        "effects": st.one_of(st.just(ALL_EFFECTS), junk),
        "walls": st.one_of(st.just(WALLS), junk),
        "duration": anything,
        "frame": anything,
        "controls": st.one_of(vectors, st.tuples(numbers, numbers, numbers)),
        "integrator": words,
    },
}


VALID = {
    Fluid: {"c0": 10.0},
    Effects: {"gravity": (0.0, -9.81), "xsph": True, "continuity": True},
    Walls: {"particles": [(0.0, 0.1), (0.2, 0.1)], "box": (-1.0, 1.0, -1.0, math.inf)},
    Motion: {"velocity": (1.0, 0.0), "sides": ("left",)},
    Gravity: {"x": 0.0, "y": -9.81},
    CentralGravity: {"omega": 1.0},
    ShakenGravity: {"x": 0.0, "y": -9.81, "amplitude": (1.0, 0.0), "frequency": 2.0},
    RecordedGravity: {"vectors": [(0.0, -9.0), (1.0, -9.0)], "interval": 0.1},
    RollingTank: {"g": 9.81, "amplitude": 0.1, "frequency": 1.0},
    Scene: {"name": "water", "x": [(0.0, 0.0)], "dx": 0.02, "h": 0.052, "fluid": WATER},
}


@pytest.mark.parametrize("kind", PARTS, ids=lambda kind: kind.__name__)
def test_parts_are_made_or_refused_in_a_clear_sentence(kind):
    @settings(max_examples=150)
    @given(spoiled(PARTS[kind], VALID[kind]))
    def check(arguments):
        made(kind, arguments)

    check()


# --- Scenes that run ------------------------------------------------------------------------

# single precision holds the eighth powers of usual lengths only
LENGTHS = {"float64": st.floats(1e-6, 1e6), "float32": st.floats(1e-2, 1e2)}
small = st.floats(0.0, 10.0)


@st.composite
def scenes(draw, configuration, dtype):
    """A handful of particles with any numbers that a scene takes."""
    dx = draw(LENGTHS[dtype])
    n = draw(st.integers(1, 8))
    place = st.tuples(st.floats(-5, 5), st.floats(-5, 5))
    x = dx * np.array(draw(st.lists(place, min_size=n, max_size=n)))
    c0 = draw(st.floats(1e-3, 1e3))
    v = c0 * np.array(draw(st.lists(place, min_size=n, max_size=n))) / 10
    parts = dict(CONFIGURATIONS[configuration])
    walls = parts.pop("walls", None)
    fluid = Fluid(
        c0=c0, kernel="mueller", rho0=draw(st.floats(1e-3, 1e5)), clamp=draw(st.booleans())
    )
    if walls is not None:
        size = draw(st.floats(0.5, 2.0))
        scale = size * dx / 0.02
        # a tank, 12 dx wide times its size, stands around the fluid, which may not begin in it
        x *= min((6 * size - 0.6) / 5, 1.0)
        low, high = -10 * dx, 10 * dx
        # one behind each side that isn't to mirror the fluid
        behind = [(low - dx / 2, high - dx), (high + dx / 2, high - dx), (high - dx, low - dx / 2)]
        parts["walls"] = replace(
            walls,
            particles=np.concatenate([scale * (np.asarray(walls.particles) - 6 * 0.02), behind]),
            box=(low, high, low, math.inf),
            restitution=draw(st.floats(0.0, 1.0)),
        )
        parts["effects"] = replace(
            ALL_EFFECTS,
            gravity=(draw(st.floats(-100, 100)), draw(st.floats(-100, 100))),
            artificial_viscosity=draw(small),
            laminar_viscosity=draw(small),
        )
    return Scene("fuzzed", x, dx, draw(st.floats(1.0, 5.0)) * dx, fluid, v=v, **parts)


@pytest.mark.parametrize("configuration", ["none", "everything"])
@pytest.mark.parametrize("dtype", ["float64", pytest.param("float32", marks=pytest.mark.slow)])
def test_any_scene_and_controls_run_or_are_reported(configuration, dtype):
    @settings(max_examples=60)
    @given(
        scenes(configuration, dtype),
        st.floats(-3, 3),
        st.floats(-6, 6),
        st.floats(0, 5),
        st.integers(1, 20),
    )
    def check(scene, dt, stiffness, xsph, steps):
        run_twice(Simulation(scene, dtype, threads=1), dt, stiffness, xsph, steps)

    check()


def run_twice(sim, dt, stiffness, xsph, steps):
    """Some steps with controls that are so many orders from the nominal ones, twice."""
    nominal = sim.nominal_controls
    sim.controls = Controls(10**dt * nominal.dt, 10**stiffness * nominal.stiffness, xsph)
    for _ in range(2):
        report = sim.advance(steps * sim.controls.dt)
        assert 1 <= report.n_substeps <= steps
        assert is_finite(sim)
        assert not is_silent(sim, report)
        assert sim.restore(sim.snapshot()) is None
        numbers = sim.diagnostics()
        wrong = [name for name, value in numbers.items() if not math.isfinite(value)]
        assert set(wrong) <= {"min_spacing", "median_spacing"}


# --- All that a scene may name, uncompiled: every combination would cost a compilation --------

maybe = st.one_of(st.none(), st.floats(0.0, 2.0))
PERIODS = ("period_x", "period_y")


@st.composite
def any_walls(draw, dx):
    """Walls of any kinds in a room of 20 dx, or none, or what is refused."""
    kinds = draw(st.sets(st.sampled_from(["particles", "box", "plates", "motion", *PERIODS])))
    low, high = -10 * dx, 10 * dx
    parts = {name: (low, high) for name in PERIODS if name in kinds}
    if "particles" in kinds:
        parts["particles"] = lattice(low, high, low + 2 * dx, low + 4 * dx, 2 * dx)
        parts["pressure"] = draw(st.sampled_from(["like fluid", "extrapolated"]))
        parts["slip"] = draw(st.sampled_from(["no-slip", "free-slip"]))
        parts["velocity"] = draw(st.sampled_from([None, (1.0, 0.0), (0.0, 0.5)]))
    if "box" in kinds:
        sides = [(-math.inf, math.inf) if name in kinds else (low, high) for name in PERIODS]
        parts["box"] = (*sides[0], *sides[1])
    if "plates" in kinds:
        parts["plates"] = [(-dx, -6 * dx, 2 * dx, 6 * dx)]
    if kinds & {"box", "plates"}:
        parts["restitution"] = draw(st.floats(0.0, 1.0))
    if "motion" in kinds:
        open_sides = {"left", "right"} if "period_x" in kinds else set()
        sides = {"bottom"} if "box" in kinds and "period_y" not in kinds else set()
        motion = {"velocity": (0.0, 0.1), "amplitude": (0.0, 0.1 * dx), "frequency": 3.0}
        parts["motion"] = Motion(**motion, sides=tuple(sides - open_sides))
    return attempt(lambda: Walls(**parts))[0] if parts else None


@st.composite
def any_effects(draw):
    """Any of them together, or what is refused."""
    strengths = ("artificial_viscosity", "laminar_viscosity", "surface_tension", "shifting",
                 "quadratic_viscosity", "tensile_correction", "density_diffusion")  # fmt: skip
    parts = {name: draw(maybe) for name in strengths}
    parts["continuity"], parts["xsph"] = draw(st.booleans()), draw(st.booleans())
    parts["gravity"] = draw(st.sampled_from([
        None, (1.0, -9.81), Gravity(0.0, -9.81, ramp=0.1), CentralGravity(3.0),
        ShakenGravity(0.0, -9.81, (2.0, 0.0), 3.0), RollingTank(9.81, 0.2, 2.0),
        RecordedGravity([(0.0, -9.0), (1.0, -9.0)], 0.01),
    ]))  # fmt: skip
    if not parts["continuity"]:
        parts["density_diffusion"] = None
    return attempt(lambda: Effects(**parts))[0]


@st.composite
def any_scene(draw):
    """A scene with anything in it, or None after a clear refusal."""
    dx, n = draw(st.floats(1e-3, 1e3)), draw(st.integers(1, 6))
    place = st.tuples(st.floats(-5, 5), st.floats(-5, 5))
    x, v = (np.array(draw(st.lists(place, min_size=n, max_size=n))) for _ in range(2))
    fluid = Fluid(
        c0=draw(st.floats(1.0, 100.0)),
        kernel=draw(st.sampled_from(sorted(ALL_KERNELS))),
        clamp=draw(st.booleans()),
    )
    arguments = {
        "x": dx * x, "dx": dx, "h": draw(st.floats(1.5, 4.5)) * dx, "v": v, "fluid": fluid,
        "effects": draw(any_effects()) or Effects(), "walls": draw(any_walls(dx)),
        "integrator": draw(st.sampled_from(sorted(INTEGRATORS))),
    }  # fmt: skip
    return made(partial(Scene, "anything"), arguments)


@uncompiled
def test_whatever_a_scene_names_it_runs_or_is_reported():
    seen = set()

    @settings(max_examples=150, suppress_health_check=[HealthCheck.too_slow])
    @given(any_scene(), st.floats(-3, 1.5), st.floats(-3, 3), st.floats(0, 2), st.integers(1, 3))
    def check(scene, dt, stiffness, xsph, steps):
        if scene is None:
            return
        seen.update({scene.integrator, scene.fluid.kernel, *parts_of(scene)})
        run_twice(Simulation(scene, threads=1), dt, stiffness, xsph, steps)

    check()
    named = {"particles", "plates", "motion", "period_x", "continuity", "shifting"}
    assert seen >= named | {"surface_tension"} | set(INTEGRATORS)


def parts_of(scene):
    """Names of the effects and walls that are there."""
    wholes = [whole for whole in (scene.effects, scene.walls) if whole is not None]
    values = {field.name: getattr(whole, field.name) for whole in wholes for field in fields(whole)}
    return [name for name, value in values.items() if value is not None and value is not False]


@pytest.fixture(scope="module")
def running():
    return Simulation(Scene("one", [(0.0, 0.0)], 0.02, 0.052, WATER))


@settings(max_examples=150)
@given(st.tuples(anything, anything, anything), anything)
@example((1e-320, 1.0, 0.0), 1.0)
def test_controls_and_seconds_are_taken_or_refused(running, controls, seconds):
    def play():
        running.controls = controls
        # a legal pair that would take for ever
        known = isinstance(seconds, (int, float)) and abs(seconds) < 1e300
        assume(not known or seconds / running.controls.dt < 1e4)
        running.advance(seconds)

    _, complaint = attempt(play)
    assert not complaint or CLEAR.match(complaint), complaint
    assert is_finite(running)


@settings(max_examples=100)
@given(st.data())
def test_simulations_are_made_or_refused(data):
    arguments = {"dtype": words, "neighbors": words, "threads": anything, "scene": junk}
    valid = {"scene": Scene("one", [(0.0, 0.0)], 0.02, 0.052, WATER)}
    made(Simulation, data.draw(spoiled(arguments, valid)))


@settings(max_examples=100)
@given(st.dictionaries(st.text(max_size=6), anything, max_size=8), st.data())
def test_a_snapshot_is_taken_or_refused(running, extra, data):
    snapshot = running.snapshot()
    for name in data.draw(st.sets(st.sampled_from(sorted(snapshot)))):
        snapshot[name] = data.draw(st.one_of(anything, vectors, tables))
    before = running.x
    _, complaint = attempt(lambda: running.restore(snapshot | extra))
    if complaint:
        assert complaint.startswith(("snapshot", "controls"))
        assert np.array_equal(running.x, before)
    assert is_finite(running)
    home = running.snapshot()
    attempt(lambda: running.advance(running.controls.dt))
    assert is_finite(running)
    numbers = running.diagnostics()
    # a particle by itself has no spacing
    told = [numbers[name] for name in ("kinetic_energy", "energy_excess", "max_speed", "com_x")]
    assert np.isfinite([running.time, *told]).all()
    running.restore(home)


# --- Environments ---------------------------------------------------------------------------

ENVIRONMENT = {
    "scene": st.one_of(st.sampled_from(["dam_break", "mixed", "shaken_tank"]), words),
    "dx": anything,
    "instances": st.one_of(st.sampled_from(["train", "nominal"]), words),
    "action_mode": st.one_of(st.sampled_from(["absolute", "stable", "delta", "discrete"]), words),
    "on_blowup": words,
    "reward_weights": st.one_of(
        st.dictionaries(words.filter(str.__instancecheck__), numbers), junk
    ),
    "reward": words,
    "rate_limit": anything,
    "observation": words,
    "render_mode": words,
}


@settings(max_examples=150)
@given(spoiled(ENVIRONMENT, {"scene": "dam_break"}))
def test_environments_are_made_or_refused(arguments):
    env = made(TuningEnv, arguments)
    if env is not None:
        env.close()


# never so many that making them takes long
few = st.one_of(st.integers(-1, 3), st.floats(-2.0, 3.0), junk)
VECTOR = ENVIRONMENT | {
    "num_envs": few,
    "threads": few,
    "max_episode_steps": few,
    "autoreset_mode": st.one_of(st.sampled_from(list(AutoresetMode)), words),
}
VECTORS = {
    "native": TuningVectorEnv,
    "make_vec": partial(gym.make_vec, "sph_gym/DamBreak-v1"),
    "stable baselines": TuningVecEnv,
}


@pytest.mark.parametrize("way", VECTORS)
def test_vectors_of_environments_are_made_or_refused(way):
    arguments = dict(VECTOR)
    if way == "stable baselines":
        # its users' loops need one mode
        del arguments["autoreset_mode"]
    valid = {"num_envs": 2} | ({} if way == "make_vec" else {"scene": "dam_break"})

    @settings(max_examples=80)
    @given(spoiled(arguments, valid))
    def check(arguments):
        envs = made(VECTORS[way], arguments)
        if envs is not None:
            assert envs.num_envs == arguments["num_envs"]
            envs.close()

    check()


def test_a_scene_of_ones_own_is_played_or_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(reference, "cache_home", lambda: tmp_path)

    @settings(max_examples=25)
    @given(scenes("none", "float64"), st.lists(st.floats(-1, 1), min_size=3, max_size=3))
    def check(scene, action):
        frame = 4 * 0.4 * scene.h / scene.fluid.c0
        own = replace(scene, frame=frame, duration=2 * frame)
        env = TuningEnv(scene=own)
        try:
            env.reset(seed=0)
        except RuntimeError as error:
            # a cloud of overlapping particles may be too hard for its own nominal stiffness
            complain(error)
            return
        observation, reward, *_ = env.step(np.array(action, np.float32))
        assert observation in env.observation_space
        assert math.isfinite(reward)

    check()


def complain(error):
    """Whether it says what is wrong."""
    assert re.match(r"fuzzed: the (reference run|CFL rule) blew up ", str(error))


@pytest.fixture(scope="module", params=["absolute", "stable", "delta", "discrete"])
def playing(request):
    env = TuningEnv("dam_break", dx=0.1, action_mode=request.param)
    env.reset(seed=0)
    return env


@settings(max_examples=100)
@given(st.one_of(anything, vectors, tables, st.integers(0, 26)))
@example(np.full(3, np.nan))
@example(np.zeros((3, 1), np.float32))
@example(np.array([True, False, True]))
def test_an_action_is_played_or_refused_before_anything_moves(playing, action):
    if playing.episode.over:
        playing.reset(seed=0)
    before, time = playing.sim.x, playing.sim.time
    result, complaint = attempt(lambda: playing.step(action))
    assert is_finite(playing.sim)
    if complaint:
        assert complaint.startswith("action: "), complaint
        assert np.array_equal(playing.sim.x, before)
        assert playing.sim.time == time
    else:
        observation, reward, _, _, info = result
        assert observation in playing.observation_space
        assert math.isfinite(reward)
        assert all(math.isfinite(value) for value in info.values() if not isinstance(value, str))


@settings(max_examples=60)
@given(st.one_of(anything, st.dictionaries(st.sampled_from(["instance", "x"]), anything)))
def test_options_of_a_reset_are_taken_or_refused(playing, options):
    result, complaint = attempt(lambda: playing.reset(seed=0, options=options))
    assert not complaint or CLEAR.match(complaint), complaint
    if not complaint:
        assert result[0] in playing.observation_space
    playing.reset(seed=0)
