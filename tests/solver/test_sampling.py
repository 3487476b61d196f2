import numpy as np
import pytest

from sph_gym.scenes.couette import couette
from sph_gym.scenes.lid_driven_cavity import lid_driven_cavity
from sph_gym.solver import sampling
from sph_gym.solver.sampling import interpolate
from tests.scenes.planted import planted


def test_a_linear_flow_is_found_between_the_particles(monkeypatch):
    scene = lid_driven_cavity(dx=0.05)
    x = np.asarray(scene.x)
    sim = planted(scene, np.stack([2 * x[:, 1], 1 - x[:, 0]], axis=-1))
    points = np.random.default_rng(0).uniform(0.25, 0.75, (20, 2))
    found = interpolate(sim, points)
    exact = np.stack([2 * points[:, 1], 1 - points[:, 0]], axis=-1)
    assert np.allclose(found, exact, atol=2e-3)
    monkeypatch.setattr(sampling, "CHUNK", 3 * sim.n_particles)
    assert np.allclose(interpolate(sim, points), found, rtol=1e-14)


def test_walls_take_part_if_they_are_asked_to():
    scene = lid_driven_cavity(dx=0.05)
    sim = planted(scene, np.zeros_like(np.asarray(scene.x)))
    at_lid = [[0.5, 1.0]]
    assert interpolate(sim, at_lid)[0, 0] == pytest.approx(0.5)
    assert np.array_equal(interpolate(sim, at_lid, walls=False), [[0.0, 0.0]])


def test_weights_reach_through_periodic_ends():
    scene = couette(dx=0.1)
    x = np.asarray(scene.x)
    sim = planted(scene, np.stack([np.where(x[:, 0] < 0.3, 1.0, 0.0), 0 * x[:, 0]], axis=-1))
    (far,) = interpolate(sim, [[1.6, 0.5]], walls=False)
    assert far[0] == pytest.approx(0.5)


def test_nobody_near_is_not_a_number():
    scene = lid_driven_cavity(dx=0.1)
    sim = planted(scene, np.ones_like(np.asarray(scene.x)))
    assert np.isnan(interpolate(sim, [[9.0, 9.0]])).all()
    with pytest.raises(ValueError, match="points: expected"):
        interpolate(sim, [1.0, 2.0])
