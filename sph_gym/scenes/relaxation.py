"""The article's isolation test: no gravity, no walls, a jittered blob in empty space."""

import math
from typing import Any

import numpy as np

from sph_gym.scenes.shared.family import FlowFamily
from sph_gym.scenes.shared.free_bodies import conserved, momentum_measures
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.solver.checks import at_least_spacings, in_range, positive, whole
from sph_gym.solver.geometry import disc
from sph_gym.solver.scene import Effects, Fluid, Scene
from sph_gym.solver.simulation import Simulation


def relaxation(
    dx: float = 0.025, diameter: float = 0.5, jitter: float = 0.05, seed: int = 0
) -> Scene:
    """A round blob whose particles are off their lattice by `jitter` dx (normal deviate).

    diameter: [m]; jitter: at most 0.2. It settles only because the scene names a laminar
    viscosity: pressure that is clamped can push but not pull, so that without viscosity the stored
    energy of the jitter drives the blob apart for ever, and artificial viscosity acts only on
    pairs that approach.
    """
    dx = positive("dx", dx)
    diameter = at_least_spacings("diameter", diameter, 1, dx)
    x = disc(0.0, 0.0, diameter / 2, dx)
    rng = np.random.default_rng(whole("seed", seed))
    x = x + rng.normal(0.0, in_range("jitter", jitter, 0.0, 0.2) * dx, x.shape)
    c0 = 10.0
    return Scene(
        "relaxation",
        x=x - x.mean(axis=0),
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=c0, kernel="mueller"),
        effects=Effects(laminar_viscosity=0.1 * diameter / 0.5),
        duration=2.0,
        frame=0.04 * math.sqrt(diameter / 0.5),
    )


def error(sim: Simulation) -> float:
    """Return the change of the radius since the start [%]."""
    return 100 * abs(radius(sim.x) / radius(np.asarray(sim.scene.x)) - 1)


def radius(x: np.ndarray) -> float:
    """Return the distance of the outermost particle from the origin [m]."""
    return float(np.hypot(*x.T).max())


def observe(sim: Simulation) -> dict[str, Any]:
    """Return radius [m], median distance of nearest neighbours [dx], centre [m], `conserved`."""
    numbers = sim.diagnostics()
    return {
        "radius": radius(sim.x),
        "spacing": numbers["median_spacing"],
        "centre": float(np.hypot(numbers["com_x"], numbers["com_y"])),
        **conserved(sim),
    }


def judge(run: Run) -> list[Measure]:
    """Judge that the blob settled, and where it was."""
    kinetic = run.series("kinetic")
    last = run.seen[-1]
    return [
        Measure("change of radius", error(run.sim), "%", 5.0),
        Measure("kinetic energy", float(kinetic[-1] / kinetic.max()), "of peak", 1e-6),
        Measure("median spacing off dx", 100 * abs(last["spacing"] - 1), "%", 5.0),
        Measure("centre of mass", last["centre"], "m", 1e-12),
        *momentum_measures(run, angular=False),
    ]


def chart(run: Run) -> Chart:
    """Draw the radius over time."""
    size = run.series("radius")
    simulated = Curve("simulated", run.times, size)
    start = Curve("at the start", run.times[[0, -1]], size[[0, 0]], reference=True)
    return Chart("time [s]", "radius [m]", [simulated, start])


SOURCE = "a body at rest stays where it is"
RESOLUTIONS = ({"dx": 0.025}, {"dx": 0.0125})
REFERENCE = Reference(SOURCE, "%", error, observe, judge, chart, RESOLUTIONS)


def draw(rng: np.random.Generator, dx: float) -> dict[str, float]:
    """Return the arguments of a blob, except dx [m]."""
    return {
        "diameter": rng.uniform(12, 22) * dx,
        "jitter": rng.uniform(0.02, 0.08),
        "seed": int(rng.integers(2**31)),
    }


FAMILY = FlowFamily(
    "relaxation",
    dx=0.03,
    seed=6,
    draw=draw,
    odd=("jitter", 0.1, 0.15),
    diagnostic="the blob is at rest: the energy of its jitter depends on the stiffness",
    headroom=1.1,
)
