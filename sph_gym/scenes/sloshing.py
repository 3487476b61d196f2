"""A shallow tank rolls about the middle of its floor: the geometry of SPHERIC benchmark 10."""

import math
from typing import Any

import numpy as np

from sph_gym.scenes.shared import tanks, waves
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.checks import at_least_spacings, in_range, positive
from sph_gym.solver.geometry import lattice, snap, tank_particles
from sph_gym.solver.gravity import RollingTank
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls

FRAMES_PER_PERIOD = 30
# Linear theory is for rolls of at most so many degrees, and for periods off the natural one by at
# least this logarithm of their ratio.
SMALL, OFF = 1.0, 0.25


def sloshing(
    dx: float = 0.0093,
    length: float = 0.9,
    height: float = 0.508,
    fill: float = 0.093,
    degrees: float = 4.0,
    period_ratio: float = 1.0,
    periods: float = 4.0,
    gravity: float = 9.81,
) -> Scene:
    """A closed tank that rolls by `degrees` sin(2 pi t / period), from rest.

    length, height, fill: of the tank, and depth of the water [m], rounded to multiples of dx;
    degrees: amplitude of the roll; period_ratio: its period in natural periods of the water;
    periods: how many the scene lasts; gravity: [m/s^2]. Seen from the tank: its walls stand still,
    and gravity turns. Source of the defaults: Botia-Vera, Souto-Iglesias, Bulian, Lobovsky 2010.
    """
    dx, gravity = positive("dx", dx), positive("gravity", gravity)
    length = at_least_spacings("length", length, 6, dx)
    fill = at_least_spacings("fill", fill, 1, dx)
    height = at_least_spacings("height", height, fill / dx + 1, dx)
    length, fill, height = (snap(side, dx) for side in (length, fill, height))
    roll = math.radians(in_range("degrees", degrees, 0.0, 45.0))
    omega = waves.frequency(1, length, fill, gravity) / positive("period_ratio", period_ratio)
    # long waves on water that the roll has lifted at one wall
    c0 = sound_speed(math.sqrt(gravity * (fill + length * roll)))
    # compressed as its weight does: no sound at the start
    x, y = lattice(0.0, length, 0.0, fill, dx).T
    sunk = gravity / c0**2 * y * (fill - y / 2)
    period = 2 * math.pi / omega
    return Scene(
        "sloshing",
        x=np.stack([x, y - sunk], axis=-1),
        dx=dx,
        h=2.8 * dx,
        fluid=Fluid(c0=c0, kernel="quintic_spline"),
        effects=Effects(
            gravity=RollingTank(gravity, roll, 1 / period, pivot=(length / 2, 0.0)), xsph=True
        ),
        walls=Walls(
            particles=tank_particles(length, height, dx, layers=3, lid=True),
            box=(0.0, length, 0.0, height),
            pressure="extrapolated",
            slip="free-slip",
        ),
        duration=in_range("periods", periods, 1.0) * period,
        frame=period / FRAMES_PER_PERIOD,
    )


def theory(scene: Scene) -> waves.Rolling:
    """Return the linear theory of a scene's tank."""
    tank = scene.effects.field
    assert isinstance(tank, RollingTank)
    return waves.Rolling(*waves.basin(scene), tank.g, tank.amplitude, 2 * math.pi * tank.frequency)


def error(sim: Simulation) -> float:
    """Return the centre of mass off linear theory, in % of its shift under the largest tilt.

    That theory knows nothing of rolls by several degrees, nor of breaking waves.
    """
    linear = theory(sim.scene)
    at_rest = linear.roll * linear.length**2 / (12 * linear.depth)
    off = waves.com_shift(sim) - float(linear.shift(sim.time))
    return 100 * abs(off) / max(at_rest, 1e-300)


def observe(sim: Simulation) -> dict[str, Any]:
    """Return the shift of the centre of mass [m], and `tanks.observe`."""
    return {"shift": waves.com_shift(sim), **tanks.observe(sim)}


def is_small(linear: waves.Rolling) -> bool:
    """Return True if the roll is small enough for linear theory."""
    return math.degrees(linear.roll) < SMALL + 1e-9


def judge(run: Run) -> list[Measure]:
    """Judge the response to a roll off resonance, and the tank."""
    scene, shift = run.sim.scene, run.series("shift")
    linear, natural = theory(scene), theory(scene).mode(1)[0]
    distance = abs(math.log(natural / linear.drive))
    if linear.roll == 0 or distance < OFF:
        return tanks.judge(run)
    response, omega = linear.fit(run.times, shift)
    expected = linear.shift(run.times)
    rest = math.sqrt(float(((shift - expected) ** 2).mean() / (expected**2).mean()))
    # amplitude and frequency, each in %
    off = (100 * abs(response / linear.response() - 1), 100 * abs(omega / natural - 1))
    meant = is_small(linear) and linear.depth / scene.dx > 9.5
    return [
        Measure("amplitude of the response", off[0], "%", 5.0 if meant else None),
        Measure("natural frequency", off[1], "%", 2.0 if meant else None),
        Measure("centre of mass, RMS", 100 * rest, "% of the RMS of linear theory"),
        *tanks.judge(run),
    ]


def chart(run: Run) -> Chart:
    """Draw the centre of mass over time, and linear theory if the roll is small."""
    curves = [Curve("simulated", run.times, run.series("shift"))]
    linear = theory(run.sim.scene)
    if is_small(linear):
        expected = linear.shift(run.times)
        curves = [Curve("linear theory", run.times, expected, reference=True), *curves]
    return Chart("time [s]", "centre of mass, right of the middle [m]", curves)


SOURCE = "linear potential theory of a rolling tank, as in Faltinsen 1978"
RESOLUTIONS = (
    {"dx": 0.0093, "degrees": 1.0, "period_ratio": 2.0, "periods": 3.0},
    {"dx": 0.00465, "degrees": 1.0, "period_ratio": 2.0, "periods": 3.0},
    {"dx": 0.0093},
)
REFERENCE = Reference(
    SOURCE, "% of the shift under the largest tilt", error, observe, judge, chart, RESOLUTIONS
)

REFINEMENT = Refinement(
    "sloshing", "fill", (5, 7, 10), 7, "centre of mass, RMS", "of the RMS of linear theory",
    "About first order with five to ten rows of water; theory is linear.",
    arguments={"degrees": 1.0, "period_ratio": 2.0, "periods": 1.5},
    order=0.8, others=({"degrees": 0.8}, {"degrees": 2.0}), widest=3.0,
)  # fmt: skip
