import numpy as np
import pytest

from sph_gym import Fluid
from sph_gym.solver.equation_of_state import (
    Tait,
    Tait7,
    density_at,
    internal_energy,
    make_eos,
    pressure,
)

RHO0, B = 1000.0, 2e4
GAMMAS = [1.0, 1.4, 5.5, 7.0]
pytestmark = pytest.mark.without_jit
gammas = pytest.mark.parametrize("gamma", GAMMAS)


@gammas
def test_pressure_is_tait(gamma):
    eos = make_eos(B, RHO0, gamma, clamp=False)
    for q in (0.1, 0.5, 0.99, 1.0, 1.01, 1.5, 3.0):
        assert pressure(eos, q * RHO0) == pytest.approx(B * (q**gamma - 1), rel=1e-12, abs=1e-9)


@gammas
def test_clamp_cuts_tension_off_and_nothing_else(gamma):
    clamped, free = (make_eos(B, RHO0, gamma, clamp) for clamp in (True, False))
    for rho in (1.0, 500.0, 999.0):
        assert pressure(clamped, rho) == 0.0
        assert pressure(free, rho) < 0.0
    assert pressure(clamped, 1001.0) == pressure(free, 1001.0) > 0.0


@gammas
def test_sound_speed_is_the_slope_at_rest_density(gamma):
    fluid = Fluid(c0=12.0, gamma=gamma)
    eos = make_eos(fluid.stiffness(12.0), RHO0, gamma, clamp=False)
    slope = (pressure(eos, RHO0 + 1e-3) - pressure(eos, RHO0 - 1e-3)) / 2e-3
    assert slope == pytest.approx(12.0**2, rel=1e-6)
    assert fluid.sound_speed(fluid.stiffness(12.0)) == pytest.approx(12.0)


def test_exponent_one_is_the_linear_law():
    fluid = Fluid(c0=12.0, gamma=1.0)
    assert fluid.stiffness(12.0) == pytest.approx(RHO0 * 12.0**2)


def test_seven_has_its_own_polynomial():
    assert type(make_eos(B, RHO0, 7.0, True)) is Tait7
    assert type(make_eos(B, RHO0, 6.999, True)) is Tait


@pytest.mark.parametrize("deviation", [2.0**-13, -(2.0**-13), 2.0**-6, 0.5])
def test_pressure_keeps_its_digits_in_single_precision(deviation):
    rho0 = 1024.0  # so that rho / rho0 is exact
    eos = make_eos(B, rho0, 7.0, False, np.float32)
    p = pressure(eos, np.float32(rho0 * (1 + deviation)))
    assert type(p) is np.float32 or p == np.float32(p)
    assert p == pytest.approx(B * np.expm1(7 * np.log1p(deviation)), rel=2e-6)


@gammas
@pytest.mark.parametrize("clamp", [True, False])
@pytest.mark.parametrize("q", [0.6, 0.97, 1.03, 1.8])
def test_internal_energy_is_the_work_of_pressure(gamma, clamp, q):
    eos = make_eos(B, RHO0, gamma, clamp)
    rho, step = q * RHO0, 1e-2
    high, low = internal_energy(eos, rho + step), internal_energy(eos, rho - step)
    work = pressure(eos, rho) / rho**2
    assert (high - low) / (2 * step) == pytest.approx(work, rel=1e-6, abs=1e-12)
    assert internal_energy(eos, RHO0) == pytest.approx(0.0, abs=1e-12)


@gammas
@pytest.mark.parametrize("clamp", [True, False])
def test_density_at_a_pressure_is_the_inverse(gamma, clamp):
    eos = make_eos(B, RHO0, gamma, clamp)
    for q in (0.6, 0.97, 1.0, 1.03, 1.8):
        p = B * (q**gamma - 1)
        assert density_at(eos, p) == pytest.approx(q * RHO0, rel=1e-12)
        if q >= 1.0 or not clamp:
            assert pressure(eos, density_at(eos, p)) == pytest.approx(p, rel=1e-10, abs=1e-9 * B)


@gammas
@pytest.mark.parametrize("p", [-0.999 * B, -B, -5 * B, -1e9])
def test_no_pressure_makes_it_less_than_half_of_the_rest_density(gamma, p):
    eos = make_eos(B, RHO0, gamma, False)
    at_least = max(0.5, (1 - 0.999) ** (1 / gamma) if p > -B else 0.0)
    assert density_at(eos, p) == pytest.approx(at_least * RHO0)
