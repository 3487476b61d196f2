import numba
import numpy as np
import pytest
from scipy.integrate import quad

from sph_gym import Fluid, Scene, Simulation, lattice
from sph_gym.solver.jit import jit
from sph_gym.solver.kernels import (
    ALL_KERNELS,
    KERNELS,
    MATCHED,
    WRONG_KERNELS,
    calibrated_mass,
    density_kernel,
    friction,
    friction_scale,
    gradient,
    surface_densities,
    viscous_share,
    weight,
)
from sph_gym.solver.lanes import load, store, width
from tests import naive
from tests.cases import DX, assert_close

H = 0.7
# sixths of the support radius have every knot of the splines among them
KNOTS = [H / 3, H / 2, 2 * H / 3]
# what forces.py adds to r^2
COINCIDENT = 1e-30
kernels = pytest.mark.parametrize("kernel", [make(H) for make in KERNELS.values()], ids=KERNELS)
pytestmark = pytest.mark.without_jit


def slope(kernel, r):
    """dW/dr as the forces have it [1/m^3], for any distances [m]."""
    shapes = [-gradient(kernel, one * one, one, 1 / one) * one for one in np.ravel(r)]
    return kernel.gradient_scale * np.reshape(shapes, np.shape(r))


def in_space(function, power):
    """Integral over the plane of function(r) r^power."""

    def on_a_ring(r):
        return 2 * np.pi * r ** (1 + power) * float(function(r))

    return quad(on_a_ring, 0, H, epsabs=1e-13, points=KNOTS)[0]


def moments(kernel):
    """Normalisation and slope of a linear field: 1 and 1 if right."""
    # half of r^2 is x^2: the integral of -x dW/dx
    return (
        in_space(lambda r: density_kernel(kernel, r), 0),
        in_space(lambda r: -slope(kernel, r), 1) / 2,
    )


# --- Moments --------------------------------------------------------------------------------


@kernels
def test_density_kernel_is_normalised(kernel):
    assert moments(kernel)[0] == pytest.approx(1)


@kernels
def test_gradient_differentiates_a_linear_field(kernel):
    assert moments(kernel)[1] == pytest.approx(1)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("wrong_3d_constants", (315 / 256 / H, 3 / 2 / H)),
        ("wrong_spiky_gradient", (1, 1 / 3)),
        # which is why it isn't found this way
        ("wrong_poly6_gradient", (1, 1)),
    ],
)
def test_how_wrong_the_wrong_kernels_are(name, expected):
    assert moments(WRONG_KERNELS[name](H)) == pytest.approx(expected)


@pytest.mark.parametrize("name", ALL_KERNELS)
def test_second_moment_of_the_density_kernel(name):
    kernel, textbook = ALL_KERNELS[name](H), naive.KERNELS[name]
    moment = in_space(lambda r: density_kernel(kernel, r), 2)
    assert moment == pytest.approx(in_space(lambda r: textbook.density(r, H), 2))
    if name in KERNELS:
        # the mean of r^2 under a kernel that is positive and normalised
        assert 0 < moment < H**2


def test_poly6_pushes_least_where_particles_touch():
    right, wrong = KERNELS["mueller"](H), WRONG_KERNELS["wrong_poly6_gradient"](H)
    r = np.array([1e-6, 0.01, 0.1, 0.2, 0.3, 0.4]) * H
    assert (np.diff(slope(right, r)) > 0).all()
    assert (np.diff(slope(wrong, r)) < 0).all()
    assert slope(wrong, r[:1]) / slope(right, r[:1]) == pytest.approx(0, abs=1e-5)


def test_with_a_calibrated_mass_3d_constants_are_wrong_by_their_ratio():
    right, wrong = KERNELS["mueller"](H), WRONG_KERNELS["wrong_3d_constants"](H)
    mass = calibrated_mass(wrong, 1000.0, H / 3) / calibrated_mass(right, 1000.0, H / 3)
    assert mass == pytest.approx(256 / 315 * H)
    assert mass * wrong.gradient_scale / right.gradient_scale == pytest.approx(128 / 105)


# --- Shapes ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ALL_KERNELS)
def test_gradient_is_the_derivative_of_the_density_kernel_of_matched_kernels(name):
    kernel = ALL_KERNELS[name](H)
    r, step = np.linspace(0.01, 0.99, 50) * H, 1e-6
    derivative = (density_kernel(kernel, r + step) - density_kernel(kernel, r - step)) / (2 * step)
    error = np.abs(slope(kernel, r) - derivative).max() / np.abs(derivative).max()
    if name in MATCHED:
        assert error < 1e-8
    else:
        assert error > 0.3


def test_names_are_in_their_places():
    assert not KERNELS.keys() & WRONG_KERNELS.keys()
    assert ALL_KERNELS.keys() == KERNELS.keys() | WRONG_KERNELS.keys() == naive.KERNELS.keys()
    assert ALL_KERNELS.keys() > MATCHED


@pytest.mark.parametrize("name", ALL_KERNELS)
def test_shapes_times_scales_are_the_textbook_kernels(name):
    kernel, textbook = ALL_KERNELS[name](H), naive.KERNELS[name]
    r = np.linspace(0.001, 0.999, 50) * H
    assert_close(density_kernel(kernel, r), textbook.density(r, H), 1e-13)
    assert_close(slope(kernel, r), textbook.slope(r, H), 1e-13)


@pytest.mark.parametrize("name", ["cubic_spline", "quintic_spline"])
@pytest.mark.parametrize("knot", KNOTS)
@pytest.mark.parametrize("function", [density_kernel, slope])
def test_shapes_of_splines_have_no_jump_and_no_corner_at_their_knots(name, knot, function):
    kernel, step = KERNELS[name](H), 1e-5 * H
    values = function(kernel, np.array([-2, -1, 0, 1, 2]) * step + knot)
    size = np.abs(function(kernel, np.array([0.1 * H]))).max()
    assert np.ptp(values) < 1e-3 * size
    assert np.abs(np.diff(values, 2)).max() < 1e-8 * size


@pytest.mark.parametrize("name", ALL_KERNELS)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_coincident_particles_have_finite_shapes(name, dtype):
    kernel, textbook = ALL_KERNELS[name](DX, dtype), naive.KERNELS[name]
    r2 = dtype(COINCIDENT)
    r = np.sqrt(r2)
    found = float(weight(kernel, r2, r)) * kernel.weight_scale
    assert found == pytest.approx(float(textbook.density(0.0, DX)), rel=1e-6)
    assert np.isfinite(gradient(kernel, r2, r, 1 / r))


@pytest.mark.parametrize("name", ["wendland_c2", "cubic_spline", "quintic_spline"])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_close_particles_are_pushed_apart_without_noise(name, dtype):
    kernel = KERNELS[name](DX, dtype)
    near = 1e-7 * DX
    limit = -naive.KERNELS[name].slope(near, DX) / near
    for r in (DX * 10.0 ** np.arange(-12, -6)).astype(dtype):
        shape = gradient(kernel, r * r, r, 1 / r)
        assert kernel.gradient_scale * float(shape) == pytest.approx(limit, rel=1e-5)


@pytest.mark.parametrize("name", ALL_KERNELS)
def test_density_kernel_ends_at_the_support_radius(name):
    kernel = ALL_KERNELS[name](H)
    assert density_kernel(kernel, np.array([H, 1.5 * H, 1e6])).tolist() == [0, 0, 0]
    assert density_kernel(kernel, np.array([0.0, 0.999 * H])).min() > 0


def test_density_kernel_takes_arrays_of_any_shape():
    kernel = KERNELS["cubic_spline"](H)
    r = np.array([[0.0, 0.3, 0.6], [0.69, 0.7, np.inf]])
    values = density_kernel(kernel, r)
    assert values.shape == r.shape
    assert values.ravel().tolist() == [float(density_kernel(kernel, one)) for one in r.ravel()]
    assert density_kernel(kernel, np.array([])).shape == (0,)


@pytest.mark.parametrize("make", ALL_KERNELS.values(), ids=ALL_KERNELS)
def test_shapes_have_the_precision_asked_for_and_scales_are_double(make):
    kernel = make(H, np.float32)
    numbers = kernel._asdict()
    scales = {type(numbers.pop(f"{name}_scale")) for name in ("weight", "gradient")}
    assert scales == {float}
    assert {type(number) for number in numbers.values()} == {np.float32}
    r = np.float32(0.3)
    shapes = weight(kernel, r * r, r), gradient(kernel, r * r, r, 1 / r), friction(kernel.h, r)
    assert {type(shape) for shape in shapes} == {np.float32}


# --- Compiled -------------------------------------------------------------------------------


@jit
def in_lanes(pair, spiky, cubic, quintic, r2, r, inv_r, out):
    w = width(r)
    for i in range(0, r.size, w):
        s, d, inv = load(r2, i), load(r, i), load(inv_r, i)
        store(out, i, gradient(pair, s, d, inv), w)
        store(out, r.size + i, weight(spiky, s, d), w)
        store(out, 2 * r.size + i, weight(cubic, s, d), w)
        store(out, 3 * r.size + i, gradient(cubic, s, d, inv), w)
        store(out, 4 * r.size + i, weight(quintic, s, d), w)
        store(out, 5 * r.size + i, gradient(quintic, s, d, inv), w)
        store(out, 6 * r.size + i, friction(quintic.h, d), w)


@jit
def in_numbers(pair, spiky, cubic, quintic, r2, r, inv_r):
    return (
        gradient(pair, r2, r, inv_r),
        weight(spiky, r2, r),
        weight(cubic, r2, r),
        gradient(cubic, r2, r, inv_r),
        weight(quintic, r2, r),
        gradient(quintic, r2, r, inv_r),
        friction(quintic.h, r),
    )


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_compiled_shapes_are_those_of_plain_numbers(dtype):
    names = ("wrong_poly6_gradient", "spiky", "cubic_spline", "quintic_spline")
    chosen = [ALL_KERNELS[name](H, dtype) for name in names]
    r = np.append(np.sqrt(COINCIDENT), np.linspace(1e-3, 0.999, 63) * H).astype(dtype)
    out = np.zeros((7, r.size), dtype)
    in_lanes(*chosen, r * r, r, 1 / r, out.reshape(-1))
    plain = getattr(in_numbers, "py_func", in_numbers)
    expected = np.array([plain(*chosen, one * one, one, 1 / one) for one in r], dtype)
    for row, values in zip(out, expected.T, strict=True):
        assert_close(row, values, 20 * np.finfo(dtype).eps)


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")
def test_no_literal_widens_single_precision():
    names = ("wrong_poly6_gradient", "spiky", "cubic_spline", "quintic_spline")
    one = np.float32(0.25)
    in_numbers(*(ALL_KERNELS[name](H, np.float32) for name in names), one, one, one)
    kinds = [signature.return_type for signature in in_numbers.nopython_signatures]
    assert kinds == [numba.types.UniTuple(numba.float32, 7)]


# --- Lattices -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "h_over_dx", "total", "tolerance"),
    [
        ("mueller", 2.0, 1.015, 1e-3),
        ("mueller", 2.4, 0.995, 1e-3),
        ("mueller", 2.8, 1.0, 1e-3),
        ("mueller", 3.0, 1.002, 1e-3),
        ("wendland_c2", 2.0, 1.04, 5e-3),
        ("wendland_c2", 4.0, 1.0, 2e-3),
        ("spiky", 2.0, 1.27, 5e-3),
        ("spiky", 4.0, 1.03, 5e-3),
        ("cubic_spline", 2.0, 1.0, 4e-3),
        ("cubic_spline", 3.0, 1.0, 4e-3),
        ("quintic_spline", 2.0, 1.025, 1e-3),
        ("quintic_spline", 3.0, 1.0, 2e-4),
    ],
)
def test_uncalibrated_lattice_sums(name, h_over_dx, total, tolerance):
    mass = calibrated_mass(KERNELS[name](h_over_dx * DX), 1000.0, DX)
    assert 1000.0 * DX**2 / mass == pytest.approx(total, abs=tolerance)


@pytest.mark.parametrize("h_over_dx", [1.0, 2.0, 2.6, 3.0, 4.0])
@pytest.mark.parametrize("name", ALL_KERNELS)
def test_calibrated_mass_is_that_of_the_textbook_kernels(name, h_over_dx):
    h, textbook = h_over_dx * DX, naive.KERNELS[name]
    mass = calibrated_mass(ALL_KERNELS[name](h), 1300.0, DX)
    assert mass == pytest.approx(naive.calibrated_mass(textbook, h, DX, 1300.0), rel=1e-13)


@pytest.mark.parametrize("h_over_dx", [1.0, 2.0, 2.6, 3.0, 4.0])
# what the other tests have compiled anyway
@pytest.mark.parametrize("name", ["mueller", "wendland_c2"])
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


# --- Friction -------------------------------------------------------------------------------

RATIOS = [2.0, 2.2, 2.5, 2.6, 2.8, 3.0, 3.3, 3.5, 3.7, 4.0]


@pytest.mark.parametrize("ratio", [1.0, 1.2, *RATIOS])
def test_friction_is_that_of_the_textbook(ratio):
    r = np.linspace(0.0, 1.5, 50) * H
    assert_close(friction(H, r), naive.friction(r, H), 1e-13)
    expected = naive.friction_scale(H, H / ratio)
    assert friction_scale(H, H / ratio) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("ratio", RATIOS)
def test_rows_that_slide_past_each_other_are_as_viscous_as_the_lattice(ratio):
    x, y = np.meshgrid(np.linspace(-5.0, 5.0, 401), np.arange(-5.0, 6.0))
    moment = (friction_scale(ratio, 1.0) * friction(ratio, np.hypot(x, y)) * y**2).sum() / 40
    assert moment == pytest.approx(2, rel=0.01 if ratio < 2.5 else 0.0025)


def fastest_decay(ratio):
    """Return the fastest decay [1/s] on the square lattice, for nu = 1, h = ratio and dx = 1."""
    place = np.arange(-4, 5)
    w = friction_scale(ratio, 1.0) * friction(ratio, np.hypot(*np.meshgrid(place, place)))
    waves = np.cos(np.outer(np.linspace(0, np.pi, 41), place))
    # w is even, so that the sines cancel
    return (w.sum() - (waves @ w @ waves.T)).max()


@pytest.mark.parametrize("ratio", RATIOS)
def test_the_viscous_step_is_stable_and_not_much_shorter_than_it_must_be(ratio):
    share = viscous_share(ratio, 1.0) * ratio**2 * fastest_decay(ratio)
    assert 0.5 * 2 < share < 0.95 * 2


def test_the_viscous_step_of_a_wide_support_is_that_of_a_continuum():
    # the weight 280 / (pi h^7) (h - r)^3 has the integral 28 / h^2
    assert viscous_share(40.0, 1.0) == pytest.approx(2 * (5 / 6) / 28, rel=1e-3)


# --- Free surfaces --------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [1.0, 2.0, 2.6, 4.0])
@pytest.mark.parametrize("name", KERNELS)
def test_densities_below_a_free_surface(name, ratio):
    kernel = KERNELS[name](ratio * DX)
    mass = calibrated_mass(kernel, 1000.0, DX)
    first, second = surface_densities(kernel, mass, DX, weight)
    x = lattice(-5 * DX, 5 * DX, -5 * DX, 0.0, DX)
    for found, depth in ((first, 0.5), (second, 1.5)):
        r = np.hypot(x[:, 0] - 0.5 * DX, x[:, 1] + depth * DX)
        assert found == pytest.approx(mass * density_kernel(kernel, r).sum(), rel=1e-12)
