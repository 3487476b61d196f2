from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Simulation, channel_particles
from sph_gym.scenes import couette as c
from sph_gym.scenes import poiseuille as p
from sph_gym.scenes.shared.channel import height_of, tau
from sph_gym.scenes.shared.reference import Run, read
from sph_gym.solver.kernels import KERNELS
from tests.scenes.planted import planted

FLOWS = {"poiseuille": (p, p.poiseuille), "couette": (c, c.couette)}
TABLE = read("poiseuille_couette_startup.csv")


@pytest.mark.parametrize(
    ("module", "places", "columns"),
    [(p, [0.5, 0.25], [1, 2]), (c, [0.25, 0.5, 0.75], [3, 4, 5])],
)
def test_the_series_give_the_tabulated_values(module, places, columns):
    for row in TABLE:
        exact = module.velocity(np.array(places), row[0])
        assert np.allclose(exact, row[columns], atol=1.5e-5)


@pytest.mark.parametrize("module", [p, c])
def test_the_series_obey_the_diffusion_equation(module):
    y, t, step = np.linspace(0.1, 0.9, 9), 0.05, 1e-3
    there = [module.velocity(y + k * step, t) for k in (-1, 0, 1)]
    curvature = (there[0] - 2 * there[1] + there[2]) / step**2
    change = (module.velocity(y, t + 1e-5) - module.velocity(y, t - 1e-5)) / 2e-5
    assert np.allclose(change, curvature + (8.0 if module is p else 0.0), atol=2e-3)


@pytest.mark.parametrize("module", [p, c])
def test_the_series_begin_at_rest_and_stick_to_the_walls(module):
    y = np.linspace(0.0, 1.0, 21)
    assert np.allclose(module.velocity(y[:-1], 0.0), 0.0, atol=1e-5)
    assert np.allclose(module.velocity(y, 1e-4)[:-2], 0.0, atol=1e-3)
    top = 0.0 if module is p else 1.0
    assert np.allclose(module.velocity(np.array([0.0, 1.0]), 0.1), [0.0, top], atol=1e-12)


@pytest.mark.parametrize("name", FLOWS)
def test_the_error_is_that_of_the_state(name):
    module, builder = FLOWS[name]
    scene = builder(dx=0.1, height=2.0, speed=0.5, reynolds=4.0)
    nu = 0.25
    y = np.asarray(scene.x)[:, 1] / 2.0
    v = np.zeros((len(y), 2))
    v[:, 0] = 0.5 * module.velocity(y, 0.1)
    time = 0.1 * 2.0**2 / nu
    assert module.REFERENCE.error(planted(scene, v, time)) == pytest.approx(0.0, abs=1e-9)
    v[7, 0] += 0.01
    assert module.REFERENCE.error(planted(scene, v, time)) == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("name", FLOWS)
def test_geometry_and_times_follow_the_arguments(name):
    _, builder = FLOWS[name]
    scene = builder(dx=0.1, height=1.04, speed=2.0, reynolds=5.0)
    state = planted(scene, np.zeros_like(np.asarray(scene.x)), time=scene.frame)
    assert height_of(state) == pytest.approx(1.0)
    assert scene.effects.laminar_viscosity == pytest.approx(0.4)
    assert tau(state) == pytest.approx(0.0025)
    assert np.allclose(TABLE[:, 0] / 0.0025, np.round(TABLE[:, 0] / 0.0025))
    assert scene.duration == pytest.approx(200 * scene.frame)


@pytest.mark.parametrize("name", FLOWS)
@pytest.mark.parametrize("argument", ["dx", "height", "speed", "reynolds"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_wrong_values_are_named(name, argument, value):
    with pytest.raises(ValueError, match=f"{argument}: expected"):
        FLOWS[name][1](**{argument: value})


# Re = 1: the step is the viscous one, which must be that of the kernel
@pytest.mark.parametrize(("name", "reynolds"), [("poiseuille", 1.0), ("couette", 10.0)])
def test_a_coarse_run_follows_the_series(name, reynolds):
    module, builder = FLOWS[name]
    sim = Simulation(builder(dx=0.1, reynolds=reynolds), threads=1)
    run = module.REFERENCE.run(sim)
    assert isinstance(run, Run)
    assert len(run.times) == 201
    first, *_ = module.REFERENCE.judge(run)
    assert first.bound is None
    assert first.value < 3.0
    chart = module.REFERENCE.chart(run)
    assert len(chart.curves) == 10
    for seen, exact in zip(chart.curves[::2], chart.curves[1::2], strict=True):
        there = np.interp(np.asarray(seen.y), np.asarray(exact.y), np.asarray(exact.x))
        assert np.allclose(seen.x, there, atol=0.03)


# --- The viscosity that the flow shows ------------------------------------------------------

RATIOS = [2.0, 2.5, 3.0, 3.5, 4.0]


def channel(name, kernel, ratio, across):
    """Return the scene of a flow with another kernel and h / dx, in walls as thick as h."""
    scene = FLOWS[name][1](dx=1 / across)
    boundary = channel_particles(16 / across, 1.0, 1 / across, layers=4)
    velocity = np.where((boundary[:, 1:] > 1.0) & (name == "couette"), (1.0, 0.0), (0.0, 0.0))
    return replace(
        scene,
        h=ratio * scene.dx,
        fluid=replace(scene.fluid, kernel=kernel),
        walls=replace(scene.walls, particles=boundary, velocity=velocity),
    )


def seen_viscosity(kernel, ratio, across):
    """Return nu of Poiseuille flow as it rises and at the end, of its own nu."""
    sim = Simulation(channel("poiseuille", kernel, ratio, across), threads=1)
    found = []
    for _ in range(2):
        assert not sim.advance(sim.scene.duration / 2).diverged
        exact = p.velocity(sim.x[: sim.n_fluid, 1], tau(sim))
        found.append((exact**2).sum() / (exact * sim.v[: sim.n_fluid, 0]).sum())
    return found


def tolerance(kernel, ratio):
    """Return the largest error of nu; at 2 dx, a quintic spline hardly sees its neighbours."""
    return 0.02 if (kernel, ratio) == ("quintic_spline", 2.0) else 0.01


@pytest.mark.parametrize("ratio", RATIOS)
def test_poiseuille_flow_is_as_viscous_as_it_should_be(ratio):
    kernel = "quintic_spline"
    found = seen_viscosity(kernel, ratio, 20)
    assert found == pytest.approx([1.0, 1.0], abs=tolerance(kernel, ratio))


@pytest.mark.slow
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("kernel", KERNELS)
def test_every_kernel_is_as_viscous_as_it_should_be(kernel, ratio):
    found = {across: seen_viscosity(kernel, ratio, across) for across in (20, 40)}
    print(f"| {kernel} | {ratio} |", *(f"{nu:.4f} |" for nus in found.values() for nu in nus))
    for nus in found.values():
        assert nus == pytest.approx([1.0, 1.0], abs=tolerance(kernel, ratio))


@pytest.mark.slow
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("kernel", KERNELS)
def test_couette_flow_sticks_to_its_walls(kernel, ratio):
    sim = Simulation(channel("couette", kernel, ratio, 20), threads=1)
    sim.advance(sim.scene.duration)
    error = c.REFERENCE.error(sim)
    print(f"| {kernel} | {ratio} | {error:.3f} % of Umax |")
    assert error < 1.0
