"""How a surface tension is calibrated."""

import pytest

from sph_gym.solver.kernels import KERNELS
from sph_gym.solver.surface import RIGHT_SUPPORT, STIFFER, calibrated_stress
from tests import naive
from tests.cases import DX

pytestmark = pytest.mark.without_jit
kernels = pytest.mark.parametrize("name", KERNELS)
ratios = pytest.mark.parametrize("h_over_dx", [2.0, 2.6, 3.0, 3.5])


@kernels
@ratios
def test_the_stress_is_that_of_the_naive_sum(name, h_over_dx):
    h, volume = h_over_dx * DX, 1.01 * DX**2
    found = calibrated_stress(0.7, KERNELS[name](h), volume, DX)
    expected = naive.calibrated_surface(0.7, naive.KERNELS[name], h, DX, volume)
    assert found == pytest.approx(expected, rel=1e-10)


@kernels
@ratios
def test_a_slab_is_pulled_by_its_two_surfaces(name, h_over_dx):
    """The sum row by row is what particle forces transmit across a cut."""
    h, volume = h_over_dx * DX, 1.01 * DX**2
    stress = calibrated_stress(0.7, KERNELS[name](h), volume, DX)
    tension = naive.slab_tension(naive.KERNELS[name], h, DX, volume)
    measured = 1 - STIFFER * (h_over_dx - RIGHT_SUPPORT)
    assert stress * tension == pytest.approx(0.7 * measured, rel=0.02)


def test_the_stress_is_proportional_to_the_tension():
    h = 2.8 * DX
    one, two = (calibrated_stress(s, KERNELS["wendland_c2"](h), DX**2, DX) for s in (0.5, 1.0))
    assert two == pytest.approx(2 * one)
