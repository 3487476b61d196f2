"""Surface tension from its definition: what it costs to cut a lattice in two."""

import numpy as np
import pytest

from sph_gym import Effects, Fluid, Scene, Simulation, disc, lattice
from sph_gym.solver.cohesion import calibrated_cohesion
from tests import naive
from tests.cases import C0, DX, assert_close, fluid, uncompiled

widths = pytest.mark.parametrize("h_over_dx", [1.3, 2.0, 2.6, 3.0, 3.5])
pytestmark = pytest.mark.without_jit


@widths
def test_calibration_is_that_of_direct_sums(h_over_dx):
    found = calibrated_cohesion(0.7, h_over_dx * DX, DX)
    assert found == pytest.approx(naive.calibrated_cohesion(0.7, h_over_dx * DX, DX), rel=1e-10)


@widths
def test_a_lattice_at_rest_has_no_pressure_of_its_own(h_over_dx):
    s, zero = calibrated_cohesion(0.7, h_over_dx * DX, DX)
    n = int(h_over_dx) + 1
    x = lattice(0, (2 * n + 1) * DX, 0, (2 * n + 1) * DX, DX)
    offset = x - x[len(x) // 2]
    r = np.hypot(*offset.T)
    near = r > 0
    force = (
        s
        * naive.cohesion_force(r / (h_over_dx * DX), zero)[near, None]
        * (offset[near] / r[near, None])
    )
    # the virial tensor: a pressure in either direction and no shear
    virial = force.T @ offset[near]
    assert_close(virial, np.zeros((2, 2)), 1e-12, at_least=s * DX)


@widths
def test_strength_and_tension_are_proportional(h_over_dx):
    h = h_over_dx * DX
    (s, zero), (double, same) = (calibrated_cohesion(sigma, h, DX) for sigma in (0.7, 1.4))
    assert s > 0.0
    assert double == pytest.approx(2 * s)
    assert same == zero
    assert 1 / h_over_dx <= zero < 1.0


def pulls(x, sigma):
    """Accelerations of particles at rest with a surface tension, less those without it."""
    water = Fluid(c0=C0, kernel="wendland_c2", clamp=False)

    def acceleration(effects):
        scene = Scene("drop", x=x, dx=DX, h=2.6 * DX, fluid=water, effects=effects)
        return fluid(Simulation(scene, neighbors="brute"), "a")

    return acceleration(Effects(surface_tension=sigma)) - acceleration(Effects())


@uncompiled
def test_two_particles_attract_each_other_from_a_distance_and_repel_nearby():
    _, zero = calibrated_cohesion(0.5, 2.6 * DX, DX)
    for q, direction in ((0.9 * zero, 1.0), (1.1 * zero, -1.0), (0.999, -1.0), (1.001, 0.0)):
        pull = pulls([(0.0, 0.0), (q * 2.6 * DX, 0.0)], 0.5)
        assert np.sign(pull[1, 0]) == direction
        assert_close(pull[0], -pull[1], 1e-12, at_least=1e-9)


@uncompiled
def test_a_drop_neither_moves_nor_spins_by_its_own_tension():
    x = disc(0, 0, 3 * DX, DX) + np.random.default_rng(0).normal(0.0, 0.2 * DX, (32, 2))
    pull = pulls(x, 0.5)
    assert np.abs(pull).max() > 1.0
    assert_close(pull.sum(axis=0), np.zeros(2), 1e-11, at_least=np.abs(pull).sum())
    torque = x[:, 0] * pull[:, 1] - x[:, 1] * pull[:, 0]
    assert abs(torque.sum()) <= 1e-11 * np.abs(torque).sum()
