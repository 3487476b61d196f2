"""Pressures on bare sides of the box are what the sides take from the fluid."""

from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Motion, Simulation, Walls
from sph_gym.solver.kernels import MATCHED
from sph_gym.solver.model import particle_mass
from tests.cases import DX, fluid, uncompiled
from tests.solver.test_images import INF, G, tank

WIDTH = 0.3


def still(h_over_dx=2.6, kernel="wendland_c2", depth=0.3, seconds=0.5, **more):
    """Return water at rest between bare sides, after some time."""
    scene = tank(h_over_dx, kernel, depth=depth, hydrostatic=True, **more)
    sim = Simulation(scene, threads=1)
    assert not sim.advance(seconds).diverged
    return sim


def off(sim, depth, points):
    """Return p - rho0 g (depth - y) at points (m, 2) [m], as shares of rho0 g depth."""
    points = np.asarray(points)
    return sim.pressure_at(points) / (1000 * G * depth) - (1 - points[:, 1] / depth)


def upright(x, heights):
    """Return points (m, 2) at one x and many heights [m]."""
    return np.stack([np.full_like(heights, x), heights], axis=-1)


def check_hydrostatic(sim, depth, tolerance=0.01):
    """Check the pressures along the floor and both sides."""
    x, h = np.linspace(0.0, WIDTH, 31), sim.scene.h
    floor = np.stack([x, 0 * x], axis=-1)
    assert np.abs(off(sim, depth, floor)).max() < tolerance
    heights = np.linspace(0.0, depth, 61)
    for side in (0.0, WIDTH):
        error = np.abs(off(sim, depth, upright(side, heights)))
        assert error[heights < depth - h].max() < tolerance
        # rows at the surface pair where h is large
        assert error.max() < max(tolerance, 0.03)
    # the floor carries the weight of the particles, whose mass isn't quite rho0 dx^2
    weight, share = sim.mass * sim.n_fluid * G, sim.mass / (1000 * DX**2)
    assert -sim.force_on("bottom")[1] == pytest.approx(weight, rel=tolerance)
    mean = np.trapezoid(sim.pressure_at(floor), x) / WIDTH
    assert mean * WIDTH * share == pytest.approx(weight, rel=tolerance)


@pytest.mark.parametrize(
    ("h_over_dx", "depth"), [(2.2, 0.3), (2.6, 0.3), (3.0, 0.3), (4.0, 0.3), (2.6, 0.16)]
)
def test_water_at_rest_has_its_pressure_on_bare_sides(h_over_dx, depth):
    check_hydrostatic(still(h_over_dx, depth=depth), depth)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("h_over_dx", "depth"),
    [(h_over_dx, depth) for h_over_dx in (2.2, 2.6, 3.0) for depth in (0.24, 0.6)] + [(4.0, 0.6)],
)
def test_so_it_has_with_other_spacings(h_over_dx, depth):
    check_hydrostatic(still(h_over_dx, depth=depth), depth)


@pytest.mark.slow
@pytest.mark.parametrize("h_over_dx", [2.2, 2.6, 3.0, 4.0])
@pytest.mark.parametrize("kernel", sorted(MATCHED - {"wendland_c2", "wrong_poly6_gradient"}))
def test_so_it_has_with_every_matched_kernel(kernel, h_over_dx):
    # cubic splines as wide as that let particles pair
    pairs = kernel == "cubic_spline" and h_over_dx == 4.0
    check_hydrostatic(still(h_over_dx, kernel), 0.3, 0.04 if pairs else 0.01)


@pytest.mark.without_jit
@pytest.mark.parametrize(("h_over_dx", "share"), [(2.2, 0.973), (2.6, 0.990), (3.0, 0.995)])
def test_particles_have_less_mass_than_rho0_dx2_where_h_is_small(h_over_dx, share):
    """By which `force_on` is less than the pressure along a side adds up to."""
    assert particle_mass(tank(h_over_dx)) / (1000 * DX**2) == pytest.approx(share, abs=0.001)


def test_the_level_is_right_up_to_bare_sides():
    levels = still().level_at(np.linspace(0.0, WIDTH, 31))
    assert np.abs(levels - 0.3).max() < 0.1 * DX


def test_the_pressure_changes_linearly_between_a_side_and_the_particles():
    """At 3 dx, where the particles' own pressures are right but for the rows at the floor."""
    depth = 0.3
    sim = still(3.0, depth=depth)
    h = sim.scene.h
    heights = np.linspace(-0.5 * DX, 2 * h, 41)
    for x in (0.0, 0.3 * h, WIDTH / 2, WIDTH - 0.3 * h):
        above = heights >= 0
        assert np.abs(off(sim, depth, upright(x, heights[above]))).max() < 0.01
        # behind the floor as on it
        below = upright(x, heights[~above])
        assert np.allclose(sim.pressure_at(below), sim.pressure_at([[x, 0.0]]), rtol=1e-12)
    points = upright(WIDTH / 2, np.array([h, h - 1e-9, h + 1e-9]))
    p = sim.pressure_at(points)
    assert np.allclose(p, p[0], rtol=1e-6)
    assert sim.pressure_at([[0.0, depth + 2 * DX], [-2 * DX, 0.1], [9.0, 9.0]]).tolist() == [0] * 3


def test_a_query_changes_nothing():
    sim = still()
    before, a = sim.snapshot(), sim.a.copy()
    sim.pressure_at([[0.0, 0.0], [0.15, 0.15], [WIDTH, 0.1]])
    assert np.array_equal(sim.a, a)
    for name, column in before["fluid"].items():
        assert np.array_equal(column, sim.snapshot()["fluid"][name])


def test_in_an_impact_pressures_along_a_wall_add_up_to_its_force():
    """Water from a dam runs against a bare wall, up there, and falls back."""
    width, height = 0.9, 0.9
    scene = tank(walls=Walls(box=(0.0, width, 0.0, INF)), depth=0.3)
    sim = Simulation(scene, threads=1)
    n = 90
    wall = upright(width, (np.arange(n) + 0.5) / n * height)
    scale = 1000 * DX**2 / sim.mass
    summed, total = [], []
    sim.advance(0.2)
    while sim.time < 0.8:
        assert not sim.advance(0.01).diverged
        summed.append(sim.pressure_at(wall).sum() * height / n)
        total.append(sim.force_on("right")[0] * scale)
    assert np.max(total) > 500.0
    assert np.sum(summed) == pytest.approx(np.sum(total), rel=0.02)
    assert np.abs(np.subtract(summed, total)).max() < 0.1 * np.max(total)


# --- Other boxes ------------------------------------------------------------------------------


def small():
    """Return water at rest that plain Python can run."""
    walls = Walls(box=(0.0, 0.12, 0.0, INF))
    return tank(2.6, walls=walls, width=0.12, depth=0.12, hydrostatic=True)


@pytest.mark.slow
@uncompiled
def test_any_direction_may_be_down():
    upright_one = small()
    lying = replace(
        upright_one,
        x=np.asarray(upright_one.x)[:, ::-1],
        effects=replace(upright_one.effects, gravity=(-G, 0.0)),
        walls=Walls(box=(0.0, INF, 0.0, 0.12)),
    )
    one, other = Simulation(upright_one), Simulation(lying)
    points = np.random.default_rng(0).uniform(0.0, 0.12, (50, 2))
    assert one.pressure_at(points) == pytest.approx(other.pressure_at(points[:, ::-1]), rel=1e-6)


@uncompiled
def test_far_from_the_origin_and_in_single_precision():
    scene, away = small(), np.array([3e4, -2e4])
    box = tuple(np.array(scene.walls.box) + np.repeat(away, 2))
    far = replace(scene, x=np.asarray(scene.x) + away, walls=Walls(box=box))
    points = np.random.default_rng(0).uniform(0.0, 0.1, (50, 2))
    expected = Simulation(scene).pressure_at(points)
    # plain Python warns of numbers that float32 can't hold
    with np.errstate(over="ignore"):
        found = Simulation(far, "float32").pressure_at(points + away)
    assert np.abs(found - expected).max() < 0.02 * expected.max()


@pytest.mark.slow
@uncompiled
def test_a_floor_may_close_upon_itself():
    width = 0.22
    walls = Walls(box=(-INF, INF, 0.0, INF), period_x=(0.0, width))
    sim = Simulation(tank(2.6, walls=walls, width=width, depth=0.12, hydrostatic=True))
    x = np.linspace(0.0, width, 23)
    p = sim.pressure_at(np.stack([x, 0 * x], axis=-1))
    assert p == pytest.approx(1000 * G * 0.12, rel=0.01)


@uncompiled
def test_a_side_that_moves_is_where_it_is_now():
    piston = Motion((0.05, 0.0), sides=("left",))
    walls = Walls(box=(0.0, 0.1, 0.0, INF), motion=piston)
    sim = Simulation(tank(2.6, walls=walls, width=0.1, depth=0.12))
    sim.advance(2e-2)
    now = 0.05 * sim.time
    on, behind = sim.pressure_at([[now, 0.05], [0.0, 0.05]])
    assert on == behind > 0


@uncompiled
def test_what_lies_where_the_box_clamps_presses_with_its_weight():
    """A particle alone has no pressure, and so no force from its image."""
    alone = replace(small(), x=[[0.06, 0.1 * DX]], v=None, hydrostatic=False)
    sim = Simulation(alone)
    for _ in range(2):
        assert sim.force_on("bottom") == pytest.approx([0.0, -sim.mass * G], abs=1e-9)
        sim.advance(sim.controls.dt)
        assert fluid(sim, "x")[0, 1] == pytest.approx(0.1 * DX)
    assert sim.pressure_at([[0.06, 0.0]])[0] * DX == pytest.approx(1000 * G * DX**2, rel=1e-6)
