"""Every term alone against the naive solver, uncompiled, on clouds of a few particles.

An effect that is added gets its twin in naive.py and its line in EFFECTS. The configurations of
cases.py, which are compiled, are mixtures: a failure there has a name here.
"""

from dataclasses import fields, replace

import numpy as np
import pytest

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
    Walls,
    channel_particles,
    lattice,
    tank_particles,
)
from sph_gym.solver.kernels import ALL_KERNELS, KERNELS
from tests.cases import C0, DX, STIFFNESS, UNCOMPILED, WATER, assert_close, fluid
from tests.naive import Naive

pytestmark = UNCOMPILED

N = 5
SIDE = N * DX
FREE = Fluid(c0=C0, clamp=False)
TANK = tank_particles(SIDE, SIDE, DX, layers=2)
LEFT = TANK[:, 0] < 0
LID = np.where(TANK[:, 1:] < 0, (2.0, 0.0), (0.0, 0.0))
CHANNEL = channel_particles(6 * DX, 6 * DX, DX, layers=2)
VISCOUS = Effects(artificial_viscosity=0.3, quadratic_viscosity=0.7, laminar_viscosity=0.02)
HEAVY = replace(VISCOUS, gravity=(1.5, -9.81))
SWING = Motion((0.3, -0.2), (0.3 * DX, 0.2 * DX), 7.0)
BOX = (0.0, SIDE, 0.0, SIDE)
RECORD = np.array([(0.0, -9.0), (3.0, -7.0), (-1.0, -10.0), (2.0, 5.0)])

FIELDS = {
    "ramp": Gravity(1.5, -9.81, ramp=0.05),
    "central": CentralGravity(20.0, 0.01, 0.02),
    "shaken": ShakenGravity(1.0, -9.81, (5.0, 3.0), 2.5),
    "recorded": RecordedGravity(RECORD, 0.02),
    "rolling": RollingTank(9.81, 0.3, 1.5, (0.1, -0.05)),
}
EFFECTS = {
    "artificial viscosity": Effects(artificial_viscosity=0.3),
    "quadratic viscosity": Effects(quadratic_viscosity=2.0),
    "both": Effects(artificial_viscosity=0.3, quadratic_viscosity=2.0),
    "laminar viscosity": Effects(laminar_viscosity=0.02),
    "tensile correction": Effects(tensile_correction=0.2),
    "surface tension": Effects(surface_tension=0.5),
    "xsph": Effects(xsph=True),
    "shifting": Effects(shifting=1e-3),
    "shifting at its limit": Effects(shifting=200.0),
    "continuity": Effects(continuity=True),
    "diffusion": Effects(continuity=True, density_diffusion=0.1),
    "diffusion, gravity": Effects((1.5, -9.81), continuity=True, density_diffusion=0.1),
}


def extrapolated(**more):
    return Walls(**({"particles": TANK, "pressure": "extrapolated"} | more))


WALLS = {
    "like fluid": Walls(TANK),
    "like fluid, free slip": Walls(TANK, slip="free-slip"),
    "like fluid, lid": Walls(TANK, velocity=LID),
    "like fluid, moving": Walls(TANK, motion=SWING),
    "like fluid, some moving": Walls(TANK, velocity=LID, motion=replace(SWING, particles=LEFT)),
    "extrapolated": extrapolated(),
    "extrapolated, free slip": extrapolated(slip="free-slip"),
    "extrapolated, lid": extrapolated(velocity=(2.0, -1.0)),
    "extrapolated, moving": extrapolated(motion=SWING),
    "extrapolated, some moving": extrapolated(
        velocity=LID, motion=replace(SWING, particles=LEFT), slip="free-slip"
    ),
    "far walls": extrapolated(particles=TANK - (0.0, 1.05 * DX)),
    "box": Walls(box=BOX, restitution=0.5),
    "moving box": Walls(
        box=BOX, restitution=0.5, motion=Motion((-3.0, 2.0), sides=("right", "bottom"))
    ),
}
PERIOD = (0.0, 6 * DX)
PERIODS = {
    "x": {"period_x": PERIOD},
    "y": {"period_y": PERIOD},
    "both": {"period_x": PERIOD, "period_y": PERIOD},
}


def cloud(h_over_dx=2.6, n=N, speed=2.0, seed=0, **changes):
    """A jittered moving square of n x n particles in the lower left corner of the tank."""
    rng = np.random.default_rng(seed)
    x = lattice(0.0, n * DX, 0.0, n * DX, DX)
    x = x + rng.normal(0.0, 0.15 * DX, x.shape)
    arguments = {
        "name": "terms",
        "x": x,
        "v": rng.normal(0.0, speed, x.shape),
        "dx": DX,
        "h": h_over_dx * DX,
        "fluid": FREE,
        "controls": Controls(dt=2e-4, stiffness=1.3 * STIFFNESS, xsph=0.4),
    }
    return Scene(**(arguments | changes))


def periodic_cloud(periods, **changes):
    """The same, h = 1.4 dx, in a periodic square of 6 x 6; all of it moves out of the corner."""
    start = cloud(1.4, 6, **changes)
    x = np.array(start.x)
    v = np.asarray(start.v) + (15.0, 15.0) * np.isin(("period_x", "period_y"), list(periods))
    for axis, name in enumerate(("period_x", "period_y")):
        if name in periods:
            x[:, axis] = np.mod(x[:, axis], 6 * DX)
    walls = start.walls or Walls()
    return replace(start, x=x, v=v, walls=replace(walls, **periods))


def agrees(scene, n_steps=3, dt=None, neighbors=("grid", "brute"), tolerance=1e-10):
    """Fields at the start and after some steps are those of the naive solver."""
    for kind in neighbors:
        sim = Simulation(scene, neighbors=kind)
        sim.controls = sim.controls._replace(dt=dt or sim.controls.dt)
        naive, step = Naive(scene, sim.controls), sim.controls.dt
        state = naive.start(np.asarray(scene.x), np.asarray(scene.v))
        same_fields(sim, naive, state, tolerance)
        for _ in range(n_steps):
            assert not sim.advance(step).diverged
            before, state = state, naive.go_on(state, step)
        assert_close(fluid(sim, "x"), state.x, tolerance)
        assert_close(fluid(sim, "x") - before.x, state.x - before.x, 1e3 * tolerance)
        assert_close(fluid(sim, "v"), state.v, tolerance)
        same_fields(sim, naive, state, 10 * tolerance)


def same_fields(sim, naive, state, tolerance):
    x, v, rho, time, _ = state
    rho = rho if sim.scene.effects.continuity else None
    all_rho, p, _ = naive.fields(x, v, time, rho)
    assert_close(sim.rho, all_rho, tolerance)
    assert_close(sim.p, p, tolerance)
    assert_close(fluid(sim, "a"), naive.acceleration(x, v, time, rho), tolerance)
    at, moving, _ = naive.boundary(time)
    if len(at) == 0:
        return
    assert_close(sim.x[sim.n_fluid :], at, tolerance, at_least=DX)
    assert_close(sim.v[sim.n_fluid :], moving, tolerance, at_least=1.0)


@pytest.mark.parametrize("kernel", ALL_KERNELS)
def test_kernels(kernel):
    effects = replace(VISCOUS, xsph=True, tensile_correction=0.2)
    agrees(cloud(fluid=replace(FREE, kernel=kernel), effects=effects))


@pytest.mark.parametrize("name", FIELDS)
def test_gravity(name):
    # far from each other
    x = 4.0 * np.asarray(cloud().x)
    effects = Effects(gravity=FIELDS[name])
    agrees(cloud(x=x, speed=0.2, effects=effects, fluid=WATER), dt=0.02)


@pytest.mark.parametrize("clamp", [True, False])
@pytest.mark.parametrize("name", EFFECTS)
def test_effects(name, clamp):
    water = replace(FREE, kernel="cubic_spline", clamp=clamp)
    agrees(cloud(effects=EFFECTS[name], fluid=water))


def test_every_effect_is_among_them():
    default = Effects()
    changed = {
        field.name
        for one in EFFECTS.values()
        for field in fields(Effects)
        if getattr(one, field.name) != getattr(default, field.name)
    }
    assert changed == {field.name for field in fields(Effects)}


@pytest.mark.parametrize("name", EFFECTS)
def test_effects_at_walls(name):
    effects = EFFECTS[name]
    walls = WALLS["extrapolated" if effects.continuity else "like fluid"]
    water = replace(FREE, kernel="wendland_c2")
    agrees(cloud(effects=effects, walls=walls, fluid=water), neighbors=["grid"])


@pytest.mark.parametrize("field", [None, *FIELDS])
@pytest.mark.parametrize("name", WALLS)
def test_walls(name, field):
    water = replace(FREE, kernel="wendland_c2")
    effects = replace(VISCOUS, gravity=FIELDS.get(field))
    agrees(cloud(effects=effects, walls=WALLS[name], fluid=water), neighbors=["grid"])


@pytest.mark.parametrize("clamp", [True, False])
@pytest.mark.parametrize("gamma", [1.0, 7.0, 3.5])
def test_extrapolated_pressures_and_equations_of_state(gamma, clamp):
    water = replace(FREE, kernel="quintic_spline", clamp=clamp, gamma=gamma)
    agrees(cloud(effects=HEAVY, walls=extrapolated(), fluid=water), neighbors=["grid"])


@pytest.mark.parametrize("name", ["extrapolated", "extrapolated, some moving"])
def test_continuity_at_walls(name):
    effects = replace(HEAVY, continuity=True, density_diffusion=0.1)
    agrees(cloud(effects=effects, walls=WALLS[name], fluid=replace(FREE, kernel="wendland_c2")))


@pytest.mark.parametrize("periods", PERIODS)
@pytest.mark.parametrize("fluid", ["wendland_c2", "cubic_spline"])
def test_periodic_domains(periods, fluid):
    water = replace(FREE, kernel=fluid)
    effects = replace(HEAVY, xsph=True, continuity=fluid == "cubic_spline")
    agrees(periodic_cloud(PERIODS[periods], effects=effects, fluid=water))


@pytest.mark.parametrize("pressure", ["like fluid", "extrapolated"])
def test_periodic_channels(pressure):
    walls = Walls(CHANNEL, pressure=pressure, velocity=(1.0, 0.0))
    agrees(periodic_cloud(PERIODS["x"], effects=HEAVY, walls=walls))


INTEGRATED = {
    "summation": {"effects": replace(HEAVY, xsph=True, shifting=2.0)},
    "continuity": {"effects": replace(HEAVY, continuity=True, density_diffusion=0.1, xsph=True)},
    "time": {"effects": replace(VISCOUS, gravity=FIELDS["shaken"])},
    "spin": {"effects": replace(VISCOUS, gravity=FIELDS["rolling"])},
    "moving walls": {"effects": HEAVY, "walls": WALLS["like fluid, some moving"]},
    "walls that mirror": {
        "effects": replace(HEAVY, gravity=FIELDS["shaken"], continuity=True),
        "walls": extrapolated(velocity=LID, motion=replace(SWING, particles=LEFT)),
    },
}


@pytest.mark.parametrize(
    "integrator", ["symplectic_euler", "kick_drift_kick", "predictor_corrector"]
)
@pytest.mark.parametrize("name", INTEGRATED)
def test_integrators(name, integrator):
    water = replace(FREE, kernel="wendland_c2")
    scene = cloud(fluid=water, integrator=integrator, **INTEGRATED[name])
    agrees(scene, 4, neighbors=["grid"])


@pytest.mark.parametrize("integrator", ["kick_drift_kick", "predictor_corrector"])
def test_integrators_in_periodic_domains(integrator):
    start = periodic_cloud(PERIODS["both"], effects=replace(HEAVY, xsph=True))
    agrees(replace(start, integrator=integrator), 4, neighbors=["grid"])


# --- What is conserved ----------------------------------------------------------------------

# Those that hold an effect which acts on single particles, not between two.
ON_ONE = [
    "diffusion, gravity",
]
PAIRWISE = {name: one for name, one in EFFECTS.items() if name not in ON_ONE}
CENTRAL = ["artificial viscosity", "quadratic viscosity", "tensile correction"]


@pytest.mark.parametrize("name", PAIRWISE)
def test_forces_between_particles_add_up_to_nothing(name):
    sim = Simulation(cloud(effects=PAIRWISE[name]))
    sim.advance(sim.controls.dt)  # by continuity, all is at rest density at first
    a = sim.a
    assert np.abs(a).max() > 1.0
    assert_close(a.sum(axis=0), np.zeros(2), 1e-13, at_least=np.abs(a).sum())


@pytest.mark.parametrize("name", CENTRAL)
def test_central_forces_exert_no_torque(name):
    sim, none = Simulation(cloud(effects=EFFECTS[name])), Simulation(cloud())
    x, a = sim.x, sim.a
    torque = x[:, 0] * a[:, 1] - x[:, 1] * a[:, 0]
    assert abs(torque.sum()) <= 1e-13 * np.abs(torque).sum()
    assert np.abs(a - none.a).max() > 1e-3 * np.abs(a).max()  # it is there


def endless(n=12, h_over_dx=2.6, **changes):
    """A periodic cloud, with less jitter, so that nowhere it is as thin as at a surface."""
    ends, rng = (0.0, n * DX), np.random.default_rng(1)
    x = lattice(*ends, *ends, DX)
    x = changes.pop("x", x + 0.1 * DX * rng.uniform(-1.0, 1.0, x.shape))
    walls = Walls(period_x=ends, period_y=ends)
    return cloud(h_over_dx, n, x=np.mod(x, n * DX), walls=walls, **changes)


@pytest.mark.parametrize("name", ["xsph", "shifting"])
def test_what_only_moves_particles_keeps_momentum_and_the_centre_of_mass(name):
    sim, none = Simulation(endless(effects=EFFECTS[name])), Simulation(endless())
    for each in (sim, none):
        each.advance(each.controls.dt)
    assert_close(sim.v, none.v, 1e-13)
    moved = sim.x - none.x
    assert np.abs(moved).max() > 1e-6 * DX
    assert_close(moved.sum(axis=0), np.zeros(2), 1e-10, at_least=np.abs(moved).sum())


def shifts(scene):
    """The velocities (n, 2) [m/s] that shifting adds to those of the particles."""
    without = replace(scene.effects, shifting=None)
    sim, none = Simulation(scene), Simulation(replace(scene, effects=without))
    for each in (sim, none):
        each.advance(each.controls.dt)
    return (sim.x - none.x) / sim.controls.dt


def test_a_shift_is_no_faster_than_half_of_what_c0_is_meant_for():
    for name, limit in (("shifting", False), ("shifting at its limit", True)):
        speeds = np.hypot(*shifts(endless(effects=EFFECTS[name])).T)
        assert speeds.max() <= 0.05 * C0 * (1 + 1e-9)
        assert (np.isclose(speeds, 0.05 * C0, rtol=1e-9).sum() > len(speeds) / 2) == limit


@pytest.mark.every(3)
@pytest.mark.parametrize("kernel", ["mueller", "wendland_c2", "spiky", "quintic_spline"])
@pytest.mark.parametrize("continuity", [False, True])
def test_nothing_shifts_across_a_free_surface(kernel, continuity):
    """A sheet, endless along x: particles of the surfaces don't shift, others along them only."""
    ends, rng = (0.0, 12 * DX), np.random.default_rng(3)
    x = lattice(*ends, 0.0, 9 * DX, DX)
    row = np.round(x[:, 1] / DX - 0.5)
    edge, below = np.isin(row, (0, 8)), np.isin(row, (1, 2, 6, 7))
    water = Fluid(c0=C0, kernel=kernel, clamp=False)
    effects = Effects(shifting=2.0, continuity=continuity)
    still = cloud(2.8, x=x, v=None, fluid=water, effects=effects, walls=Walls(period_x=ends))
    # the limit, 0.5 m/s, if the surface were unknown
    assert np.abs(shifts(still)).max() < 0.01
    moved = shifts(replace(still, x=x + 0.1 * DX * rng.uniform(-1.0, 1.0, x.shape) * (1.0, 0.0)))
    along, across = np.abs(moved).T
    assert along[below].max() > 0.2
    assert across[edge | below].max() < 0.05


def test_particles_shift_to_where_there_are_fewer():
    x = lattice(0.0, 12 * DX, 0.0, 12 * DX, DX)
    x[66] += (0.3 * DX, 0.0)
    assert shifts(endless(x=x, v=None, effects=Effects(shifting=0.5)))[66, 0] < 0.0


@pytest.mark.every(3)
@pytest.mark.parametrize("h_over_dx", [2.0, 2.5, 3.0, 3.5, 4.0])
@pytest.mark.parametrize("kernel", KERNELS)
def test_laminar_viscosity_is_exact_for_a_parabola_on_the_rest_lattice(kernel, h_over_dx):
    # whose ends are not within h of the middle
    nu, n = 0.02, round(4 * h_over_dx)
    x = lattice(0.0, n * DX, 0.0, n * DX, DX)
    v = np.stack([3.0 * x[:, 1] ** 2, np.zeros(n * n)], axis=-1)
    water, effects = Fluid(c0=C0, kernel=kernel), Effects(laminar_viscosity=nu)
    sim = Simulation(endless(n, h_over_dx, x=x, v=v, fluid=water, effects=effects))
    assert sim.a[n * n // 2 + n // 2] == pytest.approx([6.0 * nu, 0.0], rel=1e-9, abs=1e-9)


def growth(scene, rho=None):
    """d rho/dt [kg/(m^3 s)] of the fluid, whose density may be given."""
    sim = Simulation(scene)
    if rho is not None:
        snapshot = sim.snapshot()
        snapshot["fluid"]["offset"] += (rho - fluid(sim, "rho"))[snapshot["fluid"]["id"]]
        sim.restore(snapshot)
    before, dt = fluid(sim, "rho"), 1e-7
    sim.controls = sim.controls._replace(dt=dt)
    sim.advance(dt)
    return (fluid(sim, "rho") - before) / dt, sim


@pytest.mark.parametrize("gravity", [None, (1.5, -9.81)])
def test_diffusion_moves_density_and_makes_none(gravity):
    water = replace(FREE, kernel="wendland_c2")
    rho = np.random.default_rng(1).uniform(990.0, 1010.0, N * N)
    named = Effects(gravity=gravity, continuity=True)
    diffused, _ = growth(cloud(effects=replace(named, density_diffusion=0.1), fluid=water), rho)
    without, _ = growth(cloud(effects=named, fluid=water), rho)
    flow = diffused - without
    assert np.abs(flow).max() > 1.0
    assert_close(flow.sum(), 0.0, 1e-5, at_least=np.abs(flow).sum())
    # downhill: entropy grows
    if gravity is None:
        assert (flow * rho).sum() < 0.0


def test_a_column_at_rest_does_not_diffuse():
    """But for its two ends, where the linear law is not the whole truth, and its free sides."""
    water = replace(FREE, kernel="wendland_c2", gamma=1.0)
    named = Effects(gravity=(0.0, -9.81), continuity=True, density_diffusion=0.1)
    x = lattice(0.0, SIDE, 0.0, SIDE, DX)
    # Tait's B is 1.3 times the nominal one, for any exponent
    rho = 1000.0 * (1 - 9.81 * x[:, 1] / (1.3 * C0**2 / 7))
    still, _ = growth(cloud(x=x, v=None, effects=named, fluid=water), rho)
    naked, _ = growth(cloud(x=x, v=None, effects=replace(named, gravity=None), fluid=water), rho)
    assert np.abs(naked).max() > 1.0
    assert np.abs(still).max() < 1e-3 * np.abs(naked).max()


def test_the_work_of_pressure_is_what_continuity_stores():
    """sum m v . a + sum m p / rho^2 d rho/dt = 0: one is the other's adjoint."""
    water = replace(FREE, kernel="wendland_c2")
    rho = np.random.default_rng(1).uniform(990.0, 1010.0, N * N)
    rate, sim = growth(cloud(effects=Effects(continuity=True), fluid=water), rho)
    naive = Naive(sim.scene, sim.controls)
    x, v = np.asarray(sim.scene.x), np.asarray(sim.scene.v)
    power = (v * naive.acceleration(x, v, 0.0, rho)).sum()
    stored = (naive.pressure(rho) / rho**2 * rate).sum()
    assert stored == pytest.approx(-power, rel=1e-5)


def test_an_expanding_cloud_becomes_thinner_as_it_must():
    """v = s x has the divergence 2 s everywhere, and a kernel sum for it inside."""
    x = lattice(0.0, 7 * DX, 0.0, 7 * DX, DX)
    start = cloud(x=x, v=3.0 * x, effects=Effects(continuity=True))
    rate, _ = growth(replace(start, fluid=replace(FREE, kernel="wendland_c2")))
    assert rate[24] == pytest.approx(-2 * 3.0 * 1000.0, rel=0.05)


def test_tensile_correction_keeps_pairs_apart_and_no_more():
    """Under tension it pushes nearby particles apart; at twice dx there is nothing left of it."""
    for gap, sign in ((0.7, 1.0), (1.0, 1.0), (2.2, 0.0)):
        pair = {"x": [(0.0, 0.0), (gap * DX, 0.0)], "v": None}
        water = replace(FREE, kernel="cubic_spline")
        a = [
            Simulation(cloud(**pair, fluid=water, effects=effects)).a[1, 0]
            for effects in (Effects(tensile_correction=0.2), Effects())
        ]
        assert a[1] < 0.0  # tension pulls
        change = (a[0] - a[1]) / abs(a[1])
        assert change == pytest.approx(0.2 * sign, rel=0.05 if gap == 1.0 else 30.0, abs=0.01)
