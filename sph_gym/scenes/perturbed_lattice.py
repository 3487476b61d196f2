"""A periodic lattice with a little noise: what a scheme without any dissipation conserves."""

import numpy as np

from sph_gym.scenes.shared.free_bodies import conserved
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.solver.checks import at_least_spacings, in_range, known, positive, whole
from sph_gym.solver.geometry import lattice, snap
from sph_gym.solver.kernels import KERNELS, MATCHED
from sph_gym.solver.scene import Effects, Fluid, Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls


def perturbed_lattice(
    dx: float = 0.025,
    side: float = 1.0,
    noise: float = 1e-3,
    kernel: str = "wendland_c2",
    c0: float = 10.0,
    seed: int = 0,
) -> Scene:
    """A square box without walls, whose particles are `noise` dx (normal deviate) off a lattice.

    side: [m], rounded to a multiple of dx; c0: [m/s]; lasts for 200 dx / c0. Nothing but pressure
    acts, tension included: with a matched kernel energy can only go between motion and sound,
    and one that isn't matched heats the lattice.
    """
    dx, c0 = positive("dx", dx), positive("c0", c0)
    side = snap(at_least_spacings("side", side, 12, dx), dx)
    known("kernel", kernel, KERNELS)
    x = lattice(0.0, side, 0.0, side, dx)
    rng = np.random.default_rng(whole("seed", seed))
    x = x + rng.normal(0.0, in_range("noise", noise, 0.0, 0.2) * dx, x.shape)
    return Scene(
        "perturbed_lattice",
        x=x % side,
        dx=dx,
        h=3.0 * dx,
        fluid=Fluid(c0=c0, kernel=kernel, clamp=False),
        effects=Effects(),
        walls=Walls(period_x=(0.0, side), period_y=(0.0, side)),
        duration=200 * dx / c0,
        frame=2 * dx / c0,
        integrator="kick_drift_kick",
    )


def scale(sim: Simulation) -> float:
    """Return rho0 c0^2 times the area [J/m], an energy that doesn't vanish with the noise."""
    return sim.mass * sim.n_fluid * sim.scene.fluid.c0**2


def error(sim: Simulation) -> float:
    """Return the energy gained or lost, as a share of `scale`."""
    return abs(energy(sim) - energy(Simulation(sim.scene, threads=1))) / scale(sim)


def energy(sim: Simulation) -> float:
    """Return kinetic plus internal energy [J/m]."""
    numbers = sim.diagnostics()
    return numbers["kinetic_energy"] + numbers["internal_energy"]


def judge(run: Run) -> list[Measure]:
    """Judge the drift of the energy, and the momentum, which is zero at the start."""
    sim, total = run.sim, run.series("energy")
    matched = sim.scene.fluid.kernel in MATCHED
    quarter = max(len(total) // 4, 1)
    drift = float(abs(total[-quarter:].mean() - total[:quarter].mean()))
    speed = float(run.series("speed").max()) or 1.0
    momentum = np.hypot(*run.series("momentum").T).max() / (sim.mass * sim.n_fluid * speed)
    largest = float(np.abs(total - total[0]).max())
    bounds, unit = (1e-5, 2e-8) if matched else (None, None), "of rho c^2"
    return [
        Measure("largest change of energy", largest / scale(sim), unit, bounds[0]),
        Measure("drift of energy", drift / scale(sim), unit, bounds[1]),
        Measure("drift of energy, against the start", drift / float(total[0]), ""),
        Measure("momentum", float(momentum), "of m v_max", 1e-12),
    ]


def chart(run: Run) -> Chart:
    """Draw the energies over time, and the constant one."""
    kinetic, total = (run.series(name) / scale(run.sim) for name in ("kinetic", "energy"))
    curves = [
        Curve("kinetic", run.times, kinetic),
        Curve("kinetic and internal", run.times, total),
        Curve("conserved", run.times[[0, -1]], total[[0, 0]], reference=True),
    ]
    return Chart("time [s]", "energy / (rho c^2)", curves)


SOURCE = "conservation of energy and momentum"
RESOLUTIONS = tuple({"kernel": kernel} for kernel in KERNELS if kernel in MATCHED)
REFERENCE = Reference(SOURCE, "of rho c^2", error, conserved, judge, chart, RESOLUTIONS)
