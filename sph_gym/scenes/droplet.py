"""A drop that surface tension pulls round: a square that comes to rest, an ellipse that rings."""

import math

import numpy as np
from numpy.typing import NDArray

from sph_gym.extras import needs_extra
from sph_gym.scenes.shared.free_bodies import conserved, momentum_measures, rings, semi_axes
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.checks import at_least_spacings, in_range, known, positive
from sph_gym.solver.geometry import lattice, snap
from sph_gym.solver.scene import Effects, Fluid, Scene
from sph_gym.solver.simulation import Simulation

SHAPES = ("square", "ellipse")
# Share of the radius, either way: enough to be seen between particles, and of first order.
AMPLITUDE = 0.1
# Share of the run after which a square is taken to be at rest.
SETTLED = 0.6

Array = NDArray[np.float64]


def droplet(
    dx: float = 0.025,
    side: float = 1.0,
    sigma: float = 1000.0,
    shape: str = "square",
    ohnesorge: float = 0.13,
) -> Scene:
    """A drop in empty space, of the area of a square of `side` [m], with R = side / sqrt(pi).

    sigma: surface tension [N/m], by default with a capillary time sqrt(rho R^3 / sigma) of about
    half a second; shape: "square", or "ellipse", whose axes differ by a fifth; ohnesorge: viscosity
    nu / sqrt(sigma R / rho), without which the layer in which the surface pulls doesn't calm down.
    """
    dx, sigma = positive("dx", dx), positive("sigma", sigma)
    side = snap(at_least_spacings("side", side, 8, dx), dx)
    h, radius, rho0 = 3.3 * dx, side / math.sqrt(math.pi), 1000.0
    nu = in_range("ohnesorge", ohnesorge, 0.0) * math.sqrt(sigma * radius / rho0)
    time = math.sqrt(rho0 * radius**3 / sigma)
    return Scene(
        "droplet",
        x=_filled(known("shape", shape, SHAPES), side, radius, dx),
        dx=dx,
        h=h,
        # what matters is the pull in a layer of the size of h: it compresses the fluid by 3 %;
        # under Wendland's kernel that layer heats up in long runs of fine drops, and boils
        fluid=Fluid(c0=11 * math.sqrt(sigma / (rho0 * h)), rho0=rho0, kernel="quintic_spline"),
        effects=Effects(surface_tension=sigma, laminar_viscosity=nu or None),
        duration=7 * time,
        frame=time / 20,
        integrator="kick_drift_kick",
    )


def _filled(shape: str, side: float, radius: float, dx: float) -> Array:
    if shape == "square":
        x = lattice(-side / 2, side / 2, -side / 2, side / 2, dx)
        return np.asarray(x - x.mean(axis=0))
    return rings(radius, dx) * (1 + AMPLITUDE, 1 / (1 + AMPLITUDE))


def radius_of(scene: Scene) -> float:
    """Return R [m] of the circle with the area of all particles."""
    return scene.dx * math.sqrt(len(np.asarray(scene.x)) / math.pi)


def jump(scene: Scene) -> float:
    """Return the pressure inside a round drop, sigma / R [Pa] (Young and Laplace)."""
    return float(scene.effects.surface_tension or 0.0) / radius_of(scene)


def frequency(scene: Scene) -> float:
    """Return the angular frequency [1/s] of an inviscid drop that swings between two ellipses.

    omega^2 = 6 sigma / (rho R^3). Source: Rayleigh 1879, n (n^2 - 1) for n = 2, in two dimensions.
    """
    return math.sqrt(6 * jump(scene) / (scene.fluid.rho0 * radius_of(scene) ** 2))


def is_square(scene: Scene) -> bool:
    """Return True if a scene begins with the square; an ellipse has different axes."""
    a, b = semi_axes(np.asarray(scene.x))
    return abs(a / b - 1) < AMPLITUDE / 2


def inner_pressure(sim: Simulation) -> float:
    """Return the mean p [Pa] within 0.8 R, well below the layer in which the surface pulls."""
    x = sim.x - sim.x.mean(axis=0)
    inside = np.hypot(*x.T) < 0.8 * radius_of(sim.scene)
    return float(sim.p[inside].mean()) if inside.any() else math.nan


def roughness(sim: Simulation) -> float:
    """Return the difference of the largest and the smallest radius in 24 directions, over R."""
    x = sim.x - sim.x.mean(axis=0)
    r, sector = np.hypot(*x.T), np.floor(np.arctan2(*x.T) / (math.pi / 12)) % 24
    edges = [float(r[sector == k].max(initial=0.0)) for k in np.unique(sector)]
    return (max(edges) - min(edges)) / radius_of(sim.scene)


def damped(times: Array, swing: Array, guess: float) -> tuple[float, float]:
    """Return frequency and decay rate [1/s] of the damped wave that fits best; guess: [1/s].

    Raises ImportError that names the extra if scipy is missing.
    """
    with needs_extra("studies"):
        from scipy.optimize import curve_fit

    def wave(t: Array, omega: float, decay: float, a: float, b: float, mean: float) -> Array:
        return mean + np.exp(-decay * t) * (a * np.cos(omega * t) + b * np.sin(omega * t))

    start, lowest = (guess, 0.15 * guess, swing[0], 0.0, 0.0), (0.0, 0.0, *[-np.inf] * 3)
    omega, decay, *_ = curve_fit(wave, times, swing, start, bounds=(lowest, np.inf))[0]
    return float(omega), float(decay)


def error(sim: Simulation) -> float:
    """Return the difference of the pressure inside and sigma / R [% of the latter]."""
    return 100 * abs(inner_pressure(sim) / jump(sim.scene) - 1)


def observe(sim: Simulation) -> dict[str, float]:
    """Return inner pressure [Pa], ln(a / b) of the semi-axes, roughness, and `conserved`."""
    a, b = semi_axes(sim.x)
    return {
        "pressure": inner_pressure(sim),
        "swing": math.log(a / b),
        "roughness": roughness(sim),
        **conserved(sim),
    }


def judge(run: Run) -> list[Measure]:
    """Judge a square by its pressure and shape at rest, an ellipse by its inviscid frequency.

    The bounds hold for forty particles along the square's side.
    """
    scene = run.sim.scene
    bound = 5.0 if radius_of(scene) / scene.dx > 22 else None
    momenta = momentum_measures(run, angular=False)
    if not is_square(scene):
        omega, decay = damped(run.times, run.series("swing"), frequency(scene))
        ratio = math.hypot(omega, decay) / frequency(scene)
        return [
            Measure("error of the frequency", 100 * abs(ratio - 1), "%", bound),
            Measure("decay", decay / frequency(scene), "of the frequency"),
            *momenta,
        ]
    late = run.times > SETTLED * run.times[-1]
    pressure, kinetic = run.series("pressure")[late], run.series("kinetic")
    off = 100 * abs(pressure.mean() / jump(scene) - 1)
    return [
        Measure("error of the pressure jump", off, "%", bound),
        Measure("its scatter in time", 100 * float(pressure.std()) / jump(scene), "%"),
        Measure("roughness", 100 * float(run.series("roughness")[late].mean()), "% of R"),
        Measure("kinetic energy at rest", float(kinetic[late].mean() / kinetic.max()), "of peak"),
        *momenta,
    ]


def chart(run: Run) -> Chart:
    """Draw the pressure inside a square, the axes of an ellipse, over time."""
    scene, times, swing = run.sim.scene, run.times, run.series("swing")
    if is_square(scene):
        simulated = Curve("simulated", times, run.series("pressure"))
        expected = Curve("sigma / R", times[[0, -1]], 2 * [jump(scene)], reference=True)
        return Chart("time [s]", "pressure inside [Pa]", [simulated, expected])
    _, decay = damped(times, swing, frequency(scene))
    omega = math.sqrt(max(frequency(scene) ** 2 - decay**2, 0.0))
    exact = swing[0] * np.exp(-decay * times) * np.cos(omega * times)
    simulated = Curve("simulated", times, swing)
    expected = Curve("Rayleigh, with this decay", times, exact, reference=True)
    return Chart("time [s]", "ln(a / b) of the semi-axes", [simulated, expected])


REFERENCE = Reference(
    source="Young and Laplace: the pressure jump; Rayleigh 1879: the frequency",
    unit="%",
    error=error,
    observe=observe,
    judge=judge,
    chart=chart,
    resolutions=tuple(
        {"shape": shape, "dx": dx} for shape in SHAPES for dx in (1 / 20, 1 / 40, 1 / 80)
    ),
    quick=2,
)

REFINEMENT = Refinement(
    "droplet", "side", (10, 14, 20, 28, 40), 20,
    "error of the pressure jump", "of sigma / R",
    "Not steadily: the layer in which the surface pulls is as thick as h and never quite at "
    "rest, so that the mean pressure keeps an error of chance. Nothing is recommended.",
    joined=3, erratic=True,
)  # fmt: skip
