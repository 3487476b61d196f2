"""Every number of `Simulation.diagnostics` from its definition."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sph_gym import CentralGravity, Effects, Gravity, Motion, Simulation, Walls, lattice, scenes
from sph_gym.solver.diagnostics import quantile
from tests import naive
from tests.cases import ALL_EFFECTS, DX, PERIOD, STIFFNESS, clouds, fluid, simulation, uncompiled
from tests.solver.test_terms import HEAVY, SIDE, TANK, cloud, extrapolated


def distances(x):
    """(n, n) [m], infinite from a particle to itself."""
    offset = x[:, None] - x[None]
    return np.hypot(offset[..., 0], offset[..., 1]) + np.diag(np.full(len(x), np.inf))


@clouds
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_numbers_are_those_of_their_definitions(dtype, cloud):
    sim = simulation("everything", cloud, dtype)
    numbers = sim.diagnostics()
    x, v, rho, a = (fluid(sim, field) for field in ("x", "v", "rho", "a"))
    m, r, h = sim.mass, distances(x), sim.scene.h
    nearest = np.where(r < h, r, np.inf).min(axis=1) / DX
    excess = np.maximum(rho / 1000.0 - 1.0, 0.0)
    momentum = m * v.sum(axis=0)
    centre = x.mean(axis=0)
    speed = np.linalg.norm(v, axis=1).max()
    flow = naive.smooth_flow(x, v, h)
    # the fit solves equations, so that single precision shows more
    fit = {"float64": 1e-9, "float32": 1e-3}[dtype]
    found = numbers["velocity_noise"], numbers["flow_speed"]
    fast = np.sqrt(np.quantile((flow**2).sum(axis=1), 0.99))
    # in single precision, particles at a distance of just h are neighbours or none by rounding
    if (dtype, cloud) != ("float32", "lattice 2"):
        assert found == pytest.approx((((v - flow) ** 2).sum(axis=1).mean(), fast), rel=fit)
    expected = {
        "time": 0.0,
        "density_error": excess.mean(),
        "density_error_p99": np.quantile(excess, 0.99),
        "min_spacing": nearest.min(),
        "median_spacing": np.median(nearest),
        "kinetic_energy": 0.5 * m * (v**2).sum(),
        "potential_energy": -m * len(x) * (1.5 * centre[0] - 9.81 * centre[1]),
        "com_x": centre[0],
        "com_y": centre[1],
        "extent_x": x[:, 0].std(),
        "extent_y": x[:, 1].std(),
        "lowest": x[:, 1].min(),
        "front": x[:, 0].max(),
        "momentum_x": momentum[0],
        "momentum_y": momentum[1],
        "angular_momentum": m * (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]).sum(),
        "max_speed": speed,
        "max_acceleration": np.linalg.norm(a, axis=1).max(),
        "mach": speed / np.sqrt(7 * sim.controls.stiffness / 1000.0),
        "courant": sim.controls.dt * np.sqrt(7 * sim.controls.stiffness / 1000.0) / h,
        **dict.fromkeys(("blowup_cause", "blowup_substep", "time_to_failure"), -1.0),
    }
    # momenta and densities cancel, so that single precision shows
    loose = {"float64": 1e-12, "float32": 1e-5}[dtype]
    for name, value in expected.items():
        assert numbers[name] == pytest.approx(value, rel=loose, abs=loose), name
    if dtype == "float64":
        neighbors = (distances(sim.x) < h)[: sim.n_fluid].sum(axis=1)
        assert (sim.neighbor_counts == neighbors).all()
        assert numbers["mean_neighbors"] == pytest.approx(neighbors.mean())
        assert numbers["clumping"] == pytest.approx((nearest < 0.6).mean())
        assert numbers["surface"] == pytest.approx((rho < 900.0).mean())
        off = np.linalg.norm(a - (1.5, -9.81), axis=1)
        assert numbers["adrift"] == pytest.approx((off < 0.1 * np.hypot(1.5, 9.81)).mean())
    assert all(isinstance(value, float) for value in numbers.values())
    assert set(numbers) - set(expected) == {
        "mean_neighbors",
        "clumping",
        "surface",
        "adrift",
        "internal_energy",
        "energy_excess",
        "velocity_noise",
        "flow_speed",
    }


@clouds
def test_internal_energy_is_the_work_of_compression_walls_included(cloud):
    sim = simulation("everything", cloud)

    nodes, weights = np.polynomial.legendre.leggauss(20)

    def work(rho):
        half = max(rho - 1000.0, 0.0) / 2
        between = 1000.0 + half * (1 + nodes)
        pressure = sim.controls.stiffness * ((between / 1000.0) ** 7 - 1)
        return half * (weights * pressure / between**2).sum()

    expected = sim.mass * sum(work(rho) for rho in sim.rho)
    assert sim.diagnostics()["internal_energy"] == pytest.approx(expected, rel=1e-8, abs=1e-9)


def test_a_lonely_particle_has_numbers():
    sim = simulation("open space", x=[(1.0, 2.0)], v=[(3.0, 4.0)])
    numbers = sim.diagnostics()
    assert numbers["max_speed"] == 5.0
    assert numbers["mean_neighbors"] == numbers["clumping"] == 0.0
    assert numbers["min_spacing"] == numbers["median_spacing"] == np.inf
    assert numbers["density_error"] == 0.0


def test_a_resting_lattice_is_faultless():
    sim = simulation("none", x=lattice(0.0, 0.3, 0.0, 0.3, DX), v=None, h=3 * DX)
    numbers = sim.diagnostics()
    assert numbers["density_error_p99"] < 1e-12
    assert numbers["clumping"] == 0.0
    assert numbers["min_spacing"] == pytest.approx(1.0)
    assert numbers["energy_excess"] == 0.0


def test_energy_of_a_fall_is_no_excess():
    effects = replace(ALL_EFFECTS, gravity=Gravity(1.5, -9.81, ramp=0.05))
    sim = simulation("open space", "lattice 3", v=None, effects=effects)
    sim.controls = sim.controls._replace(dt=1e-4)
    for _ in range(20):
        assert not sim.advance(5e-3).diverged
    numbers = sim.diagnostics()
    assert numbers["kinetic_energy"] > 1.0
    assert abs(numbers["energy_excess"]) < 0.01


@given(
    st.lists(st.sampled_from([0.0, 0.1, 0.5, 2.0, 7.0, np.inf]), min_size=1, max_size=40),
    st.sampled_from([0.0, 0.25, 0.5, 0.99, 1.0]),
)
def test_quantiles_are_those_of_numpy(values, share):
    found = quantile(np.array([*values, -1.0]), len(values), share)
    expected = np.quantile(np.minimum(values, 1e300), share)
    assert found == pytest.approx(expected) or (np.isinf(found) and expected > 1e290)


@pytest.mark.parametrize("configuration", ["everything", "all, euler", "all, kick"])
def test_pressures_follow_the_stiffness(configuration):
    sim, fresh = simulation(configuration), simulation(configuration)
    sim.controls = sim.controls._replace(stiffness=2 * sim.controls.stiffness)
    fresh.restore(sim.snapshot())
    for field in ("rho", "p", "a"):
        assert np.array_equal(getattr(sim, field), getattr(fresh, field)), field
    assert sim.advance(2e-3) == fresh.advance(2e-3)
    assert np.array_equal(sim.x, fresh.x)


def test_raising_the_stiffness_is_booked_as_work():
    sim = simulation("none", speed=0.0)
    before = sim.diagnostics()
    sim.controls = sim.controls._replace(stiffness=20 * STIFFNESS)
    after = sim.diagnostics()
    assert after["internal_energy"] == pytest.approx(
        before["internal_energy"] * 20 / 1.3, rel=1e-12
    )
    assert after["energy_excess"] == pytest.approx(before["energy_excess"], abs=1e-12)


@pytest.mark.parametrize("name", scenes.names())
def test_scenes_start_well(name):
    sim = Simulation(scenes.make(name))
    numbers = sim.diagnostics()
    assert numbers["clumping"] == 0.0
    assert numbers["density_error"] < 0.03
    assert numbers["energy_excess"] == 0.0
    fastest = np.hypot(*np.asarray(sim.scene.v).T).max()
    assert numbers["max_speed"] == pytest.approx(fastest, rel=1e-15)
    assert numbers["courant"] <= 0.4 + 1e-12


# --- What came later ------------------------------------------------------------------------


@uncompiled
def test_potential_energy_in_a_central_field():
    field = CentralGravity(3.0, 0.2, -0.1)
    sim = Simulation(cloud(effects=Effects(gravity=field)))
    offset = sim.x - (0.2, -0.1)
    expected = 0.5 * sim.mass * 9.0 * (offset**2).sum()
    assert sim.diagnostics()["potential_energy"] == pytest.approx(expected, rel=1e-12)


@uncompiled
def test_energy_of_an_orbit_is_no_excess():
    effects = Effects(gravity=CentralGravity(3.0))
    sim = Simulation(cloud(x=[(1.0, 0.0)], v=[(0.0, 0.1)], effects=effects))
    sim.controls = sim.controls._replace(dt=1e-3)
    kinetic = []
    for _ in range(20):
        assert not sim.advance(0.05).diverged
        assert abs(sim.diagnostics()["energy_excess"]) < 0.02
        kinetic.append(sim.diagnostics()["kinetic_energy"])
    assert max(kinetic) > 4.0 * sim.mass


@uncompiled
def test_walls_that_mirror_the_pressure_store_no_energy():
    like, mirrors = (
        Simulation(cloud(effects=HEAVY, walls=walls)) for walls in (Walls(TANK), extrapolated())
    )
    assert mirrors.diagnostics()["internal_energy"] < like.diagnostics()["internal_energy"]
    alone = Simulation(cloud(x=np.asarray(mirrors.scene.x), effects=HEAVY, walls=extrapolated()))
    assert alone.diagnostics()["internal_energy"] == mirrors.diagnostics()["internal_energy"]


def test_neighbors_are_counted_through_the_ends_of_a_domain():
    sim = simulation("periodic", h=2.6 * DX)
    offset = sim.x[:, None] - sim.x[None]
    length = PERIOD[1] - PERIOD[0]
    offset -= length * np.round(offset / length)
    r = np.hypot(offset[..., 0], offset[..., 1]) + np.diag(np.full(len(sim.x), np.inf))
    assert (sim.neighbor_counts == (r < 2.6 * DX).sum(axis=1)).all()
    numbers = sim.diagnostics()
    assert numbers["min_spacing"] == pytest.approx(r.min() / DX)
    assert numbers["mean_neighbors"] == pytest.approx((r < 2.6 * DX).sum(axis=1).mean())


@uncompiled
def test_a_lid_may_set_a_fluid_in_motion():
    """What walls that slide bring in is not spurious energy."""
    x = lattice(0.0, SIDE, 0.0, SIDE, DX)
    walls = extrapolated(velocity=(3.0, 0.0))
    sim = Simulation(cloud(x=x, v=None, effects=Effects(laminar_viscosity=0.05), walls=walls))
    for _ in range(5):
        assert not sim.advance(10 * sim.controls.dt).diverged
    assert 0.01 < sim.diagnostics()["energy_excess"] < 1.0
    assert Motion((3.0, 4.0), (1.0, 0.0), 1.0).top_speed == pytest.approx(5.0 + 2 * np.pi)


# --- Noise ----------------------------------------------------------------------------------

GRADIENT = st.floats(-20.0, 20.0)
# shift, gradient of u and v
AFFINE = st.tuples(GRADIENT, GRADIENT, GRADIENT, GRADIENT, GRADIENT, GRADIENT)


def noise(x, v, **more):
    """Return the mean noise and the flow speed."""
    numbers = simulation("none", x=x, v=v, **more).diagnostics()
    return numbers["velocity_noise"], numbers["flow_speed"]


@given(AFFINE, st.sampled_from(["jittered", "lattice 2", "disordered"]))
def test_a_fluid_that_moves_turns_and_shears_as_a_whole_has_no_noise(flow, cloud):
    x = simulation("none", cloud).x
    v = np.array(flow[:2]) + x @ np.reshape(flow[2:], (2, 2))
    found, speed = noise(x, v, cloud=cloud)
    assert 0.0 <= found < 1e-12
    fastest = np.sqrt(np.quantile((v**2).sum(axis=1), 0.99))
    assert speed == pytest.approx(fastest, rel=1e-9, abs=1e-9)


def test_noise_is_the_same_wherever_it_is_and_however_it_moves():
    sim = simulation("none")
    x, v = sim.x, fluid(sim, "v")
    usual, _ = noise(x, v)
    assert usual > 1.0
    # half a cell, so that particles have other neighbours in the lists, and a wind
    for shift, wind in (((0.37 * DX, 5.0), (0.0, 0.0)), ((0.0, 0.0), (30.0, -7.0))):
        assert noise(x + shift, v + wind)[0] == pytest.approx(usual, rel=1e-9)
    assert noise(x, 3.0 * v)[0] == pytest.approx(9.0 * usual, rel=1e-12)


def test_noise_on_a_smooth_flow_is_that_noise():
    sim = simulation("none")
    x, v = sim.x, fluid(sim, "v")
    alone, _ = noise(x, v)
    assert noise(x, v + x @ [[3.0, -8.0], [5.0, 2.0]])[0] == pytest.approx(alone, rel=1e-9)


@pytest.mark.parametrize(
    "x",
    [
        DX * np.array([(0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0.5), (1.5, 0.5)]),
        DX * np.stack([np.linspace(0, 2, 9), 1e-3 * np.arange(9)], axis=1),
    ],
    ids=["six particles", "a line"],
)
def test_where_no_flow_can_be_fitted_there_is_no_noise(x):
    v = np.random.default_rng(0).normal(size=x.shape)
    found, speed = noise(x, v)
    assert found == 0.0
    assert speed == pytest.approx(np.sqrt(np.quantile((v**2).sum(axis=1), 0.99)))


def test_noise_is_measured_through_the_ends_of_a_domain():
    sim = simulation("periodic", h=2.6 * DX)
    v = fluid(sim, "v")
    flow = naive.smooth_flow(sim.x, v, 2.6 * DX, PERIOD[1] - PERIOD[0])
    expected = ((v - flow) ** 2).sum(axis=1).mean()
    assert sim.diagnostics()["velocity_noise"] == pytest.approx(expected, rel=1e-9)
