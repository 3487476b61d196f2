"""The dam break and its measurements, Stoker's bore, and the drop: all of the article's fluid."""

import math

import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.scenes.dam_break import REFERENCE, dam_break, error
from sph_gym.scenes.drop_impact import REFERENCE as DROP
from sph_gym.scenes.drop_impact import centre, drop_impact, fall
from sph_gym.scenes.drop_impact import error as drop_error
from sph_gym.scenes.shared import martin_moyce, shallow, tanks
from sph_gym.scenes.shared.martin_moyce import front, front_error
from sph_gym.scenes.shared.reference import Run, read
from sph_gym.solver.geometry import lattice, tank_particles

WET = {"dx": 0.02, "width": 0.8, "height": 0.2, "tank": 4.0, "wet_bed": 0.1}


def measures(reference, sim):
    run = reference.run(sim)
    return run, {measure.quantity: measure for measure in reference.judge(run)}


# --- Arguments ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("dx", 0.0),
        ("height", 0.01),
        ("tank", 0.5),
        ("gravity", np.inf),
        ("wet_bed", -0.1),
        ("wet_bed", 1.0),
        ("obstacle", -0.1),
        ("obstacle", 2.0),
    ],
)
def test_wrong_arguments_are_named(name, value):
    with pytest.raises(ValueError, match=f"{name}: expected"):
        dam_break(**{name: value})


@pytest.mark.parametrize("at", [0.5, 6.9, np.nan])
def test_the_obstacle_stands_between_column_and_wall(at):
    with pytest.raises(ValueError, match="obstacle_at: expected"):
        dam_break(obstacle=0.25, obstacle_at=at)


def test_what_isnt_named_changes_nothing():
    scene = dam_break()
    assert np.array_equal(scene.x, lattice(0.0, 0.5, 0.0, 1.0, 0.02))
    assert np.array_equal(scene.walls.particles, tank_particles(3.5, 1.25, 0.02, layers=3))
    assert scene.h == 2.6 * 0.02
    assert (scene.fluid.kernel, scene.effects.artificial_viscosity) == ("mueller", 0.02)
    assert scene.fluid.c0 == 10 * math.sqrt(2 * 9.81 * 1.0)
    assert scene.walls.pressure == "like fluid"
    assert scene.integrator == "symplectic_euler"


@pytest.mark.parametrize("dx", [0.02, 0.023, 0.04])
def test_bed_and_obstacle_are_in_step_with_the_lattice(dx):
    sim = Simulation(dam_break(dx=dx, wet_bed=0.1, obstacle=0.25), threads=1)
    # the kernel reads at most rest density: nobody stands on anybody's place
    assert sim.rho.max() < 1000 * (1 + 1e-9)
    water = martin_moyce.column(sim.scene)
    assert np.isclose(water.width, 0.5, atol=dx)
    assert np.isclose(water.height, 1.0, atol=dx)
    assert np.isclose(water.wet_bed, 0.1, atol=dx)
    assert martin_moyce.has_obstacle(sim.scene)
    assert not martin_moyce.measured(sim.scene)


def test_only_the_column_on_a_dry_empty_floor_was_measured():
    assert martin_moyce.measured(dam_break(dx=0.05))
    for arguments in ({"height": 0.5}, {"wet_bed": 0.1}, {"obstacle": 0.2}, {"tank": 3.0}):
        assert not martin_moyce.measured(dam_break(dx=0.05, **arguments))


# --- Measurements ---------------------------------------------------------------------------


def test_the_measured_history_has_no_error():
    table = read("martin_moyce_1952_front_n2_2.csv")
    assert front_error(table) == 0.0
    assert np.isclose(front_error(table * (1.0, 1.1)), 0.1)
    later = table - (0.2, 0.0)
    assert np.isclose(front_error(later, shift=0.2), 0.0)
    assert front_error(later) > 0.05
    heights = read("martin_moyce_1952_height_n2_2.csv")
    assert martin_moyce.height_error(heights) == 0.0
    assert np.isclose(martin_moyce.height_error(heights + np.array([0.0, 0.05])), 0.05)


def test_the_present_front_is_compared():
    sim = Simulation(dam_break(dx=0.05), threads=1)
    assert front(sim) == pytest.approx(0.5)
    assert martin_moyce.left_height(sim) == pytest.approx(1.0)
    assert math.isnan(error(sim))
    # the front where it began, when it should be 2.33 widths away
    sim.time = 1.98 / math.sqrt(2 * 9.81 / 0.5)
    assert error(sim) == pytest.approx(100 * (1 - 1 / 2.33))
    sim.time = 100.0
    assert math.isnan(error(sim))


def test_a_coarse_column_collapses_as_measured():
    run, found = measures(REFERENCE, Simulation(dam_break(dx=0.05), threads=1))
    assert found["front, RMS"].value < 12.0
    assert found["front, RMS"].bound is None
    assert found["height at the wall, RMS"].value < 8.0
    assert all(measure.value <= measure.bound for measure in tanks.judge(run))
    assert len(REFERENCE.chart(run).curves) == 4


def test_a_column_as_high_as_wide_and_an_obstacle_run():
    scene = dam_break(dx=0.05, height=0.5, tank=4.0, obstacle=0.2, obstacle_at=2.0)
    run, found = measures(REFERENCE, Simulation(scene, threads=1))
    assert all(measure.value <= measure.bound for measure in found.values())
    places = np.asarray(scene.walls.particles)
    block = places[(places > (0.0, 0.0)).all(axis=1) & (places[:, 0] < 2.0)]
    low, high = block.min(axis=0) - 0.02, block.max(axis=0) + 0.02
    x = run.sim.x[: run.sim.n_fluid]
    assert not ((x > low) & (x < high)).all(axis=1).any()
    # some of it got beyond
    assert x[:, 0].max() > high[0]
    assert len(REFERENCE.chart(run).curves) == 2


# --- Stoker's bore --------------------------------------------------------------------------


@pytest.mark.parametrize("ahead", [0.001, 0.05, 0.3, 0.9])
def test_mass_and_momentum_pass_through_the_bore(ahead):
    flow, g = shallow.stoker(1.0, ahead, 9.81), 9.81
    assert ahead < flow.depth < 1.0
    # seen from the bore, still water comes at its speed and leaves slower and deeper
    behind = flow.bore - flow.speed
    assert np.isclose(flow.bore * ahead, behind * flow.depth)
    before = flow.bore**2 * ahead + g / 2 * ahead**2
    assert np.isclose(before, behind**2 * flow.depth + g / 2 * flow.depth**2)
    # along the rarefaction u + 2 c is that of the still water behind
    assert np.isclose(flow.speed + 2 * math.sqrt(g * flow.depth), 2 * math.sqrt(g))


def test_a_shallow_step_moves_as_a_small_wave():
    flow = shallow.stoker(1.0, 0.999, 9.81)
    assert np.isclose(flow.bore, math.sqrt(9.81), rtol=1e-3)
    assert np.isclose(flow.depth, 0.9995, rtol=1e-6)


def test_the_bore_is_found_where_the_water_falls_below_a_depth():
    sim = Simulation(dam_break(**WET), threads=1)
    assert shallow.bore(sim, 0.15) == pytest.approx(0.8, abs=sim.scene.h)
    assert shallow.bore(sim, 0.05) == pytest.approx(3.2, abs=sim.scene.h)
    assert shallow.bore(sim, 0.3) == 0.0
    times = np.linspace(0.0, 1.0, 50)
    assert np.isclose(shallow.bore_speed(times, 0.8 + 1.3 * times, 0.8, 3.2), 1.3)
    assert np.isnan(shallow.bore_speed(times, 0.8 + 0.1 * times, 0.8, 3.2))


def test_a_coarse_bore_runs_as_fast_as_it_should():
    run, found = measures(REFERENCE, Simulation(dam_break(**WET), threads=1))
    assert found["speed of the bore"].value < 15.0
    assert len(REFERENCE.chart(run).curves) == 2


def test_the_wet_bed_is_judged_at_two_resolutions_and_bound_at_the_finer_one():
    wet = [arguments for arguments in REFERENCE.resolutions if "wet_bed" in arguments]
    assert [arguments["dx"] for arguments in wet] == [0.02, 0.01]
    assert len({tuple((arguments | {"dx": 0}).items()) for arguments in wet}) == 1
    for arguments, bound in zip(wet, (None, 5.0), strict=True):
        sim = Simulation(dam_break(**arguments), threads=1)
        run = Run(sim, np.zeros(1), [REFERENCE.observe(sim)])
        assert REFERENCE.judge(run)[0].bound == bound


# --- The drop -------------------------------------------------------------------------------


@pytest.mark.parametrize("dx", [0.02, 0.021, 0.023, 0.029, 0.037])
def test_the_drop_is_symmetric_at_any_spacing(dx):
    scene = drop_impact(dx=dx)
    drop = np.asarray(scene.x)[fall(scene).drop]
    centre = fall(scene).start
    assert centre[0] == pytest.approx(np.asarray(scene.walls.box)[1] / 2)
    mirrored = 2 * centre - drop
    apart = np.hypot(*(drop[:, None] - mirrored[None]).T)
    assert apart.min(axis=0).max() < 1e-9
    assert len(drop) * dx**2 == pytest.approx(math.pi * 0.15**2, rel=0.1)


def test_the_drop_is_told_from_the_pool():
    scene = drop_impact()
    free = fall(scene)
    assert free.drop.sum() * 0.02**2 == pytest.approx(math.pi * 0.15**2, rel=0.05)
    assert free.start == pytest.approx((0.6, 0.12 + 0.4 + 0.15), abs=1e-9)
    assert free.gap == pytest.approx(0.4, abs=2 * 0.02)
    way = free.gravity / 2 * free.until**2
    assert way == pytest.approx(free.gap - scene.h)
    assert free.height(free.until) == pytest.approx(free.start[1] - way)


def test_the_error_sees_a_drop_that_does_not_fall():
    sim = Simulation(drop_impact(dx=0.03), threads=1)
    assert drop_error(sim) < 1e-9
    free = fall(sim.scene)
    sim.time = free.until
    assert drop_error(sim) == pytest.approx(100 * (free.gap - sim.scene.h) / free.gap)
    sim.time = 2 * free.until
    assert math.isnan(drop_error(sim))
    assert centre(sim) == pytest.approx(free.start)


def test_a_coarse_drop_falls_freely_and_stays_in_the_tank():
    run, found = measures(DROP, Simulation(drop_impact(dx=0.03), threads=1))
    assert found["free fall"].value < 0.5
    assert found["free fall"].bound is None
    assert all(measure.value <= measure.bound for measure in tanks.judge(run))
    assert len(DROP.chart(run).curves) == 2
    # it has come to lie in the pool
    assert centre(run.sim)[1] < 0.2
