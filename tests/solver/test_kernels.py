import numpy as np
import pytest
from scipy.integrate import quad

from sph_gym import Fluid, Scene, Simulation, lattice
from sph_gym.solver.kernels import (
    KERNELS,
    calibrated_mass,
    density_kernel,
    gradient,
    viscosity,
    weight,
)
from tests import naive
from tests.cases import DX, assert_close

H = 0.7
kernels = pytest.mark.parametrize("kernel", [make(H) for make in KERNELS.values()], ids=KERNELS)
pytestmark = pytest.mark.without_jit


def in_space(function, power):
    """Integral over the plane of function(r) r^power."""
    return quad(lambda r: 2 * np.pi * r ** (1 + power) * function(r), 0, H, epsabs=1e-13)[0]


@kernels
def test_density_kernel_is_normalised(kernel):
    assert in_space(lambda r: kernel.weight_scale * weight(kernel, r * r, r), 0) == pytest.approx(1)


@kernels
def test_gradient_differentiates_a_linear_field(kernel):
    def minus_slope_over_r(r):
        return kernel.gradient_scale * gradient(kernel, r * r, r, 1 / r)

    # the integral of -x dW/dx, where half of r^2 is x^2
    assert in_space(minus_slope_over_r, 2) / 2 == pytest.approx(1)


@kernels
def test_laplacian_of_a_parabola_is_two(kernel):
    def laplacian_weight(r):
        return kernel.viscosity_scale * viscosity(kernel, r * r, r)

    # f = x^2, and half of r^2 is x^2
    assert in_space(laplacian_weight, 2) / 2 == pytest.approx(2)


def test_wendland_gradient_is_the_derivative_of_its_density_kernel():
    kernel = KERNELS["wendland_c2"](H)
    r, step = np.linspace(0.01, 0.99, 50) * H, 1e-6
    slope = (density_kernel(kernel, r + step) - density_kernel(kernel, r - step)) / (2 * step)
    assert_close(-kernel.gradient_scale * gradient(kernel, r * r, r, 1 / r) * r, slope, 1e-8)


@pytest.mark.parametrize("name", KERNELS)
def test_shapes_times_scales_are_the_textbook_kernels(name):
    kernel, textbook = KERNELS[name](H), naive.KERNELS[name]
    r = np.linspace(0.001, 0.999, 50) * H
    density, slope = (
        density_kernel(kernel, r),
        kernel.gradient_scale * gradient(kernel, r * r, r, 1 / r),
    )
    assert_close(density, textbook.density(r, H), 1e-13)
    assert_close(-slope * r, textbook.slope(r, H), 1e-13)
    laplacian = kernel.viscosity_scale * viscosity(kernel, r * r, r)
    assert_close(laplacian, textbook.laplacian(r, H), 1e-13)


@kernels
def test_density_kernel_ends_at_the_support_radius(kernel):
    assert density_kernel(kernel, np.array([H, 1.5 * H, 1e6])).tolist() == [0, 0, 0]
    assert density_kernel(kernel, np.array([0.0, 0.999 * H])).min() > 0


@pytest.mark.parametrize("make", KERNELS.values(), ids=KERNELS)
def test_shapes_have_the_precision_asked_for_and_scales_are_double(make):
    numbers = make(H, np.float32)._asdict()
    scales = {type(numbers.pop(f"{name}_scale")) for name in ("weight", "gradient", "viscosity")}
    assert scales == {float}
    assert {type(number) for number in numbers.values()} == {np.float32}


@pytest.mark.parametrize(("h_over_dx", "total"), [(2, 1.015), (2.4, 0.995), (2.8, 1), (3, 1.002)])
def test_uncalibrated_lattice_sums_of_poly6(h_over_dx, total):
    mass = calibrated_mass(KERNELS["mueller"](h_over_dx * DX), 1000.0, DX)
    assert 1000.0 * DX**2 / mass == pytest.approx(total, abs=1e-3)


@pytest.mark.parametrize("h_over_dx", [1.0, 2.0, 2.6, 3.0, 4.0])
@pytest.mark.parametrize("name", KERNELS)
def test_calibrated_mass_gives_the_rest_density_on_the_lattice(name, h_over_dx):
    n = 11
    scene = Scene(
        "lattice",
        x=lattice(0.0, n * DX, 0.0, n * DX, DX),
        dx=DX,
        h=h_over_dx * DX,
        fluid=Fluid(c0=1.0, rho0=1300.0, kernel=name),
    )
    sim = Simulation(scene)
    assert sim.rho[n * n // 2] == pytest.approx(1300.0, rel=1e-13)
    kernel = naive.KERNELS[name]
    assert sim.mass == pytest.approx(naive.calibrated_mass(kernel, scene.h, DX, 1300.0), rel=1e-13)
