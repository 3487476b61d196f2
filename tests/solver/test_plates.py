"""Plates: no path crosses them, however fast, and what hits them bounces off."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sph_gym import Controls, Effects, Simulation, Walls
from tests.cases import DX, simulation, uncompiled
from tests.solver.test_terms import agrees, cloud

SKIN = 0.01 * DX


def polygon(corners):
    """Segments that join the corners (n, 2) and the last one with the first."""
    corners = np.asarray(corners, float)
    return np.concatenate([corners, np.roll(corners, -1, axis=0)], axis=1)


def inside(corners, x):
    """Whether points are inside, by the number of sides that a ray to the right crosses."""
    x0, y0, x1, y1 = polygon(corners).T
    px, py = (column[:, None] for column in np.asarray(x, float).T)
    spans = (y0 > py) != (y1 > py)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x0 + (py - y0) / (y1 - y0) * (x1 - x0)
    return (spans & (px < crossing)).sum(axis=1) % 2 == 1


def flight(plates, x, v, restitution=0.5, dt=1e-3, n_steps=1, **more):
    """Particles after some steps; they are so soft that they don't notice each other."""
    walls = Walls(plates=plates, restitution=restitution)
    controls = Controls(dt, 1e-6, 0.3)
    sim = simulation("plates", x=x, v=v, walls=walls, controls=controls, h=1.1 * DX, **more)
    for _ in range(n_steps):
        assert not sim.advance(dt).diverged
    return sim


# Corners as seen from the middle, from very pointed ones to those that point inwards.
radii = st.lists(st.floats(0.3, 1.0), min_size=3, max_size=8)
seeds = st.integers(0, 2**32 - 1)


@given(radii, seeds, st.sampled_from([0.0, 0.5, 1.0]), st.sampled_from([1.0, 30.0, 1000.0]))
def test_nobody_leaves_a_closed_polygon(radii, seed, restitution, speed):
    angles = 2 * np.pi * np.arange(len(radii)) / len(radii) + 0.1
    corners = np.array(radii)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    rng = np.random.default_rng(seed)
    n = 25
    # a share of the way from the middle to somewhere on a side
    side, share = rng.integers(len(radii), size=n), rng.uniform(size=(n, 1))
    there = (1 - share) * corners[side] + share * np.roll(corners, -1, axis=0)[side]
    x = rng.uniform(0.0, 0.9, (n, 1)) * there
    assert inside(corners, x).all()
    v = rng.normal(0.0, speed, x.shape)
    sim = flight(polygon(corners), x, v, restitution)
    for _ in range(25):
        sim.advance(1e-3)
        assert inside(corners, sim.x).all()


@pytest.mark.parametrize("sharp", [0.5, 0.1, 0.02])
def test_nobody_leaves_through_a_pointed_corner(sharp):
    corners = np.array([(0.0, 0.0), (1.0, sharp), (1.0, -sharp)])
    rng = np.random.default_rng(0)
    x = np.array([(0.8, 0.0)]) + rng.normal(0.0, 0.1 * sharp, (30, 2))
    v = np.array([(-400.0, 0.0)]) + rng.normal(0.0, 20.0, x.shape)
    sim = flight(polygon(corners), x, v, 1.0)
    for _ in range(40):
        sim.advance(1e-3)
        assert inside(corners, sim.x).all()


@uncompiled
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2, 2.0, np.pi, 4.0])
@pytest.mark.parametrize("from_left", [True, False])
def test_the_normal_velocity_is_reflected(angle, restitution, from_left):
    along = np.array([np.cos(angle), np.sin(angle)])
    normal = np.array([-along[1], along[0]]) * (1.0 if from_left else -1.0)
    plate = np.concatenate([-along, along])
    start, v = 0.1 * normal - 0.2 * along, -300.0 * normal + 150.0 * along
    sim = flight([plate], [start], [v], restitution)
    assert sim.v[0] == pytest.approx(restitution * 300.0 * normal + 150.0 * along)
    # it hits at a third of the way, and is put a skin in front of that place
    assert sim.x[0] == pytest.approx(-0.15 * along + SKIN * normal, abs=1e-12)
    sim.advance(1e-3)
    expected = -0.15 * along + SKIN * normal + 1e-3 * sim.v[0]
    assert sim.x[0] == pytest.approx(expected, abs=1e-12)


@uncompiled
def test_who_arrives_exactly_on_a_plate_has_not_passed_it():
    # all numbers are powers of two
    sim = flight([(0.0, -1.0, 0.0, 1.0)], [(-0.5, 0.0)], [(512.0, 0.0)], 0.0, dt=2.0**-10)
    assert sim.x[0, 0] == pytest.approx(-SKIN)
    sim = flight(
        [(0.0, -1.0, 0.0, 1.0)], [(-0.5, 0.0)], [(128.0, 0.0)], 1.0, dt=2.0**-10, n_steps=9
    )
    assert sim.x[0, 0] < 0.0
    assert sim.v[0] == pytest.approx([-128.0, 0.0])


@uncompiled
@pytest.mark.parametrize("end", [(1.0, 0.3), (-1.0, 0.3), (0.3, 1.0), (0.3, -1.0)])
def test_a_path_past_the_end_is_free(end):
    plate = (0.0, 0.0, *(0.2 * np.array(end)))
    start, v = np.array([0.3, -0.5]), np.array([0.0, 900.0])
    sim = flight([plate], [start], [v])
    assert sim.x[0] == pytest.approx(start + 1e-3 * v)
    assert (sim.v[0] == v).all()


@uncompiled
def test_no_path_fits_through_where_two_plates_meet():
    plates = polygon([(0.0, 0.0), (0.3, 0.1), (0.7, -0.1), (1.0, 0.3)])[:3]
    for x in (0.3, 0.7):
        for side in (1.0, -1.0):
            sim = flight(plates, [(x, 0.4 * side)], [(0.0, -700.0 * side)])
            assert sim.x[0, 1] * side > 0.0 or abs(sim.x[0, 1]) < 0.11
            assert sim.v[0, 1] * side > -350.0


@uncompiled
def test_the_nearest_of_several_plates_stops_a_path():
    plates = [(0.3, -1.0, 0.3, 1.0), (0.1, -1.0, 0.1, 1.0), (0.5, -1.0, 0.6, 1.0)]
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        sim = flight([plates[k] for k in order], [(0.0, 0.0)], [(900.0, 90.0)], 0.5)
        assert sim.x[0] == pytest.approx([0.1 - SKIN, 0.01])
        assert sim.v[0] == pytest.approx([-450.0, 90.0])


@uncompiled
def test_who_is_carried_into_a_plate_but_flies_off_it_keeps_its_velocity():
    # XSPH carries the slow one along with its fast neighbours, through the plate at its right
    # the last one is on the other side, so that the plate doesn't mirror
    x = np.array([(0.0, 0.0), (-DX, 0.0), (-DX, DX), (-DX, -DX), (2.5 * DX, 0.0)])
    v = np.array([(-1.0, 0.0)] + [(60.0, 0.0)] * 4)
    walls = Walls(plates=[(1e-3, -1.0, 1e-3, 1.0)], restitution=1.0)
    start = cloud(x=x, v=v, walls=walls, effects=Effects(xsph=True))
    free = replace(start, walls=None)
    stopped, through = (Simulation(one, neighbors="brute") for one in (start, free))
    for sim in (stopped, through):
        sim.controls = sim.controls._replace(stiffness=1.0, dt=1e-3, xsph=1.0)
        sim.advance(1e-3)
    assert through.x[0, 0] > 1e-3
    assert through.v[0, 0] < 0.0
    assert stopped.x[0, 0] < 1e-3
    assert stopped.v[0] == pytest.approx(through.v[0])


@uncompiled
@pytest.mark.parametrize("integrator", ["symplectic_euler", "kick_drift_kick"])
def test_a_cloud_against_plates_is_that_of_the_naive_solver(integrator):
    plates = polygon([(-0.01, -0.012), (0.11, -0.02), (0.105, 0.12), (-0.02, 0.11)])
    walls = Walls(plates=[*plates, (0.02, 0.055, 0.08, 0.045)], restitution=0.7)
    agrees(cloud(walls=walls, speed=10.0, integrator=integrator), 4, neighbors=["grid"])


def test_energy_never_comes_from_a_plate():
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (0.9, 1.0), (0.4, 0.5), (0.1, 1.0)])
    sim = flight(polygon(corners), [(0.5, 0.2)], [(200.0, 123.0)], 1.0)
    for _ in range(200):
        sim.advance(1e-3)
        assert np.hypot(*sim.v[0]) == pytest.approx(np.hypot(200.0, 123.0))
    assert inside(corners, sim.x).all()


def test_plates_of_the_cases_are_in_the_way():
    sim = simulation("plates", speed=10.0)
    sim.advance(2e-3)
    free = simulation("none", speed=10.0)
    free.advance(2e-3)
    assert (np.abs(sim.x - free.x).max(axis=1) > 1e-3 * DX).sum() >= 3
