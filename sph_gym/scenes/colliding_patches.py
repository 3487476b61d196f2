"""Two equal patches of water hit each other head on: the kinetic energy that an impact costs."""

import math

import numpy as np

from sph_gym.scenes.shared.free_bodies import conserved, energy_measures, momentum_measures
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.checks import at_least_spacings, in_range, positive
from sph_gym.solver.geometry import lattice, snap
from sph_gym.solver.scene import Effects, Fluid, Scene
from sph_gym.solver.simulation import Simulation


def colliding_patches(
    dx: float = 0.025,
    length: float = 1.0,
    height: float = 1.0,
    speed: float = 1.0,
    gap: float = 0.0,
) -> Scene:
    """Two patches in empty space that move towards each other along x, `speed` [m/s] each.

    length, height: of either [m], rounded to multiples of dx; gap: between them at the start [m].
    What the impact costs goes into sound. Its tension is physical, so nothing is cut off; the
    diffusion of density damps it, and nothing else rubs.
    """
    dx, speed = positive("dx", dx), positive("speed", speed)
    length = snap(at_least_spacings("length", length, 3, dx), dx)
    height = snap(at_least_spacings("height", height, 3, dx), dx)
    gap = in_range("gap", gap, 0.0)
    right = lattice(gap / 2, gap / 2 + length, -height / 2, height / 2, dx)
    towards = np.zeros_like(right)
    towards[:, 0] = -speed
    time = length / speed
    return Scene(
        "colliding_patches",
        x=np.concatenate([right, right * (-1, 1)]),
        v=np.concatenate([towards, -towards]),
        dx=dx,
        h=3.25 * dx,
        # Mach 0.02: what an impact does in an incompressible fluid it does here in a moment
        fluid=Fluid(c0=50 * speed, kernel="wendland_c2", clamp=False),
        effects=Effects(continuity=True, density_diffusion=0.1, tensile_correction=0.1),
        duration=time + gap / (2 * speed),
        frame=time / 100,
        integrator="kick_drift_kick",
    )


def start(scene: Scene) -> tuple[float, float]:
    """Return length and height [m] of either patch."""
    x = np.asarray(scene.x)
    right = x[: len(x) // 2]
    length, height = np.ptp(right, axis=0) + scene.dx
    return float(length), float(height)


def impact_loss(length: float, height: float) -> float:
    """Return the share of the kinetic energy that an impact of incompressible patches costs.

    The impulse P of the pressure makes the velocity divergence-free at one blow: laplacian P = 0,
    P = 0 on the free sides, dP/dx = - rho u where they meet. As a sine series along that line,
    of half the momentum times u, it is 8 H / (pi^3 n^3 L) tanh(n pi L / H), summed over odd n.
    Source: Lagrange's impulsive pressure; for patches: Marrone, Colagrossi, Di Mascio, Le Touze
    2015.
    """
    n = np.arange(1, 2001, 2) * math.pi
    return float((8 * height / length * np.tanh(n * length / height) / n**3).sum())


def energy_lost(sim: Simulation) -> float:
    """Return the share of the kinetic energy that is lost."""
    began = 0.5 * sim.mass * float((np.asarray(sim.scene.v) ** 2).sum())
    return 1 - sim.diagnostics()["kinetic_energy"] / began


def asymmetry(sim: Simulation) -> float:
    """Return the mean distance [dx] between a particle and the mirror image of its twin."""
    right, left = np.split(sim.x, 2)
    return float(np.hypot(*(right * (-1, 1) - left).T).mean()) / sim.scene.dx


def error(sim: Simulation) -> float:
    """Return the energy lost minus that lost by incompressible patches [% of the energy]."""
    return 100 * abs(energy_lost(sim) - impact_loss(*start(sim.scene)))


def observe(sim: Simulation) -> dict[str, float]:
    """Return the share of the kinetic energy lost, the asymmetry, and `conserved`."""
    return {"lost": energy_lost(sim), "asymmetry": asymmetry(sim), **conserved(sim)}


def judge(run: Run) -> list[Measure]:
    """Judge energy, symmetry and momentum; the bound holds for forty particles along a patch."""
    _, height = start(run.sim.scene)
    fine = height / run.sim.scene.dx > 39.5
    bound = 5.0 if fine else None
    return [
        Measure("energy lost, against the impact", error(run.sim), "% of the energy", bound),
        *energy_measures(run),
        Measure("asymmetry", float(run.series("asymmetry").max()), "dx"),
        *momentum_measures(run),
    ]


def chart(run: Run) -> Chart:
    """Draw the kinetic energy over time."""
    left = 1 - impact_loss(*start(run.sim.scene))
    simulated = Curve("simulated", run.times, 1 - run.series("lost"))
    exact = Curve("incompressible", run.times[[0, -1]], [left, left], reference=True)
    return Chart("time [s]", "kinetic energy / that before the impact", [simulated, exact])


SOURCE = "Marrone et al. 2015: the loss by the impact of incompressible patches, as a series"
RESOLUTIONS = ({"dx": 1 / 20}, {"dx": 1 / 40}, {"dx": 1 / 80})
REFERENCE = Reference(SOURCE, "% of the energy", error, observe, judge, chart, RESOLUTIONS, quick=2)

REFINEMENT = Refinement(
    "colliding_patches", "height", (10, 14, 20, 28, 40), 20,
    "energy lost, against the impact", "of the energy",
    "About first order: the impact sends its energy into sound of the wavelength of h.",
    order=0.7, others=({"height": 0.8}, {"length": 0.6}), joined=5,
)  # fmt: skip
