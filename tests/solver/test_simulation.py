"""The contract of `Simulation`: its controls, its clock, its order, its repeatability."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sph_gym import Controls, Simulation, scenes
from sph_gym.env import SCENES
from sph_gym.solver import simulation as module
from sph_gym.solver import stepping
from tests.cases import C0, DX, STIFFNESS, assert_close, fluid, scene, simulation
from tests.naive import Naive

FIELDS = ("x", "v", "rho", "p", "a")
ROOT = Path(__file__).parents[2]


def assert_same(sim, other):
    """Bit by bit."""
    for field in FIELDS:
        assert (getattr(sim, field) == getattr(other, field)).all(), field
    assert sim.time == other.time


# --- Controls -------------------------------------------------------------------------------


def test_nominal_controls_are_those_of_the_fluid_at_its_start():
    sim = simulation("none", controls=None)
    assert sim.controls == sim.nominal_controls
    assert sim.controls.stiffness == pytest.approx(1000.0 * C0**2 / 7)
    assert sim.controls.xsph == 0.3
    assert sim.controls.dt == sim.stable_dt()


def test_a_scene_may_bring_its_own_controls():
    controls = Controls(1e-4, 2e4, 0.1)
    sim = simulation("none", controls=controls)
    assert sim.controls == sim.nominal_controls == controls
    sim.controls = Controls(2e-4, 1e4, 0.0)
    assert sim.nominal_controls == controls


@pytest.mark.parametrize("values", [(1e-4, 2e4, 0.1), [1, 2, 3], np.array([1e-4, 2e4, 0.1])])
def test_controls_are_kept_as_three_floats(values):
    sim = simulation("none")
    sim.controls = values
    assert type(sim.controls) is Controls
    assert sim.controls == tuple(values)
    assert {type(number) for number in sim.controls} == {float}


@pytest.mark.parametrize(
    ("name", "values"),
    [
        (field, Controls(1e-4, 1e4, 0.3)._replace(**{field: value}))
        for field in Controls._fields
        for value in (-1.0, math.nan, math.inf, "a", None)
    ]
    + [("dt", (0.0, 1e4, 0.3)), ("stiffness", (1e-4, 0.0, 0.3))]
    + [("controls", values) for values in (None, 5.0, (1e-4, 1e4), (1e-4, 1e4, 0.3, 0.0))],
)
def test_wrong_controls_are_named_and_change_nothing(name, values):
    sim = simulation("none")
    before = sim.controls
    with pytest.raises(ValueError, match=name):
        sim.controls = values
    assert sim.controls == before


@pytest.mark.without_jit
def test_pressure_and_acceleration_follow_the_stiffness_at_once():
    sim = simulation("none")
    p, a, rho = sim.p, sim.a, sim.rho
    sim.controls = sim.controls._replace(stiffness=3 * sim.controls.stiffness)
    assert_close(sim.p, 3 * p, 1e-13)
    assert_close(sim.a, 3 * a, 1e-12)
    assert (sim.rho == rho).all()
    assert sim.sound_speed == pytest.approx(math.sqrt(3 * 1.3) * C0)


@pytest.mark.without_jit
def test_what_is_read_is_a_copy_and_another_state_is_another_scene():
    sim = simulation("none")
    sim.advance(3 * sim.controls.dt)
    for name in FIELDS:
        before, mine = getattr(sim, name), getattr(sim, name)
        mine[:] = 0.0
        assert before.any()
        assert (getattr(sim, name) == before).all()
    changed = replace(sim.scene, x=sim.x[::-1], v=-0.5 * sim.v[::-1], controls=sim.controls)
    other = Simulation(changed)
    assert other.time == 0.0
    assert other.controls == sim.controls
    assert (other.x == sim.x[::-1]).all()
    assert (other.v == -0.5 * sim.v[::-1]).all()
    for name in ("rho", "p"):
        assert_close(getattr(other, name), getattr(sim, name)[::-1], 1e-12)
    for text in (Simulation.__doc__, (ROOT / "docs" / "solver.md").read_text()):
        assert "are copies" in text
        assert "replace(" in text


@pytest.mark.parametrize("arguments", [{"dtype": "float16"}, {"neighbors": "tree"}])
def test_unknown_names_are_named(arguments):
    with pytest.raises(ValueError, match=next(iter(arguments))):
        Simulation(scene(), **arguments)


def test_a_scene_is_expected():
    with pytest.raises(ValueError, match="scene"):
        Simulation("dam_break")


# --- The clock ------------------------------------------------------------------------------


@pytest.mark.without_jit
@pytest.mark.parametrize(
    ("seconds", "dt", "n"),
    [
        (1e-3, 1e-3, 1),
        (1e-3, 2e-3, 1),
        (1e-9, 1.0, 1),
        (1e-3, 0.999e-3, 2),
        (0.3, 0.1, 3),
        (1e-3, 1e-4, 10),
        (1e-3 * (1 + 1e-12), 1e-4, 10),
        (1e-3 * (1 + 1e-8), 1e-4, 11),
        (7e-4, 2e-4, 4),
    ],
)
def test_dt_is_snapped_down_to_a_whole_number_of_substeps(seconds, dt, n):
    sim = simulation("none", x=[(0.0, 0.0), (1.0, 1.0)], v=[(1.0, 0.0), (0.0, 1.0)])
    sim.controls = sim.controls._replace(dt=dt)
    report = sim.advance(seconds)
    assert report.n_substeps == n == max(math.ceil(seconds / dt - 1e-9), 1)
    assert report.dt == seconds / n
    assert sim.time == seconds
    assert sim.controls.dt == dt
    assert sim.x[0] == pytest.approx([seconds, 0.0])
    assert (report.diverged, report.cause, report.link) == (False, "", "")
    assert report.bad_particle == -1


def test_time_adds_up():
    sim = simulation("none")
    for seconds in (1e-3, 2e-3, 5e-4):
        sim.advance(seconds)
    assert sim.time == pytest.approx(3.5e-3, rel=1e-14)


@pytest.mark.parametrize("seconds", [0.0, -1.0, math.nan, math.inf, "a", None, 1e12])
def test_wrong_seconds_are_named(seconds):
    sim = simulation("none")
    with pytest.raises(ValueError, match="seconds"):
        sim.advance(seconds)
    assert sim.time == 0.0


def test_a_long_call_is_cut_into_chunks_that_nobody_notices(monkeypatch):
    whole, chunked = simulation("everything"), simulation("everything")
    dt = whole.controls.dt / 10
    for sim in (whole, chunked):
        sim.controls = sim.controls._replace(dt=dt)
    whole.advance(20 * dt)
    monkeypatch.setattr(module, "CHUNK", 3 * chunked.n_particles)
    assert chunked.advance(20 * dt).n_substeps == 20
    assert chunked.time == whole.time
    assert_close(fluid(chunked, "x"), fluid(whole, "x"), 1e-10)


def test_an_interrupted_call_leaves_a_state_to_go_on_from(monkeypatch):
    whole, broken = simulation("everything"), simulation("everything")
    dt = whole.controls.dt / 10
    for sim in (whole, broken):
        sim.controls = sim.controls._replace(dt=dt)
    whole.advance(4 * dt)

    advance, calls = stepping.advance, iter([False, False, False, True])

    def interrupted(*arguments):
        if next(calls, False):
            raise KeyboardInterrupt
        return advance(*arguments)

    monkeypatch.setattr(module, "CHUNK", broken.n_particles)
    monkeypatch.setattr(stepping, "advance", interrupted)
    with pytest.raises(KeyboardInterrupt):
        broken.advance(10 * dt)
    monkeypatch.undo()
    assert broken.time == pytest.approx(3 * dt)
    naive = Naive(broken.scene, broken.controls)
    x, v = fluid(broken, "x"), fluid(broken, "v")
    assert_close(broken.rho, naive.density(x), 1e-10)
    assert_close(fluid(broken, "a"), naive.acceleration(x, v, broken.time), 1e-10)
    broken.advance(dt)
    assert_close(fluid(broken, "x"), fluid(whole, "x"), 1e-10)


# --- Reading --------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_shapes_and_types(dtype):
    sim = simulation("everything", dtype=dtype)
    n = sim.n_particles
    assert sim.n_fluid == len(sim.scene.x)
    assert n == sim.n_fluid + len(sim.scene.walls.particles)
    shapes = {"x": (n, 2), "v": (n, 2), "rho": (n,), "p": (n,), "a": (n, 2)}
    assert {field: getattr(sim, field).shape for field in FIELDS} == shapes
    assert {str(getattr(sim, field).dtype) for field in FIELDS} == {dtype}


@pytest.mark.without_jit
def test_the_start_is_that_of_the_scene():
    sim = simulation("everything")
    assert (fluid(sim, "x") == sim.scene.x).all()
    assert (fluid(sim, "v") == sim.scene.v).all()
    assert (sim.x[sim.n_fluid :] == sim.scene.walls.particles).all()
    assert sim.time == 0.0


@pytest.mark.parametrize("field", FIELDS)
def test_what_is_read_may_be_written_to_without_harm(field):
    sim = simulation("everything")
    before = getattr(sim, field).copy()
    getattr(sim, field)[:] = 7.0
    assert (getattr(sim, field) == before).all()


def test_the_scene_is_not_touched_by_its_simulation():
    start = scene("everything")
    x, v = np.array(start.x), np.array(start.v)
    sim = Simulation(start)
    sim.advance(10 * sim.controls.dt)
    assert (start.x == x).all()
    assert (start.v == v).all()


def test_reading_changes_nothing():
    read, unread = simulation("everything"), simulation("everything")
    for _ in range(3):
        before = read.x, read.v
        read.evaluate()
        read.diagnostics(), read.stable_dt(), read.neighbor_counts, read.snapshot()
        assert (before[0] == read.x).all()
        assert (before[1] == read.v).all()
        for sim in (read, unread):
            sim.advance(2 * sim.controls.dt)
    assert_same(read, unread)


def test_fields_belong_to_the_present_positions():
    sim = simulation("everything")
    dt = sim.controls.dt / 10
    sim.controls = sim.controls._replace(dt=dt)
    sim.advance(3 * dt)
    naive = Naive(sim.scene, sim.controls)
    x, v = fluid(sim, "x"), fluid(sim, "v")
    assert_close(sim.rho, naive.density(x), 1e-10)
    assert_close(sim.p, naive.pressure(naive.density(x)), 1e-10)
    assert_close(fluid(sim, "a"), naive.acceleration(x, v, sim.time), 1e-10)


# --- Repeatability --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dtype", "neighbors"), [("float64", "grid"), ("float32", "grid"), ("float64", "brute")]
)
def test_two_runs_are_the_same_bit_by_bit(dtype, neighbors):
    first, second = (simulation("everything", "jittered", dtype, neighbors) for _ in range(2))
    for sim in (first, second):
        sim.advance(5 * sim.controls.dt)
        sim.controls = sim.controls._replace(stiffness=0.5 * STIFFNESS, xsph=0.1)
        sim.advance(5 * sim.controls.dt)
    assert_same(first, second)


@pytest.mark.parametrize(
    "name", [SCENES[0], *(pytest.param(name, marks=pytest.mark.slow) for name in SCENES[1:])]
)
def test_particles_keep_their_public_place(name):
    """Between two looks nobody moves further than its speed allows: nobody swaps its place."""
    sim = Simulation(scenes.make(name, dx=0.04))
    look = 2e-3
    before, changed = fluid(sim, "x"), False
    for _ in range(round(0.8 / look)):
        assert not sim.advance(look).diverged
        x = fluid(sim, "x")
        moved = np.linalg.norm(x - before, axis=1).max()
        fastest = np.linalg.norm(fluid(sim, "v"), axis=1).max()
        assert moved <= 1.5 * look * fastest + 1e-4 * DX
        before = x
        changed = changed or (np.diff(sim.engine.fluid.id) < 0).any()
    assert changed  # inside, they don't keep it
    assert (sim.x[sim.n_fluid :] == (sim.scene.walls.particles if sim.scene.walls else 0)).all()


def test_grid_and_brute_force_stay_together_over_many_steps():
    grid, brute = (
        simulation("everything", neighbors=kind, speed=0.5) for kind in ("grid", "brute")
    )
    for sim in (grid, brute):
        sim.advance(20 * sim.controls.dt)
    assert (np.diff(grid.engine.fluid.id) < 0).any()
    assert_close(fluid(grid, "x"), fluid(brute, "x"), 1e-9)
    assert_close(fluid(grid, "v"), fluid(brute, "v"), 1e-9)


def test_scenes_may_hold_plain_lists():
    start = scene("everything")
    listed = replace(start, x=np.asarray(start.x).tolist(), v=np.asarray(start.v).tolist())
    assert_same(Simulation(start), Simulation(listed))
