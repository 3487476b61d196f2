"""A jet of water hits a plate head-on and parts into two films; no gravity, almost no friction."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.checks import at_least_spacings, positive
from sph_gym.solver.geometry import lattice, snap
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls

Array = NDArray[np.float64]
# In jet widths from the centre: the plate's end, the part that carries the pressure, the patch in
# the middle, and the part where the films are measured.
PLATE, PROFILE, PATCH, FILM = 4.0, 2.0, 0.1, (2.0, 3.0)
# In times of passage of a jet width: when the flow becomes steady (the thin front of the films has
# left), and how long before the jet's end arrives it ceases to be.
STEADY, TAIL = 6.0, 2.0
# Particles across the jet from which on the bounds hold.
ENOUGH = 20


def water_jet(
    dx: float = 0.001, width: float = 0.02, speed: float = 5.0, length: float = 0.24
) -> Scene:
    """A jet falls onto a plate of eight times its width, until all but its end has arrived.

    width, length: of the jet [m], rounded to multiples of dx; speed: [m/s]. Its tip is round,
    since a flat one hits the whole plate at once, and the shock tears the jet (the pressure at
    the centre is then 5 % too low). A touch of artificial viscosity, without which the pressure
    waves of the impact go on for ever; walls without friction.
    """
    dx, speed = positive("dx", dx), positive("speed", speed)
    width = snap(at_least_spacings("width", width, 4, dx), dx)
    length = at_least_spacings("length", length, (STEADY + TAIL + 1) * width / dx, dx)
    length = snap(length, dx)
    x = lattice(-width / 2, width / 2, 0.0, length, dx)
    x = x[x[:, 1] > 2 / width * x[:, 0] ** 2]
    half = snap(PLATE * width, dx)
    plate = lattice(-half, half, -3 * dx, 0.0, dx)
    return Scene(
        "water_jet",
        x=x,
        v=np.tile((0.0, -speed), (len(x), 1)),
        dx=dx,
        h=3.0 * dx,
        fluid=Fluid(c0=sound_speed(speed), kernel="wendland_c2"),
        effects=Effects(artificial_viscosity=0.05),
        walls=Walls(particles=plate, pressure="extrapolated", slip="free-slip"),
        duration=length / speed - TAIL * width / speed,
        frame=0.05 * width / speed,
    )


def plate_pressure(x: Array) -> Array:
    """Return p / (rho U^2 / 2) on the plate at x / b from its centre, in a steady ideal flow.

    p = 1 - q^2, where the speed along the plate is q U with x = 2 / pi (atan q + artanh q): the
    flow as a map of the half disc of its velocities. The integral over the plate is 2.
    Source: Milne-Thomson 1968, direct impact of a jet.
    """
    # q = tanh(s) reaches 1 without losing digits
    s = np.linspace(0.0, 40.0, 20001)
    place = 2 / math.pi * (np.arctan(np.tanh(s)) + s)
    return 1 / np.cosh(np.interp(np.abs(x), place, s)) ** 2


def _width_and_speed(sim: Simulation) -> tuple[float, float]:
    x, v = np.asarray(sim.scene.x), np.asarray(sim.scene.v)
    return float(np.ptp(x[:, 0])) + sim.scene.dx, -float(v[0, 1])


def _face(sim: Simulation) -> tuple[Array, Array]:
    """Return x / b and p / (rho U^2 / 2) of the boundary particles at the plate's face."""
    n, (width, speed) = sim.n_fluid, _width_and_speed(sim)
    face = sim.x[n:, 1] > -sim.scene.dx
    p = sim.p[n:][face] / (0.5 * sim.scene.fluid.rho0 * speed**2)
    return sim.x[n:][face, 0] / width, p


def _rms(place: Array, p: Array) -> float:
    gaps = (p - plate_pressure(place))[np.abs(place) < PROFILE]
    return 100 * float(np.sqrt(np.mean(gaps**2)))


def error(sim: Simulation) -> float:
    """Return the RMS of the pressure on the plate minus the exact one [% of rho U^2 / 2].

    Over two jet widths on both sides of the centre; meaningful from 6 b / U on.
    """
    return _rms(*_face(sim))


def observe(sim: Simulation) -> dict[str, Any]:
    """Return pressures, momentum [kg/s], film [b], and the count behind the plate's first layer.

    A face of particles is as rough as they are: some settle up to half a spacing in it.
    """
    (width, _), dx = _width_and_speed(sim), sim.scene.dx
    x, y = sim.x[: sim.n_fluid].T / width
    film = (np.abs(x) > FILM[0]) & (np.abs(x) < FILM[1]) & (y < 1)
    area = film.sum() * sim.mass / (sim.scene.fluid.rho0 * width**2)
    return {
        "pressure": _face(sim)[1],
        "momentum": sim.diagnostics()["momentum_y"],
        "film": float(area / (2 * (FILM[1] - FILM[0]))),
        "passed": int(((y * width < -dx) & (np.abs(x) < PLATE)).sum()),
    }


def _steady(run: Run) -> NDArray[np.bool_]:
    width, speed = _width_and_speed(run.sim)
    return run.times > (STEADY - 0.025) * width / speed


def force(run: Run) -> float:
    """Return the force on the plate in the steady phase [rho U^2 b], by the loss of momentum."""
    (width, speed), steady = _width_and_speed(run.sim), _steady(run)
    slope = np.polynomial.Polynomial.fit(run.times[steady], run.series("momentum")[steady], 1)
    return float(slope.deriv()(0.0)) / (run.sim.scene.fluid.rho0 * speed**2 * width)


def judge(run: Run) -> list[Measure]:
    """Judge mean pressure, force and films of the steady phase; bounds leave room for chance."""
    (width, _), dx = _width_and_speed(run.sim), run.sim.scene.dx
    steady, place = _steady(run), _face(run.sim)[0]
    pressure, film = run.series("pressure")[steady], run.series("film")[steady].mean()
    centre = pressure[:, np.abs(place) < max(PATCH, dx / width)].mean(axis=1)
    load = pressure.mean(axis=0).sum() * dx / (2 * width)
    results = [
        ("RMS error of the mean pressure", _rms(place, pressure.mean(axis=0)), 5.0),
        ("mean pressure at the centre, error", 100 * abs(centre.mean() - 1), 5.0),
        ("its fluctuation", 100 * centre.std(), None),
        ("force by momentum, error", 100 * abs(force(run) - 1), 5.0),
        ("force by pressure, error", 100 * abs(load - 1), 5.0),
        ("film thickness at 2 to 3 b, error", 100 * abs(film / 0.5 - 1), 10.0),
    ]
    fine = width / dx > ENOUGH - 0.5
    passed = Measure("most behind the plate", float(run.series("passed").max()), "", 0.0)
    return [Measure(a, float(b), "%", c if fine else None) for a, b, c in results] + [passed]


def chart(run: Run) -> Chart:
    """Draw the mean pressure along the plate."""
    place, fine = _face(run.sim)[0], np.linspace(-PLATE, PLATE, 401)
    mean, order = run.series("pressure")[_steady(run)].mean(axis=0), np.argsort(place)
    seen = Curve("mean of the steady phase", place[order], mean[order])
    exact = Curve("ideal flow", fine, plate_pressure(fine), reference=True)
    return Chart("x / b", "p / (rho U^2 / 2)", [seen, exact])


SOURCE = "ideal flow: stagnation pressure rho U^2 / 2, force rho U^2 b, films of b / 2"
RESOLUTIONS = ({"dx": 0.002}, {"dx": 0.001}, {"dx": 0.0005})
REFERENCE = Reference(
    SOURCE, "% of rho U^2 / 2", error, observe, judge, chart, RESOLUTIONS, quick=2
)

REFINEMENT = Refinement(
    "water_jet", "width", (7, 10, 14, 20), 10, "RMS error of the mean pressure",
    "of rho U^2 / 2",
    "Falls with dx, but down to the noise of a mean over a few passages of the jet: at a "
    "resolution between two others it can be several times theirs. Nothing is recommended.",
    order=1.6, widest=3.0, joined=4, erratic=True,
)  # fmt: skip
