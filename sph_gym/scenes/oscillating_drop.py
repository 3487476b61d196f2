"""A drop that oscillates in a central field, between flat and tall: Monaghan & Rafiee 2013."""

import numpy as np
from numpy.typing import NDArray

from sph_gym.scenes.shared.free_bodies import (
    conserved,
    ellipse,
    energy_measures,
    momentum_measures,
    rings,
    semi_axes,
)
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.checks import at_least_spacings, in_range, positive
from sph_gym.solver.gravity import CentralGravity
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation

Array = NDArray[np.float64]
FRAMES_PER_PERIOD = 40


def oscillating_drop(
    dx: float = 0.025,
    radius: float = 1.0,
    omega: float = 1.0,
    rate: float = 0.5,
    periods: float = 5.0,
) -> Scene:
    """A drop that begins with u = rate x, v = - rate y under the force - omega^2 r.

    radius: [m], rounded to a multiple of dx; omega, rate: [1/s], the rate from a millionth of omega
    to twice omega; periods: how long it lasts. Pressure is nowhere negative and nothing rubs: only
    a matched kernel and a symplectic integrator keep such a drop going.
    """
    dx = positive("dx", dx)
    radius = at_least_spacings("radius", radius, 3, dx)
    omega, periods = positive("omega", omega), positive("periods", periods)
    rate = in_range("rate", positive("rate", rate), 1e-6 * omega, 2 * omega)
    x = rings(radius, dx)
    time = period(rate, omega)
    return Scene(
        "oscillating_drop",
        x=x,
        v=x * (rate, -rate),
        dx=dx,
        h=3.25 * dx,
        fluid=Fluid(c0=sound_speed(max(omega, rate) * radius), kernel="wendland_c2"),
        effects=Effects(gravity=CentralGravity(omega)),
        duration=periods * time,
        frame=min(periods, 1 / FRAMES_PER_PERIOD) * time,
        integrator="kick_drift_kick",
    )


def period(rate: float, omega: float) -> float:
    """Return the period of the exact drop [s]: twice the time until it is round again.

    For a weak start it is sqrt(2) pi / omega, and a strong one takes longer: the search ends at
    three times that.
    """
    times = np.linspace(0.0, 3 * np.pi / omega, 3001)
    a, b, _ = ellipse(times, rate, omega, steps=1).T
    flatness = np.log(a / b)
    k = int(np.flatnonzero(flatness[1:] <= 0)[0]) + 1
    share = flatness[k - 1] / (flatness[k - 1] - flatness[k])
    return 2 * float(times[k - 1] + share * (times[k] - times[k - 1]))


def start(scene: Scene) -> tuple[float, float, float]:
    """Return radius [m], strain rate [1/s] and omega [1/s] at a scene's start."""
    x, v, field = np.asarray(scene.x), np.asarray(scene.v), scene.effects.field
    assert isinstance(field, CentralGravity)
    radius = float(np.hypot(*x.T).max()) + scene.dx / 2
    return radius, float((v[:, 0] * x[:, 0]).sum() / (x[:, 0] ** 2).sum()), field.omega


def axis(scene: Scene, times: Array) -> Array:
    """Return the exact semi-axes (n,) along x [m] at times (n,) [s]."""
    radius, rate, omega = start(scene)
    return radius * ellipse(times, rate, omega)[:, 0]


def observed_period(times: Array, a: Array, b: Array) -> float:
    """Return the period [s] by a line through the times at which it is round; NaN for too few."""
    flatness = np.log(a / b)
    k = np.flatnonzero(flatness[:-1] * flatness[1:] < 0)
    share = flatness[k] / (flatness[k] - flatness[k + 1])
    moments = times[k] + share * (times[k + 1] - times[k])
    # at the start it is round too, but for the last digit
    moments = moments[moments > times[1]]
    if len(moments) < 2:
        return float("nan")
    return 2 * float(np.polyfit(np.arange(len(moments)), moments, 1)[0])


def error(sim: Simulation) -> float:
    """Return the difference of the semi-axis along x and the exact one [% of the radius]."""
    radius, _, _ = start(sim.scene)
    exact = axis(sim.scene, np.array([sim.time]))[0]
    return 100 * float(abs(semi_axes(sim.x)[0] - exact)) / radius


def observe(sim: Simulation) -> dict[str, float]:
    """Return both semi-axes [m] by second moments, and `conserved`."""
    a, b = semi_axes(sim.x)
    return {"a": a, "b": b, **conserved(sim)}


def judge(run: Run) -> list[Measure]:
    """Judge semi-axis, period and amplitude over the whole run, and the conservation."""
    scene = run.sim.scene
    radius, rate, omega = start(scene)
    a, exact = run.series("a"), axis(scene, run.times)
    off = float(np.sqrt(np.mean((a - exact) ** 2))) / radius
    late = run.times >= run.times[-1] - 1.01 * period(rate, omega)
    amplitude = np.ptp(a[late]) / np.ptp(exact[late])
    beat = observed_period(run.times, a, run.series("b")) / period(rate, omega)
    return [
        Measure("RMS error of the semi-axis", 100 * off, "% of R"),
        Measure("error of the period", 100 * abs(beat - 1), "%", 1.0),
        Measure("amplitude lost by the last period", 100 * float(1 - amplitude), "%"),
        *energy_measures(run),
        *momentum_measures(run, linear=False),
    ]


def chart(run: Run) -> Chart:
    """Draw the semi-axis along x over time."""
    simulated = Curve("simulated", run.times, run.series("a"))
    exact = Curve("exact", run.times, axis(run.sim.scene, run.times), reference=True)
    return Chart("time [s]", "semi-axis along x [m]", [simulated, exact])


SOURCE = "Monaghan & Rafiee 2013: the ordinary differential equation of an ellipse"
RESOLUTIONS = ({"dx": 1 / 20}, {"dx": 1 / 40}, {"dx": 1 / 80})
REFERENCE = Reference(SOURCE, "% of R", error, observe, judge, chart, RESOLUTIONS)

REFINEMENT = Refinement(
    "oscillating_drop", "radius", (10, 14, 20, 28, 40), 20,
    "RMS error of the semi-axis", "of R",
    "A little better than first order: the free surface, and the amplitude that is lost to "
    "heat.",
    order=1.0, arguments={"periods": 2.0},
    others=({"rate": 0.4, "radius": 0.7}, {"rate": 0.7}),
)  # fmt: skip
