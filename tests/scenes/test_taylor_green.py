import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.scenes import taylor_green as tg
from sph_gym.scenes.shared.reference import Run
from sph_gym.scenes.taylor_green import REFERENCE, taylor_green
from tests.scenes.planted import planted


def test_the_flow_solves_the_equations_of_motion():
    x, step = np.random.default_rng(0).uniform(0, 1, (50, 2)), 1e-4
    east, north = np.array([step, 0.0]), np.array([0.0, step])
    there = tg.velocity(x)
    du = (tg.velocity(x + east) - tg.velocity(x - east)) / (2 * step)
    dv = (tg.velocity(x + north) - tg.velocity(x - north)) / (2 * step)
    assert np.allclose(du[:, 0] + dv[:, 1], 0.0, atol=1e-5)
    around = [tg.velocity(x + s) for s in (east, -east, north, -north)]
    laplacian = (sum(around) - 4 * there) / step**2
    assert np.allclose(laplacian, -8 * np.pi**2 * there, atol=1e-3)
    # what is left is the gradient of a pressure
    advection = there[:, :1] * du + there[:, 1:] * dv
    pressure = -np.pi * np.sin(4 * np.pi * x)
    assert np.allclose(advection, pressure, atol=1e-4)


def test_the_error_is_that_of_the_state():
    scene = taylor_green(dx=0.05, size=2.0, speed=3.0, reynolds=60.0)
    nu = 0.1
    decay = np.exp(-8 * np.pi**2 * nu / 4.0 * 0.2)
    v = 3.0 * decay * tg.velocity(np.asarray(scene.x) / 2.0)
    assert tg.error(planted(scene, v, 0.2)) == pytest.approx(0.0, abs=1e-12)
    assert tg.error(planted(scene, 1.07 * v, 0.2)) == pytest.approx(0.07)
    turned = tg.observe(planted(scene, -v, 0.2))
    assert turned["error"] == pytest.approx(0.0, abs=1e-12)
    assert turned["vector"] == pytest.approx(2.0)


def test_the_decay_rate_is_that_of_the_energy():
    scene = taylor_green(dx=0.05)
    sim = planted(scene, np.asarray(scene.v))
    times = np.linspace(0, 1, 11)
    exact = 16 * np.pi**2 * 0.01
    run = Run(sim, times, [{"kinetic": np.exp(-1.1 * exact * t)} for t in times])
    assert 2 * tg.rate(sim) == pytest.approx(exact)
    assert tg.decay_rate(run) == pytest.approx(1.1 * exact)


def test_the_jitter_is_that_of_the_seed():
    x = [np.asarray(taylor_green(dx=0.05, seed=seed).x) for seed in (1, 1, 2)]
    assert np.array_equal(x[0], x[1])
    assert not np.array_equal(x[0], x[2])
    lattice = np.asarray(taylor_green(dx=0.05, jitter=0.0).x)
    assert np.allclose(np.diff(lattice[:20, 0]), 0.05)


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("dx", 0.0),
        ("size", 0.1),
        ("speed", -1.0),
        ("reynolds", np.nan),
        ("jitter", 0.6),
        ("seed", -1),
        ("seed", 0.5),
    ],
)
def test_wrong_values_are_named(argument, value):
    with pytest.raises(ValueError, match=f"{argument}: expected"):
        taylor_green(**{argument: value})


def test_a_coarse_run_decays_as_it_should():
    run = REFERENCE.run(Simulation(taylor_green(dx=1 / 25), threads=1))
    first, of_largest, vector, decay = REFERENCE.judge(run)
    assert first.bound is None
    assert first.value < 0.05
    assert of_largest.value < first.value < vector.value < 0.08
    assert decay.value < 6.0
    seen, exact = REFERENCE.chart(run).curves
    assert np.allclose(seen.y, exact.y, atol=0.05)
