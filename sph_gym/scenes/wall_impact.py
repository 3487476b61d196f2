"""A dam breaks on a dry bed and hits the far wall: the pressure there, as Buchner measured it."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.scenes.shared import tanks
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run, read
from sph_gym.solver.checks import at_least_spacings, in_range, positive
from sph_gym.solver.gauges import Gauge
from sph_gym.solver.geometry import lattice, snap, tank_particles
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls

TABLE = "buchner_2002_wall_pressure.csv"
# Lower and upper end of the sensor's face in the experiment, in heights of the water.
SENSOR = (0.115 / 0.6, 0.205 / 0.6)
# In units of sqrt(H / g): the plateau after the first peak, and the time over which pressures
# are averaged before peaks are looked for, since a compressible fluid rings.
FIRST, PLATEAU, SMOOTHING = (2.2, 3.3), (3.3, 4.9), 0.2


def wall_impact(
    dx: float = 0.015,
    width: float = 1.2,
    height: float = 0.6,
    length: float = 3.22,
    gravity: float = 9.81,
) -> Scene:
    """A column of water at the left wall of a tank, which runs to the right wall and up there.

    width, height: of the column [m]; length: of the tank [m], all rounded to multiples of dx;
    gravity: downwards [m/s^2]. Lasts until the wave that falls back has hit the water below.
    A matched kernel, walls without friction and with the pressure of the fluid, for pressures.
    """
    dx, gravity = positive("dx", dx), positive("gravity", gravity)
    width = at_least_spacings("width", width, 3, dx)
    height = at_least_spacings("height", height, 3, dx)
    length, height = snap(in_range("length", length, width), dx), snap(height, dx)
    unit = math.sqrt(height / gravity)
    return Scene(
        "wall_impact",
        x=lattice(0.0, width, 0.0, height, dx),
        dx=dx,
        h=2.8 * dx,
        fluid=Fluid(c0=sound_speed(math.sqrt(2 * gravity * height)), kernel="quintic_spline"),
        effects=Effects(gravity=(0.0, -gravity), xsph=True, artificial_viscosity=0.05),
        walls=Walls(
            particles=tank_particles(length, 2 * height, dx),
            box=(0.0, length, 0.0, math.inf),
            pressure="extrapolated",
            slip="free-slip",
        ),
        duration=7 * unit,
        frame=0.02 * unit,
    )


def scales(scene: Scene) -> tuple[float, float, float]:
    """Return the height of the water H [m], sqrt(H / g) [s] and rho0 g H [Pa]."""
    height = float(np.ptp(np.asarray(scene.x)[:, 1])) + scene.dx
    gravity = -float(scene.effects.gravity_at(0.0)[1])
    return height, math.sqrt(height / gravity), scene.fluid.rho0 * gravity * height


def sensor(scene: Scene) -> tuple[Gauge, Gauge]:
    """Return gauges of the pressure on the sensor's face, and at its lower end."""
    wall, (low, high) = tanks.box(scene)[1], np.array(SENSOR) * scales(scene)[0]
    return Gauge("pressure", (wall, low, wall, high)), Gauge("pressure", (wall, low))


def observe(sim: Simulation) -> dict[str, Any]:
    """Return the pressures on the sensor and at its lower end [rho0 g H], and `tanks.observe`."""
    face, low = (float(gauge.read(sim)[0]) / scales(sim.scene)[2] for gauge in sensor(sim.scene))
    return {"face": face, "low": low, **tanks.observe(sim)}


def error(sim: Simulation) -> float:
    """Return the pressure on the sensor off the measured one [% of rho0 g H]; nan without one."""
    times, pressures = read(TABLE).T
    now = np.array([sim.time / scales(sim.scene)[1]])
    measured = np.interp(now, times, pressures, left=math.nan, right=math.nan)[0]
    return 100 * abs(observe(sim)["face"] - float(measured))


def smoothed(run: Run, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times [sqrt(H / g)], and a series of pressures with its ringing averaged out."""
    times, n = run.times / scales(run.sim.scene)[1], round(SMOOTHING / 0.02)
    values = np.convolve(run.series(name), np.ones(n) / n, mode="same")
    return times, values


def landmarks(times: Any, values: Any) -> tuple[float, float, float]:
    """Return the time of arrival, the first peak and the mean of the plateau after it.

    The wave has arrived where the pressure first passes half of the plateau.
    """
    within = (times > PLATEAU[0]) & (times < PLATEAU[1])
    plateau = float(np.trapezoid(values[within], times[within]) / np.ptp(times[within]))
    early = (times > FIRST[0]) & (times < FIRST[1])
    k = max(int(np.argmax(values > plateau / 2)), 1)
    arrival = float(np.interp(plateau / 2, values[k - 1 : k + 1], times[k - 1 : k + 1]))
    return arrival, float(values[early].max()), plateau


def judge(run: Run) -> list[Measure]:
    """Judge the plateau, peak and arrival against the measured ones, and the tank.

    At the lower end of the face, since Greco 2001 found that theory agrees better with the
    experiment if the sensor is shifted (quoted by Adami, Hu, Adams 2012), and on the whole face.
    """
    measured = landmarks(*read(TABLE).T)
    fine = scales(run.sim.scene)[0] / run.sim.scene.dx > 79.5
    low, face = landmarks(*smoothed(run, "low")), landmarks(*smoothed(run, "face"))

    def off(k: int, found: tuple[float, float, float]) -> float:
        return 100 * abs(found[k] / measured[k] - 1)

    return [
        Measure("plateau at the lower end of the sensor", off(2, low), "%", 20.0 if fine else None),
        Measure("plateau on the sensor", off(2, face), "%", 35.0 if fine else None),
        Measure("first peak at the lower end", off(1, low), "%", 20.0 if fine else None),
        Measure("arrival of the wave there", off(0, low), "%", 10.0 if fine else None),
        *tanks.judge(run),
    ]


def chart(run: Run) -> Chart:
    """Draw the pressure on the sensor over time."""
    times, pressures = read(TABLE).T
    return Chart(
        "t sqrt(g / H) [-]",
        "pressure on the far wall / (rho g H) [-]",
        [
            Curve("on the sensor", *smoothed(run, "face")),
            Curve("at its lower end", *smoothed(run, "low")),
            Curve("measured", times, pressures, reference=True),
        ],
    )


REFERENCE = Reference(
    source="the sensor of Buchner 2002, 160 mm above the floor, H = 0.6 m",
    unit="% of rho0 g H",
    error=error,
    observe=observe,
    judge=judge,
    chart=chart,
    resolutions=({"dx": 0.015}, {"dx": 0.0075}),
)
