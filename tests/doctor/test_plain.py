"""The article's solver in plain numpy: does it do what it says?"""

import numpy as np
import pytest

from sph_gym.doctor.case import DX, RHO0, case, cloud, interior, lattice
from sph_gym.doctor.plain import make

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("shift", [0.0, -3.3, 1e3])
def test_neighbors_are_those_of_all_pairs(shift):
    one = case(cloud(RNG, 9, 9, DX, 0.3) + shift)
    solver = make(one)
    distance = np.linalg.norm(one.x[:, None] - one.x[None], axis=2)
    for i in range(one.n):
        expected = np.flatnonzero((distance[i] < one.h) & (np.arange(one.n) != i))
        assert sorted(solver.neighbors(i)) == expected.tolist()


def test_a_lattice_has_the_density_of_rest_inside():
    one = case(lattice(12, 12))
    solver = make(one)
    inside = interior(one.x, one.h)
    np.testing.assert_allclose(solver.rho[inside], RHO0, rtol=1e-12)
    assert solver.p[inside].max() < 1e-6
    assert np.abs(solver.a[inside]).max() < 1e-6


def test_alone_it_falls_and_has_a_density():
    solver = make(case([[0.0, 0.0]], [[1.0, 2.0]], gravity=(0.0, -10.0)))
    for _ in range(100):
        solver.step(1e-3)
    assert solver.rho[0] > 0
    np.testing.assert_allclose(solver.v, [[1.0, 1.0]])
    np.testing.assert_allclose(solver.x, [[0.1, 0.15 - 1e-3 / 2 * 1.0]], atol=1e-9)


def test_momentum_stays_and_two_part():
    one = case(cloud(RNG, 7, 7, 0.9 * DX, 0.2), viscosity=0.01, xsph=0.3)
    solver = make(one)
    for _ in range(50):
        solver.step(one.dt)
    speed = np.linalg.norm(solver.v, axis=1)
    assert np.abs(solver.v.mean(axis=0)).max() < 1e-12 * speed.max()
    pair = make(case([[0.0, 0.0], [0.5 * DX, 0.0]], h=DX))
    assert pair.a[0, 0] < 0 < pair.a[1, 0]


def test_coincident_particles_stay_finite():
    solver = make(case([[0.0, 0.0], [0.0, 0.0], [0.5 * DX, 0.0]], h=DX))
    for _ in range(10):
        solver.step(1e-5)
    assert np.isfinite(solver.x).all()


def test_a_shear_wave_decays_by_its_viscosity():
    nu, k = 0.02, 2 * np.pi / (16 * DX)
    x = lattice(24, 16)
    one = case(x, np.stack([np.sin(k * x[:, 1]), 0 * x[:, 0]], axis=1), viscosity=nu)
    inside = interior(x, one.h)
    along = make(one).a[inside, 0]
    wave = np.sin(k * x[inside, 1])
    assert -(along @ wave) / (wave @ wave) / k**2 == pytest.approx(nu, rel=0.1)


def test_walls_hold_and_xsph_moves_without_a_kick():
    one = case(lattice(6, 6), (3.0, -2.0), box=(-4 * DX, 4 * DX, -4 * DX, 4 * DX))
    solver = make(one)
    for _ in range(200):
        solver.step(one.dt)
        assert np.abs(solver.x).max() <= 4 * DX
    x, v = lattice(5, 5, 1.3 * DX), RNG.normal(size=(25, 2))
    plain, smoothed = make(case(x, v)), make(case(x, v, xsph=0.5))
    plain.step(1e-5), smoothed.step(1e-5)
    np.testing.assert_array_equal(plain.v, smoothed.v)
    assert np.abs(plain.x - smoothed.x).max() > 1e-7
