"""The slowest standing wave of a tank: water goes to and fro between two walls."""

import math
from typing import Any

import numpy as np

from sph_gym.scenes.shared import waves
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.scenes.shared.refinement import RMS, Refinement
from sph_gym.solver.checks import at_least_spacings, in_range, positive, whole
from sph_gym.solver.geometry import lattice, snap, tank_particles
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls

FRAMES_PER_PERIOD = 20


def standing_wave(
    dx: float = 0.025,
    length: float = 1.0,
    depth: float = 0.5,
    amplitude: float = 0.025,
    periods: int = 8,
    gravity: float = 9.81,
) -> Scene:
    """Water at rest whose surface stands `amplitude` cos(pi x / length) above its mean.

    length, depth: of the water [m], rounded to multiples of dx; amplitude: [m], at most a fifth of
    the depth and a tenth of the length; periods: how many the scene lasts; gravity: downwards
    [m/s^2]. No viscosity: the reference has none, and XSPH calms the particles.
    """
    dx, gravity = positive("dx", dx), positive("gravity", gravity)
    length = at_least_spacings("length", length, 6, dx)
    depth = at_least_spacings("depth", depth, 3, dx)
    length, depth = snap(length, dx), snap(depth, dx)
    amplitude = in_range("amplitude", positive("amplitude", amplitude), 0.0, 0.2 * depth)
    amplitude = in_range("amplitude", amplitude, 0.0, 0.1 * length)
    c0 = sound_speed(math.sqrt(gravity * depth))
    period = 2 * math.pi / waves.frequency(1, length, depth, gravity)
    # displaced as the wave displaces it, and compressed as its weight does: no sound at the start
    k = math.pi / length
    x, y = lattice(0.0, length, 0.0, depth, dx).T
    size = amplitude / math.sinh(k * depth)
    sunk = gravity / c0**2 * y * (depth - y / 2)
    right, up = -size * np.sin(k * x) * np.cosh(k * y), size * np.cos(k * x) * np.sinh(k * y)
    return Scene(
        "standing_wave",
        x=np.stack([x + right, y + up - sunk], axis=-1),
        dx=dx,
        h=2.8 * dx,
        fluid=Fluid(c0=c0, kernel="quintic_spline"),
        effects=Effects(gravity=(0.0, -gravity), xsph=True),
        walls=Walls(
            particles=tank_particles(length, 1.5 * depth, dx, layers=3),
            box=(0.0, length, 0.0, math.inf),
            pressure="extrapolated",
            slip="free-slip",
        ),
        duration=whole("periods", periods, at_least=1) * period,
        frame=period / FRAMES_PER_PERIOD,
    )


def elevation(sim: Simulation) -> float:
    """Return the amplitude of the first mode [m], by the shift of the centre of mass."""
    return waves.com_shift(sim) / waves.shift(1, *waves.basin(sim.scene))


def omega(scene: Scene) -> float:
    """Return the angular frequency of the first mode [1/s]."""
    return waves.frequency(1, *waves.basin(scene), -float(scene.effects.gravity_at(0.0)[1]))


def exact(scene: Scene, time: Any) -> Any:
    """Return the elevation at the left wall [m] of linear theory at `time` [s]."""
    length, depth = waves.basin(scene)
    start = float(np.asarray(scene.x)[:, 0].mean()) - length / 2
    return start / waves.shift(1, length, depth) * np.cos(omega(scene) * time)


def error(sim: Simulation) -> float:
    """Return the elevation at the left wall off linear theory [% of the initial one]."""
    expected, initial = exact(sim.scene, sim.time), exact(sim.scene, 0.0)
    return float(100 * abs(elevation(sim) - expected) / abs(initial))


def observe(sim: Simulation) -> dict[str, Any]:
    """Return elevation and level at the left wall [m], and the energy excess as a share.

    The level is half the difference between both walls, which knows nothing of its mean.
    """
    left, right = sim.level_at([0.0, waves.basin(sim.scene)[0]])
    return {
        "elevation": elevation(sim),
        "level": (left - right) / 2,
        "excess": sim.diagnostics()["energy_excess"],
    }


def judge(run: Run) -> list[Measure]:
    """Judge the frequency, the decay that no viscosity asks for, the level, and the energy."""
    scene = run.sim.scene
    found, rate = waves.ring(run.times, run.series("elevation"))
    died = 1 - math.exp(-2 * math.pi * rate / omega(scene))
    fine = waves.basin(scene)[1] / scene.dx > 19.5
    first = run.times < 2 * math.pi / omega(scene)
    off = (run.series("level") - exact(scene, run.times))[first]
    level = 100 * float(np.sqrt(np.mean(off**2)) / abs(exact(scene, 0.0)))
    return [
        Measure("frequency", 100 * abs(found / omega(scene) - 1), "%", 2.0 if fine else None),
        Measure("decay of the amplitude in a period", 100 * died, "%"),
        Measure("level in the first period, RMS", level, "% of its start", 7.0 if fine else None),
        Measure("spurious energy", run.series("excess").max(), "of what is at stake", 1e-3),
    ]


def chart(run: Run) -> Chart:
    """Draw the elevation at the left wall over time."""
    expected = exact(run.sim.scene, run.times)
    theory = Curve("linear theory", run.times, expected, reference=True)
    simulated = Curve("simulated", run.times, run.series("elevation"))
    return Chart("time [s]", "elevation at the left wall [m]", [theory, simulated])


SOURCE = "linear potential theory: omega^2 = g k tanh(k H) (Lamb 1932, article 228)"
RESOLUTIONS = ({"dx": 0.025}, {"dx": 0.0125})
REFERENCE = Reference(
    SOURCE, "% of the initial amplitude", error, observe, judge, chart, RESOLUTIONS
)

REFINEMENT = Refinement(
    "standing_wave", "depth", (8, 10, 14, 20, 28), 14, RMS, "of the initial amplitude",
    "Between first and second order, since amplitude is lost at the free surface; hardly any "
    "is lost where the density is continuous, not summed.",
    order=1.3, arguments={"periods": 4}, widest=3.0,
    others=({"depth": 0.4, "amplitude": 0.02}, {"amplitude": 0.04}),
)  # fmt: skip
