"""A square patch that begins in solid rotation and throws out arms: negative pressures inside."""

import math

import numpy as np

from sph_gym.scenes.shared.free_bodies import conserved, energy_measures, momentum_measures
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.checks import at_least_spacings, positive
from sph_gym.solver.geometry import lattice, snap
from sph_gym.solver.kernels import ALL_KERNELS, density_kernel, gradient
from sph_gym.solver.scene import Effects, Fluid, Scene
from sph_gym.solver.simulation import Simulation

# Tensile correction: with less of it, fluid under tension tears into threads.
EPSILON = 0.2
# Periods of the square's slowest sound wave over which the pressure is averaged.
WAVES = 3


def rotating_square(dx: float = 0.025, side: float = 1.0, omega: float = 1.0) -> Scene:
    """A patch of water in empty space with u = omega y, v = - omega x.

    side: [m], rounded to a multiple of dx; omega: [1/s]. Tension is physical here, so nothing is
    cut off, densities follow the continuity equation (a sum would take the surface for torn), a
    tensile correction keeps particles from pairing, and what sound it stirs up is damped.
    """
    dx, omega = positive("dx", dx), positive("omega", omega)
    side = snap(at_least_spacings("side", side, 4, dx), dx)
    x = lattice(-side / 2, side / 2, -side / 2, side / 2, dx)
    x -= x.mean(axis=0)
    return Scene(
        "rotating_square",
        x=x,
        v=omega * x[:, ::-1] * (1, -1),
        dx=dx,
        h=3.25 * dx,
        # the pressure rings about its mean at first: fast sound, so that the mean is early
        fluid=Fluid(c0=20 * omega * side, kernel="wendland_c2", clamp=False),
        effects=Effects(
            continuity=True,
            density_diffusion=0.1,
            tensile_correction=EPSILON,
            artificial_viscosity=0.01,
        ),
        duration=2 / omega,
        frame=0.01 / omega,
        integrator="kick_drift_kick",
    )


def start(scene: Scene) -> tuple[float, float]:
    """Return the side [m] and the angular velocity [1/s] at a scene's start."""
    x, v = np.asarray(scene.x), np.asarray(scene.v)
    omega = (v[:, 0] * x[:, 1]).sum() / (x[:, 1] ** 2).sum()
    return float(np.ptp(x[:, 0])) + scene.dx, float(omega)


def initial_pressure(x: float, y: float, side: float, omega: float, rho: float = 1000.0) -> float:
    """Return p [Pa] of the incompressible patch at the start, at x, y [m] from a corner.

    The solution of laplacian p = 2 rho omega^2 with p = 0 on all sides, as a double sine series.
    Source: Le Touze, Colagrossi, Colicchio, Greco 2013.
    """
    k = np.arange(1, 400, 2) * math.pi / side
    size = -32 / side**2 / np.outer(k, k) / np.add.outer(k**2, k**2)
    return float(rho * omega**2 * np.sin(k * x) @ size @ np.sin(k * y))


def central(scene: Scene) -> float:
    """Return that pressure [Pa] in the middle of a scene's patch."""
    side, omega = start(scene)
    return initial_pressure(side / 2, side / 2, side, omega, scene.fluid.rho0)


def central_pressure(sim: Simulation) -> float:
    """Return p [Pa] within two spacings of the middle, as the forces have it.

    The tensile correction takes away a share of every tension, which on the lattice is `relief`.
    """
    p = sim.p[np.hypot(*sim.x.T) < 2.1 * sim.scene.dx]
    if len(p) == 0:
        return math.nan
    mean = float(p.mean())
    return mean * (1 - relief(sim.scene)) if mean < 0 else mean


def relief(scene: Scene) -> float:
    """Return epsilon times the mean of (W(r) / W(dx))^4 on a lattice, weighted by r |grad W|."""
    kernel = ALL_KERNELS[scene.fluid.kernel](scene.h)
    reach = np.arange(-math.ceil(scene.h / scene.dx), math.ceil(scene.h / scene.dx) + 1)
    r = scene.dx * np.hypot(*np.meshgrid(reach, reach)).ravel()
    r = r[(r > 0) & (r < scene.h)]
    share = (density_kernel(kernel, r) / density_kernel(kernel, np.array([scene.dx]))) ** 4
    virial = np.array([one * one * gradient(kernel, one * one, one, 1 / one) for one in r])
    strength = scene.effects.tensile_correction or 0.0
    return strength * float((virial * share).sum() / virial.sum())


def error(sim: Simulation) -> float:
    """Return the kinetic energy that was lost [%]; an inviscid fluid loses none."""
    start_energy = 0.5 * sim.mass * float((np.asarray(sim.scene.v) ** 2).sum())
    return 100 * abs(1 - sim.diagnostics()["kinetic_energy"] / start_energy)


def observe(sim: Simulation) -> dict[str, float]:
    """Return the pressure in the middle [Pa], and `conserved`."""
    return {"pressure": central_pressure(sim), **conserved(sim)}


def early_pressure(run: Run) -> float:
    """Return the mean pressure in the middle [Pa] over the first waves, faded in and out."""
    side, _ = start(run.sim.scene)
    end = WAVES * math.sqrt(2) * side / run.sim.scene.fluid.c0
    early = run.times <= end
    weight = np.sin(math.pi * run.times[early] / end) ** 2
    return float((weight * run.series("pressure")[early]).sum() / weight.sum())


def judge(run: Run) -> list[Measure]:
    """Judge the energy lost, the first pressures against the series, and the conservation."""
    pressure = 100 * abs(early_pressure(run) / central(run.sim.scene) - 1)
    return [
        *energy_measures(run),
        Measure("first pressure in the middle", pressure, "% of the series", 2.0),
        *momentum_measures(run),
    ]


def chart(run: Run) -> Chart:
    """Draw the pressure in the middle over time."""
    simulated = Curve("simulated", run.times, run.series("pressure"))
    exact = Curve("series, at the start", run.times[:1], [central(run.sim.scene)], reference=True)
    return Chart("time [s]", "pressure in the middle [Pa]", [simulated, exact])


SOURCE = "Le Touze et al. 2013: conserved energy and momentum, series of the first pressure"
RESOLUTIONS = ({"dx": 1 / 20}, {"dx": 1 / 40}, {"dx": 1 / 80})
REFERENCE = Reference(SOURCE, "%", error, observe, judge, chart, RESOLUTIONS)

REFINEMENT = Refinement(
    "rotating_square", "side", (14, 20, 28, 40), 28,
    "change of kinetic energy", "of the energy",
    "About first order: what the tensile correction and the artificial viscosity take, at "
    "corners that become ever thinner.",
    order=0.72, joined=10, single="side and omega only change the units",
)  # fmt: skip
