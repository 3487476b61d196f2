"""Warnings: what is odd about a run, and what is odd or refused at the door."""

import copy
import math
import pickle
import re
from dataclasses import replace

import numpy as np
import pytest

from sph_gym import (
    Effects,
    Fluid,
    Scene,
    Walls,
    advance_all,
    channel_particles,
    disc,
    lattice,
    plate_particles,
    scenes,
    tank_particles,
)
from sph_gym.env import contexts
from sph_gym.solver.container import lowest_fill
from sph_gym.solver.initial_checks import NARROW, anomalies
from sph_gym.solver.kernels import rest_lattice
from sph_gym.solver.thickness import close_pairs, layer_share, measure, needed_layers
from sph_gym.solver.warnings import KINDS
from sph_gym.solver.watch import ANOMALIES, Watch
from tests.cases import BOX, DX, STILL, TANK, UNCOMPILED, WIDTH, scene, simulation

WATER = Fluid(c0=10.0)
BOX_OF_WATER = (0.0, 0.5, 0.0, math.inf)


def at_rest(walls, x=None, dx=0.05, h=0.13, **more):
    """A scene of water at rest, 0.5 m wide and deep, in some walls."""
    x = lattice(0, 0.5, 0, 0.5, dx) if x is None else x
    effects = Effects(gravity=(0.0, -9.81))
    return Scene("rest", x, dx, h, WATER, walls=walls, effects=effects, **more)


def kinds(sim):
    found = [warning.kind for warning in sim.warnings]
    assert found == sorted(set(found), key=KINDS.index)
    return found


def of_kind(sim, kind):
    [found] = [warning for warning in sim.warnings if warning.kind == kind]
    assert found.value > found.limit
    return found


def odd(scene):
    """Return the anomalies of walls and places, at rest density."""
    return [text for *_, text in anomalies(scene, np.ones(len(scene.x)))]


# --- Refused --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shift", "gone"),
    [((1.0, 0.0), 100), ((0.05, 0.0), 10), ((-0.03, 0.0), 10), ((0.0, -0.2), 40), ((-1e4, 0), 100)],
)
def test_fluid_outside_of_its_box_is_refused_with_count_and_place(shift, gone):
    box = Walls(box=(0.0, 0.5, 0.0, math.inf))
    with pytest.raises(ValueError, match=rf"x: expected .*walls\.box.*got {gone} of 100.*index"):
        at_rest(box, lattice(0, 0.5, 0, 0.5, 0.05) + shift)
    at_rest(box, lattice(0, 0.5, 0, 0.5, 0.05) + np.array((0.02, -0.02)))


def test_fluid_on_a_side_of_its_box_is_legal_wherever_that_is():
    for place in (0.0, 1.0, 1e4, -3e6):
        x = lattice(0, 0.5, 0, 0.5, 0.05) + place
        ends = place, place + 0.5
        box = (float(x[:, 0].min()), float(x[:, 0].max()), *ends)
        at_rest(Walls(box=box), x)
        scene = at_rest(Walls(tank_particles(0.5, 0.5, 0.05) + place, box=(*ends, *ends)), x)
        assert len(scene.x) == 100


@pytest.mark.parametrize("gap", [0.0, 0.1, 0.4, 0.44])
def test_fluid_within_half_a_spacing_of_boundary_particles_is_refused(gap):
    floor = lattice(-0.2, 0.7, -0.15, 0.0, 0.05)
    x = lattice(0, 0.5, 0, 0.5, 0.05) - (0.0, (1 - gap) * 0.05)
    with pytest.raises(ValueError, match=r"x: expected .*walls\.particles, .*got 10 of 100"):
        at_rest(Walls(floor), x)
    at_rest(Walls(floor), x + np.array((0.0, (0.5 - gap) * 0.05)))


def test_a_body_in_the_fluid_is_refused_also_across_the_end_of_a_domain():
    for place in (0.25, 0.265):
        body = disc(place, place, 0.17, 0.05)
        with pytest.raises(ValueError, match=r"walls\.particles, .*got \d+ of 100"):
            at_rest(Walls(np.concatenate([tank_particles(0.5, 0.6, 0.05), body])))
    post = [(0.999, 0.5)]
    with pytest.raises(ValueError, match=r"got 1 of 2 .*the first at index 1"):
        at_rest(Walls(post, period_x=(0.0, 1.0)), [(0.5, 0.5), (0.01, 0.5)])


def test_close_pairs_are_all_pairs_that_are_close():
    rng = np.random.default_rng(0)
    for far in (0.0, 1e9):
        x, others = rng.uniform(0, 1, (300, 2)), rng.uniform(0.2, 1.4, (200, 2))
        others[0] += far
        distance = np.hypot(*(x[:, None] - others).transpose(2, 0, 1))
        [(i, j, found)] = close_pairs(x, others, 0.1)
        near = np.zeros(distance.shape, int)
        np.add.at(near, (i, j), 1)
        assert (near == (distance < 0.1)).all()
        assert found == pytest.approx(distance[i, j])


# --- Odd at the door ------------------------------------------------------------------------


@pytest.mark.parametrize("h", [2.0, 2.6, 3.0, 3.3, 4.0])
@pytest.mark.parametrize("kernel", ["mueller", "wendland_c2", "quintic_spline"])
def test_walls_thinner_than_the_support_are_told_with_the_layers_that_it_needs(h, kernel):
    dx, needed = 0.05, math.ceil(h)
    assert needed_layers(h * dx, dx) == needed
    for layers in range(1, 5):
        rings = [
            0.25 + radius * np.array((math.cos(angle), math.sin(angle)))
            for radius in 0.6 + dx * np.arange(layers)
            for angle in np.linspace(0, 2 * np.pi, round(2 * np.pi * radius / dx), endpoint=False)
        ]
        shapes = {
            "tank": tank_particles(0.5, 0.6, dx, layers),
            "lid": tank_particles(0.5, 0.6, dx, layers, lid=True),
            "plate": plate_particles((-0.5, -0.2), (1.0, -0.25), dx, layers),
            "ring": np.array(rings),
            "obstacle": np.concatenate(
                [tank_particles(2.0, 0.6, dx, layers), lattice(1.0, 1.25, 0.0, 0.25, dx)]
            ),
        }
        for name, particles in shapes.items():
            water = at_rest(Walls(particles), h=h * dx)
            found = odd(replace(water, fluid=replace(WATER, kernel=kernel)))
            assert len(found) == (layers < needed), (name, layers)
            for text in found:
                assert f"fewer than the {needed} that" in text
                assert f"about {layers} layer" in text


def test_one_thin_plate_in_a_large_tank_is_told():
    tank = tank_particles(5.0, 1.0, 0.05, layers=3)
    plate = plate_particles((3.0, 0.3), (3.2, 0.5), 0.05, layers=1)
    [text] = odd(at_rest(Walls(np.concatenate([tank, plate]))))
    assert f"{len(plate)} of {len(tank) + len(plate)} walls.particles" in text


def test_a_box_needs_a_layer_less_at_its_sides():
    box = (0.0, 0.5, 0.0, math.inf)
    for layers in (1, 2, 3):
        walls = Walls(tank_particles(0.5, 0.6, 0.05, layers), box=box)
        assert len(odd(at_rest(walls))) == (layers < 2)


@pytest.mark.parametrize(
    ("h", "neighbors"), [(1.0, 0), (1.2, 4), (1.5, 8), (1.99, 8), (2.0, None), (2.6, None)]
)
@pytest.mark.parametrize(("kernel", "times"), [("wendland_c2", 2), ("quintic_spline", 3)])
def test_a_smoothing_length_in_place_of_the_support_is_told(h, neighbors, kernel, times):
    water = at_rest(Walls(box=BOX_OF_WATER), h=h * 0.05)
    found = odd(replace(water, fluid=replace(WATER, kernel=kernel)))
    assert len(found) == (neighbors is not None)
    for text in found:
        assert f"only {h:g} dx: a particle has about {neighbors} neighbours" in text
        assert "h = 2.6 to 4 dx, with 20 to 45 neighbours" in text
        assert f"give h = {times * h * 0.05:g} m, {times} times as much" in text


def test_supports_of_scenes_and_environments_are_usual_ones():
    made = [scenes.make(name) for name in scenes.names()]
    assert {2.6, 4.0} == {round(f(each.h / each.dx for each in made), 6) for f in (min, max)}
    on_a_lattice = [np.hypot(*rest_lattice(h, 1.0)) < h - 1e-9 for h in (2.6, 4.0)]
    assert [int(near.sum()) - 1 for near in on_a_lattice] == [20, 44]
    assert contexts.NARROW[0] > NARROW


@pytest.mark.parametrize("name", scenes.names())
def test_nothing_is_odd_about_the_walls_of_a_scene(name):
    reference = scenes.reference(name)
    for arguments in ({}, *(reference.resolutions if reference else ())):
        assert odd(scenes.make(name, **arguments)) == []


def test_default_walls_hold_whatever_support_is_usual():
    for h in (2.0, 2.6, 3.3, 4.0):
        assert odd(at_rest(Walls(tank_particles(0.5, 0.6, 0.05)), h=h * 0.05)) == []
        channel = Walls(channel_particles(1.0, 0.5, 0.05), period_x=(0.0, 1.0))
        assert odd(at_rest(channel, h=h * 0.05)) == []
        plate = plate_particles((-0.5, -0.3), (1.0, -0.3), 0.05)
        assert odd(at_rest(Walls(plate), h=h * 0.05)) == []


def test_other_units_and_other_places_are_told():
    x, tank = lattice(0, 0.5, 0, 0.5, 0.05), tank_particles(0.5, 0.6, 0.05)
    [text] = odd(at_rest(Walls(1000 * tank, box=(0, 500, 0, 500))))
    assert "1e+03 dx apart" in text
    [text] = odd(at_rest(Walls(tank), x + np.array((50.0, 0.0))))
    assert "m away from the fluid" in text
    [text] = odd(at_rest(Walls(tank), x + np.array((1.0, 0.0))))
    assert "falls beside them" in text
    [text] = odd(at_rest(Walls(tank), x - np.array((0.0, 2.0))))
    assert "none below the fluid" in text
    assert odd(at_rest(Walls(tank), x + np.array((0.0, 3.0)))) == []


def test_plates_in_other_units_and_other_places_are_told():
    x, tank = lattice(0, 0.5, 0, 0.5, 0.05), [[0, 0, 0, 1], [0, 0, 0.5, 0], [0.5, 0, 0.5, 1]]
    assert odd(at_rest(Walls(plates=tank))) == []
    [text] = odd(at_rest(Walls(plates=tank), x + np.array((50.0, 0.0))))
    assert re.search("walls.plates are .* m away from the fluid", text)
    for shift in ((1.0, 0.0), (0.0, -2.0)):
        [text] = odd(at_rest(Walls(plates=tank), x + np.array(shift)))
        assert "there are walls.plates, but none below the fluid" in text


def test_a_layer_is_measured_as_it_is_on_a_lattice():
    for layers in (1, 2, 3, 4):
        plate = plate_particles((0.0, 0.0), (2.0, 0.0), 0.05, layers)
        share = measure(plate, "wendland_c2", 0.15, 0.05).share
        assert share.max() == pytest.approx(layer_share(layers, "wendland_c2", 0.15, 0.05))


@pytest.mark.parametrize(
    ("factor", "text"), [(0.3, r"mean distance 0\.3\d dx.*burst"), (1.0, ""), (3.0, "hardly touch")]
)
def test_starts_that_overlap_or_are_in_other_units_are_told(factor, text):
    sim = simulation("none", x=factor * lattice(0, WIDTH, 0, WIDTH, DX), v=None, cloud="lattice 3")
    found = [warning.message for warning in sim.warnings if warning.kind == "start"]
    assert len(found) == (text != "")
    if text:
        assert of_kind(sim, "start").since == 0.0
        assert re.search(text, found[0])


def test_two_bodies_in_one_place_are_told():
    x = np.concatenate([lattice(0, WIDTH, 0, WIDTH, DX), lattice(0, 4 * DX, 0, 4 * DX, DX)])
    sim = simulation("none", x=x, v=None, cloud="lattice 3")
    assert "expect a burst" in of_kind(sim, "start").message


# --- Walls that are passed ------------------------------------------------------------------


def squeezed(layers, x=(0.0, 0.08), v=(0.0, -1.0), **more):
    """A particle on its slow way to a wall of some layers at y = 0; another one far away."""
    dx = 0.05
    wall = plate_particles((-0.5, 0.0), (0.5, 0.0), dx, layers)
    start = (x[0], x[1] + layers * dx / 2)
    return simulation(
        "none", x=[(-0.3, 1.0), start], v=[(0.0, 0.0), v], dx=dx, h=2.6 * dx, frame=0.01,
        walls=Walls(wall, **more),
    )  # fmt: skip


@pytest.mark.parametrize("layers", [1, 2])
@pytest.mark.parametrize("period", [None, pytest.param((-0.5, 0.5), marks=UNCOMPILED)])
def test_a_particle_that_passes_a_thin_wall_is_reported_before_it_is_through(layers, period):
    # its momentum is that of a column of others above it
    sim = squeezed(layers, v=(0.0, -6.0), period_x=period)
    while not (report := sim.advance(0.01)).diverged:
        assert sim.x[1, 1] > 0.0
        assert sim.time < 0.2
        assert kinds(sim) in (["start"], ["mach", "start"])
    assert (report.cause, report.link, report.bad_particle) == ("tunnelling", "walls", 1)
    assert abs(sim.x[1, 1]) < 0.05
    found = of_kind(sim, "walls")
    assert (found.value, found.since) == (1.0, sim.time)
    assert "1 x fluid got between" in found.message


@pytest.mark.parametrize("x", [(0.56, 0.1), (-0.58, 0.1)])
def test_fluid_that_flows_around_the_end_of_a_plate_passes_no_wall(x):
    sim = squeezed(1, x=x)
    for _ in range(30):
        assert not sim.advance(0.01).diverged
    assert sim.x[1, 1] < -0.1
    assert kinds(sim) == ["start"]


# --- Odd on the way -------------------------------------------------------------------------


def test_a_calm_flow_has_no_warnings():
    sim = simulation("everything", "lattice 3", speed=0.1)
    sim.advance(20 * sim.controls.dt)
    assert sim.warnings == ()


def test_spurious_energy_is_reported_in_the_frame_in_which_it_appears():
    # the article's kernels are no pair, and nothing damps them here
    sim = simulation("none", "overlapping", speed=0.0)
    sim.controls = sim.controls._replace(dt=0.5 * sim.stable_dt())
    told = None
    for _ in range(60):
        if sim.advance(4 * sim.controls.dt).diverged:
            break
        excess = sim.energy_surplus / sim.energy_at_stake
        assert ("energy" in kinds(sim)) == (told is not None or excess > 0.05)
        if told is None and excess > 0.05:
            told = sim.time
    found = of_kind(sim, "energy")
    assert found.since == told
    assert found.value >= sim.energy_surplus / sim.energy_at_stake
    assert f"{found.value:.0%} of the energy" in found.message


def test_fast_fluid_is_told_but_not_a_stray():
    calm = simulation("none", "lattice 3", speed=0.0)
    assert kinds(calm) == []
    v = np.zeros((144, 2))
    v[3] = 8.0, 0.0
    stray = simulation("none", "lattice 3", v=v)
    stray.advance(2 * stray.controls.dt)
    assert kinds(stray) == []
    fast = simulation("none", "lattice 3", v=np.tile((8.0, 0.0), (144, 1)))
    fast.advance(2 * fast.controls.dt)
    # of the present sound speed
    assert of_kind(fast, "mach").value == pytest.approx(8.0 / fast.sound_speed, rel=0.05)


@pytest.mark.parametrize("configuration", ["none", "everything", "periodic"])
def test_clumped_particles_are_counted_as_the_diagnostics_count_them(configuration):
    sim = simulation(configuration, "disordered")
    share = sim.diagnostics()["clumping"]
    assert share > ANOMALIES["clumping"].limit
    assert of_kind(sim, "clumping").value == share


def test_clumping_is_told_without_being_asked_for(monkeypatch):
    monkeypatch.setattr("sph_gym.solver.simulation.LOOK_EVERY", 2)
    sim = simulation("none", "overlapping", speed=0.0)
    sim.advance(sim.controls.dt)
    assert "clumping" not in sim._watch._found
    sim.advance(sim.controls.dt)
    assert "clumping" in sim._watch._found
    assert of_kind(sim, "clumping").since == sim.time


def test_the_lowest_that_a_fluid_can_lie_in_its_container():
    x, tank = lattice(0, 0.5, 0, 0.5, 0.05), tank_particles(1.0, 0.6, 0.05)
    wide = (0.0, 1.0, 0.0, math.inf)
    for walls in (Walls(tank), Walls(box=wide), Walls(tank, box=wide)):
        assert lowest_fill(at_rest(walls, x)) == pytest.approx((0.125, 0.0, 0.0, 1.0))
        moved = at_rest(walls, x + 0.3)
        assert lowest_fill(moved) == pytest.approx((0.125, 0.0, 0.0, 1.0))
    # an obstacle 0.5 m wide and 0.1 m high
    block = Walls(np.concatenate([tank, lattice(0.5, 1.0, 0.0, 0.1, 0.05)]))
    filled = 0.05 * 0.05 + 0.2 * 0.2
    assert lowest_fill(at_rest(block, x)) == pytest.approx((filled / 0.25, 0.0, 0.0, 1.0))
    plates = [(0.0, -0.1, 0.0, 2.0), (-0.1, 0.0, 1.1, 0.0), (1.0, -0.1, 1.0, 2.0)]
    assert lowest_fill(at_rest(Walls(plates=plates), x))[0] == pytest.approx(0.125, abs=0.05)
    weir = Walls(box=wide, plates=[(0.5, 0.0, 0.5, 1.0)])
    assert lowest_fill(at_rest(weir, x)) == pytest.approx((0.25, 0.0, 0.0, 0.5))
    endless = Walls(lattice(0, 1, -0.15, 0, 0.05), period_x=(0.0, 1.0))
    assert lowest_fill(at_rest(endless, x))[:2] == pytest.approx((0.125, 0.0))
    plate = Walls(plate_particles((-1.0, -0.1), (1.0, -0.1), 0.05))
    for walls in (None, plate, Walls(box=(-math.inf, 1.0, 0.0, 1.0)), Walls(box=(0, 1, -1e9, 1))):
        assert lowest_fill(at_rest(walls, x)) is None


@pytest.mark.parametrize(
    ("height", "rho", "told"),
    [(1.0, 1.0, ""), (0.9, 1.0, "lost 10%"), (1.3, 1.0, ""), (1.1, 0.9, "swollen by 10%")],
)
def test_a_level_that_sinks_or_rises_at_rest_is_told(height, rho, told):
    water = at_rest(Walls(box=(0.0, 0.5, 0.0, math.inf)), lattice(0, 0.5, 0, 1.0, 0.05))
    sim = simulation("everything", "lattice 3", v=None)
    sim.engine.fluid.rho[:] *= rho
    watch, totals = Watch(water, 1.0, np.ones(200)), sim._totals._replace(com_y=0.5 * height)
    watch.look_at_level(sim.engine, totals._replace(kinetic=0.0), (0.0, 0.0), 3.0)
    found = watch.warnings()
    assert len(found) == (told != "")
    for warning in found:
        assert (warning.kind, warning.since) == ("volume", 3.0)
        assert warning.value == pytest.approx(0.1)
        assert told in warning.message
    # a splash is higher than water at rest
    watch.look_at_level(sim.engine, totals._replace(com_y=0.9, kinetic=1e9), (0.0, 0.0), 4.0)
    assert watch.warnings() == found


@pytest.mark.parametrize(("height", "rho", "told"), [(0.9, 1.0, "lost"), (1.1, 0.9, "swollen")])
def test_where_the_support_is_too_narrow_that_is_why_the_level_changes(height, rho, told):
    water = at_rest(Walls(box=BOX_OF_WATER), lattice(0, 0.5, 0, 1.0, 0.05), h=0.06)
    sim = simulation("everything", "lattice 3", v=None)
    sim.engine.fluid.rho[:] *= rho
    watch = Watch(water, 1.0, np.ones(200))
    totals = sim._totals._replace(com_y=0.5 * height, kinetic=0.0)
    watch.look_at_level(sim.engine, totals, (0.0, 0.0), 3.0)
    volume, start = watch.warnings()
    assert (volume.kind, start.kind) == ("volume", "start")
    assert start.value > start.limit
    assert told in volume.message
    assert "h = 1.2 dx is too narrow" in volume.message
    assert not re.search("kernel|c0|boundary", volume.message)


def test_the_worst_is_kept_and_the_first_time():
    watch = simulation("none")._watch
    for share, time in ((0.04, 1.0), (0.2, 2.0), (0.5, 3.0), (0.1, 4.0)):
        watch.look_at_energy(1e9 * share, 1e9, time)
    [found] = watch.warnings()
    assert (found.value, found.limit, found.since) == (0.5, 0.05, 2.0)


# --- What belongs to the state --------------------------------------------------------------


def clumped():
    sim = simulation("everything", "overlapping", speed=5.0)
    sim.advance(3 * sim.controls.dt)
    assert {"clumping", "mach"} <= set(kinds(sim))
    return sim


def test_snapshots_copies_and_pickles_carry_warnings():
    sim, fresh = clumped(), simulation("everything", "overlapping", speed=5.0)
    fresh.restore(sim.snapshot())
    for other in (fresh, copy.deepcopy(sim), pickle.loads(pickle.dumps(sim))):
        assert other.warnings == sim.warnings


def test_going_back_takes_back_later_warnings():
    sim = simulation("none", "lattice 3", v=np.tile((8.0, 0.0), (144, 1)))
    before = sim.snapshot()
    sim.advance(2 * sim.controls.dt)
    assert kinds(sim) == ["mach"]
    sim.restore(before)
    assert kinds(sim) == []


def test_together_as_alone():
    alone, *others = (simulation("everything", "overlapping", speed=5.0) for _ in range(3))
    alone.advance(5 * alone.controls.dt)
    advance_all(others, 5 * alone.controls.dt)
    assert all(other.warnings == alone.warnings for other in others)


def test_reading_warnings_changes_no_result():
    sim, twin = (simulation("everything", "overlapping", speed=5.0) for _ in range(2))
    for _ in range(3):
        assert sim.warnings
        sim.advance(3 * sim.controls.dt)
        twin.advance(3 * twin.controls.dt)
    assert (sim.x == twin.x).all()
    assert (sim.rho == twin.rho).all()


def test_walls_of_the_cases_are_no_reason_for_a_warning():
    assert odd(scene("everything", "lattice 3")) == []
    assert len(TANK) > 0
    assert BOX[0] == 0.0
    assert STILL.gravity is not None
