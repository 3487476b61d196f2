"""Bare sides of the box mirror the fluid, and tanks without boundary particles stay at rest."""

from dataclasses import replace

import numpy as np
import pytest

from sph_gym import (
    Effects,
    Fluid,
    Gravity,
    Motion,
    Scene,
    Simulation,
    Walls,
    lattice,
    scenes,
    sound_speed,
    tank_particles,
)
from sph_gym.solver.kernels import MATCHED
from sph_gym.solver.mirror_plates import mirroring_plates
from tests.cases import DX, assert_close, fluid, uncompiled
from tests.solver.test_terms import EFFECTS, FREE, cloud

SIGNS = np.array([(1, 1), (-1, 1), (1, -1), (-1, -1)])
INF = np.inf
# gravity has no mirror image, and neither has the diffusion that knows of it
MIRRORED = [name for name in EFFECTS if "diffusion" not in name]


# --- A flow in a corner is a quarter of a symmetric one ---------------------------------------


def in_four(values):
    """Return (n, 2) vectors and their mirror images in both axes."""
    return np.concatenate([values * sign for sign in SIGNS])


def quarter_and_whole(water, effects, particles=None):
    """Return a cloud in a corner of bare sides, and the same four times in open space."""
    start = cloud(fluid=water, effects=effects)
    x = np.abs(np.asarray(start.x)) + 0.2 * DX
    walls = Walls(particles, box=(0.0, INF, 0.0, INF))
    quarter = Simulation(replace(start, x=x, walls=walls))
    around = None if particles is None else Walls(in_four(particles))
    return quarter, Simulation(replace(start, x=in_four(x), v=in_four(start.v), walls=around))


@uncompiled
@pytest.mark.parametrize("name", MIRRORED)
def test_a_flow_in_a_corner_is_a_quarter_of_a_symmetric_one(name):
    water = replace(FREE, kernel="wendland_c2")
    quarter, whole = quarter_and_whole(water, EFFECTS[name])
    n = quarter.n_fluid
    for _ in range(3):
        for field in ("x", "v", "rho", "a"):
            assert_close(fluid(quarter, field), fluid(whole, field)[:n], 1e-10)
        for each in (quarter, whole):
            assert not each.advance(each.controls.dt).diverged


@uncompiled
def test_boundary_particles_have_images_too():
    block = lattice(5 * DX, 8 * DX, 0.0, 3 * DX, DX)
    quarter, whole = quarter_and_whole(replace(FREE, kernel="wendland_c2"), Effects(), block)
    n, m = quarter.n_fluid, len(block)
    for field in ("rho", "a"):
        assert_close(fluid(quarter, field), fluid(whole, field)[:n], 1e-10)
    assert_close(quarter.rho[n:], whole.rho[4 * n : 4 * n + m], 1e-10)


# --- Which sides mirror -----------------------------------------------------------------------


@pytest.mark.without_jit
def test_sides_mirror_that_no_boundary_particle_stands_for():
    box, h = (0.0, 1.0, 0.0, INF), 0.06
    tank, block = tank_particles(1.0, 0.5, DX), lattice(0.4, 0.6, 0.0, 0.2, DX)
    assert Walls(box=box).mirrored_sides(h) == box
    assert Walls(tank, box=box).mirrored_sides(h) is None
    assert Walls(block, box=box).mirrored_sides(h) == box
    floor = lattice(-3 * DX, 1.0 + 3 * DX, -3 * DX, 0.0, DX)
    assert Walls(floor, box=box).mirrored_sides(h) == (0.0, 1.0, -INF, INF)
    far = tank_particles(1.0, 0.5, DX) - (0.0, 1.1 * h)
    assert Walls(far[far[:, 1] < -h], box=box).mirrored_sides(h) == box
    assert Walls(block, box=(-INF, INF, -INF, INF)).mirrored_sides(h) is None
    assert Walls(block).mirrored_sides(h) is None


@pytest.mark.without_jit
@pytest.mark.parametrize("name", scenes.names())
def test_no_shipped_scene_needs_mirrors(name):
    scene = scenes.make(name)
    assert scene.walls is None or scene.walls.mirrored_sides(scene.h) is None


# --- Plates -----------------------------------------------------------------------------------


def in_plates(angle, corner=(0.0, 0.0)):
    """Return a lattice between a floor and two walls of plates, turned about a corner."""
    turn = np.array([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))])
    ends = np.array([(-0.1, 0.0), (0.3, 0.0), (0.0, -0.1), (0.0, 1.0), (0.16, 1.0), (0.16, 0.0)])
    x = lattice(0.0, 0.16, 0.0, 0.2, DX) @ turn + corner
    walls = Walls(plates=(ends @ turn + corner).reshape(3, 4))
    effects = Effects(gravity=(0.0, -9.81) @ turn)
    return replace(cloud(), x=x, v=None, h=3 * DX, walls=walls, effects=effects), turn


@uncompiled
@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0])
def test_plates_and_their_corners_mirror_like_the_box(angle):
    scene, turn = in_plates(angle, (0.1, -0.2))
    boxed = replace(in_plates(0.0)[0], walls=Walls(box=(0.0, 0.16, 0.0, INF)))
    one, other = Simulation(scene), Simulation(boxed)
    assert_close(fluid(one, "rho"), fluid(other, "rho"), 1e-10)
    assert_close(fluid(one, "a"), fluid(other, "a") @ turn, 1e-9, at_least=10.0)


@uncompiled
def test_a_plate_and_the_floor_of_a_box_share_a_corner():
    scene = replace(in_plates(0.0)[0], walls=Walls(box=(0.0, 0.16, 0.0, INF)))
    plate = Walls(box=(0.0, 9.0, 0.0, INF), plates=[(0.16, -0.1, 0.16, 1.0)])
    one, other = Simulation(scene), Simulation(replace(scene, walls=plate))
    assert_close(fluid(one, "rho"), fluid(other, "rho"), 1e-10)


@uncompiled
def test_a_plate_hides_what_comes_to_its_other_side():
    walls = Walls(box=(-INF, INF, 0.0, INF), plates=[(0.16, -1.0, 0.16, 1.0)])
    scene = replace(in_plates(0.0)[0], walls=walls)
    left = np.asarray(scene.x)
    two = np.concatenate([left, np.add(left, (0.3, 0.0))])
    alone, both = (Simulation(replace(scene, x=x, v=0.0 * x)) for x in (left, two))
    kept = both.snapshot()
    kept["fluid"]["x"][kept["fluid"]["id"] >= len(left)] -= 0.14
    both.restore(kept)
    assert_close(fluid(both, "rho")[: len(left)], fluid(alone, "rho"), 1e-10)
    assert_close(fluid(both, "a")[: len(left)], fluid(alone, "a"), 1e-9, at_least=10.0)


@pytest.mark.without_jit
def test_plates_mirror_that_enclose_the_fluid():
    scene = in_plates(0.0)[0]
    assert len(mirroring_plates(scene)) == 3
    x = np.asarray(scene.x)
    for plate in ((0.08, -1.0, 0.08, 1.0), (0.5, 0.0, 0.5, 0.1), (0.5, 0.1, 0.5, 1.0)):
        baffle = Walls(box=(0.0, 1.0, 0.0, INF), plates=[plate])
        assert mirroring_plates(replace(scene, walls=baffle)) == []
    outer = Walls(box=(0.0, 1.0, 0.0, INF), plates=[(0.5, 0.0, 0.5, 1.0)])
    assert len(mirroring_plates(replace(scene, walls=outer))) == 1
    face = Walls(lattice(0.0, 0.16, -0.06, 0.0, DX), plates=[(0.0, 0.0, 0.16, 0.0)])
    assert mirroring_plates(replace(scene, walls=face)) == []
    beside = Walls(box=(0.0, 0.16, 0.0, INF), plates=[(0.0, 0.0, 0.16, 0.0)])
    assert mirroring_plates(replace(scene, walls=beside)) == []
    endless = Walls(plates=[(0.2, -0.9, 0.2, 0.9)], period_y=(-1.0, 1.0))
    assert mirroring_plates(replace(scene, walls=endless, x=x)) == []


# --- Tanks at rest ----------------------------------------------------------------------------

G, DEPTH = 9.81, 0.6
FLOW = sound_speed(np.sqrt(2 * G * DEPTH))
BARE = Walls(box=(0.0, 0.3, 0.0, INF))


def tank(h_over_dx=3.0, kernel="wendland_c2", walls=BARE, width=0.3, depth=DEPTH, **more):
    """Return water in a tank; what nobody names is as in the README."""
    acting = {"gravity": (0.0, -G), "xsph": True, "artificial_viscosity": 0.02}
    effects = Effects(**(acting | more.pop("acting", {})))
    x = lattice(0.0, width, 0.0, depth, DX)
    water = Fluid(FLOW, kernel=kernel)
    return Scene("tank", x, DX, h_over_dx * DX, water, effects=effects, walls=walls, **more)


def at_rest(scene, seconds=5.0):
    """Return the level [shares of the depth], and of m g H the largest kinetic energy of the last
    half second and the largest spurious energy.
    """
    sim = Simulation(scene, threads=1)
    stake = sim.mass * sim.n_fluid * G * DEPTH
    kinetic, surplus = [], []
    while sim.time < seconds - 1e-9:
        assert not sim.advance(0.1).diverged
        kinetic.append(sim.diagnostics()["kinetic_energy"] / stake)
        surplus.append(sim.energy_surplus / stake)
    highest = np.sort(fluid(sim, "x")[:, 1])[-15:]
    return (np.median(highest) + DX / 2) / DEPTH, max(kinetic[-5:]), max(surplus)


def check_rest(scene):
    level, kinetic, surplus = at_rest(scene)
    assert level == pytest.approx(1.0, abs=0.03)
    assert kinetic < 1e-3
    assert surplus < 1e-3


@pytest.mark.parametrize("h_over_dx", [2.0, 2.6, 3.0, 4.0])
def test_water_in_a_box_stays_at_rest_and_keeps_its_level(h_over_dx):
    check_rest(tank(h_over_dx))


@pytest.mark.slow
@pytest.mark.parametrize("h_over_dx", [2.0, 2.6, 3.0, 4.0])
@pytest.mark.parametrize("kernel", sorted(MATCHED - {"wendland_c2", "wrong_poly6_gradient"}))
def test_so_it_does_with_every_matched_kernel(kernel, h_over_dx):
    check_rest(tank(h_over_dx, kernel))


def test_a_lattice_in_step_with_the_box_is_at_rest_density():
    sim = Simulation(tank(acting={"gravity": (0.0, 0.0)}))
    x, rho = fluid(sim, "x"), fluid(sim, "rho")
    assert rho[x[:, 1] < DEPTH - 3 * DX] == pytest.approx(1000.0, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("h_over_dx", [2.6, 3.0])
def test_so_it_does_between_plates(h_over_dx):
    plates = [(0.0, -0.1, 0.0, 2.0), (-0.1, 0.0, 0.4, 0.0), (0.3, -0.1, 0.3, 2.0)]
    check_rest(tank(h_over_dx, walls=Walls(plates=plates)))
    box = (0.0, 1.2, 0.0, INF)
    check_rest(tank(h_over_dx, walls=Walls(box=box, plates=plates[2:])))


@pytest.mark.slow
def test_the_article_s_pair_throws_no_drops_in_a_box():
    level, _, surplus = at_rest(tank(2.6, "mueller"))
    assert level < 1.1
    assert surplus < 0.05


@pytest.mark.slow
def test_a_piston_presses_as_hard_as_boundary_particles():
    """A side that moves in raises the level by what it takes of the width."""
    piston = Motion((0.01, 0.0), sides=("left",))
    scene = tank(walls=Walls(box=(0.0, 0.3, 0.0, INF), motion=piston))
    level, kinetic, _ = at_rest(scene, 3.0)
    assert level == pytest.approx(0.3 / 0.27, rel=0.03)
    assert kinetic < 1e-2


# --- Pressures of rest from the start ---------------------------------------------------------


def errors(sim, level=DEPTH):
    """Return |p - rho0 g depth| of the fluid as a share of rho0 g DEPTH."""
    x = fluid(sim, "x")
    return np.abs(fluid(sim, "p") / (1000 * G) - (level - x[:, 1])) / DEPTH


def liveliest(sim):
    """Return the largest kinetic energy of the first second [m g H]."""
    most = 0.0
    while sim.time < 1.0 - 1e-9:
        assert not sim.advance(0.02).diverged
        most = max(most, sim.diagnostics()["kinetic_energy"])
    return most / (sim.mass * sim.n_fluid * G * DEPTH)


def both(scene):
    """Return simulations of a scene with a cold start and with a hydrostatic one."""
    return Simulation(scene, threads=1), Simulation(replace(scene, hydrostatic=True), threads=1)


def test_water_that_starts_with_its_pressure_does_not_move():
    cold, still = both(tank(2.6))
    assert np.median(errors(still)) < 0.03
    assert np.median(errors(cold)) > 0.4
    assert still.time == 0.0
    assert not still.v.any()
    assert abs(still.energy_surplus) < 1e-9 * still.energy_at_stake
    assert liveliest(still) < 1e-3 * liveliest(cold)
    assert np.median(errors(still)) < 0.03


@pytest.mark.slow
# boundary particles "like fluid" have densities of their own, which differ from one to the next
@pytest.mark.parametrize(("pressure", "bound"), [("like fluid", 0.04), ("extrapolated", 0.02)])
def test_so_it_does_between_boundary_particles(pressure, bound):
    walls = Walls(tank_particles(0.3, 0.8, DX), box=BARE.box, pressure=pressure)
    cold, still = both(tank(3.0, walls=walls))
    assert np.median(errors(still)) < bound
    assert liveliest(still) < 0.02 * liveliest(cold)


@uncompiled
@pytest.mark.parametrize("integrator", ["symplectic_euler", "kick_drift_kick"])
def test_densities_by_continuity_start_with_those_of_rest(integrator):
    walls = Walls(tank_particles(0.1, 0.2, DX), pressure="extrapolated")
    acting = {"continuity": True}
    scene = tank(
        2.6, walls=walls, width=0.1, depth=0.12, acting=acting, integrator=integrator,
        hydrostatic=True,
    )  # fmt: skip
    sim = Simulation(scene)
    assert errors(sim, 0.12).max() < 0.02 * 0.12 / DEPTH
    assert sim.advance(sim.controls.dt).n_substeps == 1


@pytest.mark.slow
@uncompiled
def test_any_direction_may_be_down_and_a_fluid_may_be_moving():
    """A tank that lies on its side is the same; a fluid that moves keeps its velocity."""
    upright = tank(2.6, width=0.08, depth=0.12, hydrostatic=True)
    upright = replace(upright, v=np.full((24, 2), (0.0, 0.01)))
    lying = replace(
        upright, x=np.asarray(upright.x)[:, ::-1], v=np.asarray(upright.v)[:, ::-1],
        effects=replace(upright.effects, gravity=(-G, 0.0)),
        walls=Walls(box=(0.0, INF, 0.0, 0.3)),
    )  # fmt: skip
    one, other = Simulation(upright), Simulation(lying)
    assert_close(fluid(other, "x"), fluid(one, "x")[:, ::-1], 1e-9)
    assert (fluid(one, "v") == (0.0, 0.01)).all()
    assert (fluid(other, "v") == (0.01, 0.0)).all()


@uncompiled
def test_a_soft_fluid_under_its_weight_is_told_to_have_settled_and_not_to_overlap():
    soft = tank(2.6, width=0.08, depth=0.12, hydrostatic=True)
    soft = replace(soft, fluid=replace(soft.fluid, c0=2.5))
    assert "start" not in [warning.kind for warning in Simulation(soft).warnings]
    crowded = replace(soft, x=np.asarray(soft.x) * (0.7, 1.0))
    assert "start" in [warning.kind for warning in Simulation(crowded).warnings]


@uncompiled
@pytest.mark.parametrize(("kernel", "kinds"), [("mueller", ["start"]), ("wendland_c2", [])])
def test_kernels_that_heat_a_tank_at_rest_are_told_at_the_door(kernel, kinds):
    walls = Walls(tank_particles(0.1, 0.2, DX))
    sim = Simulation(tank(2.6, kernel, walls=walls, width=0.1, depth=0.12))
    assert [each.kind for each in sim.warnings] == kinds


@uncompiled
@pytest.mark.parametrize("kernel", ["wendland_c2", "mueller"])
@pytest.mark.parametrize("hydrostatic", [False, True])
def test_nothing_overlaps_in_a_lattice_with_densities_by_continuity(kernel, hydrostatic):
    walls = Walls(tank_particles(0.1, 0.2, DX), pressure="extrapolated")
    scene = tank(
        2.6, kernel, walls=walls, width=0.1, depth=0.12, acting={"continuity": True},
        hydrostatic=hydrostatic,
    )  # fmt: skip
    assert Simulation(scene).warnings == ()


@uncompiled
def test_a_dam_that_stands_free_keeps_its_shape():
    walls = Walls(box=(0.0, 9.0, 0.0, INF))
    dam = tank(2.6, walls=walls, width=0.08, depth=0.16, hydrostatic=True)
    assert np.abs(fluid(Simulation(dam), "x") - np.asarray(dam.x)).max() < 0.6 * DX


@pytest.mark.without_jit
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"hydrostatic": 1}, "True or False"),
        ({"effects": Effects()}, "a uniform gravity that acts from the start"),
        ({"effects": Effects(gravity=Gravity(0.0, -G, ramp=1.0))}, "without a ramp"),
        ({"walls": None}, "walls that the fluid rests on"),
        ({"walls": Walls(period_y=(0.0, 1.0))}, r"no gravity along walls.period_y"),
    ],
)
def test_no_pressure_of_rest_where_nothing_can_rest(changes, message):
    with pytest.raises(ValueError, match=f"^hydrostatic: expected .*{message}"):
        replace(tank(), **({"hydrostatic": True} | changes))
