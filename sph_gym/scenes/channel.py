"""A plane channel that starts from rest: what `poiseuille` and `couette` have in common."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sph_gym.scenes.reference import Chart, Curve, Measure, Run, read
from sph_gym.solver.checks import in_range, positive
from sph_gym.solver.geometry import channel_particles, lattice, snap
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls

Array = NDArray[np.float64]
# (y / d, tau) -> u / Umax
Profile = Callable[[Array, float], Array]

SOURCE = "Morris, Fox & Zhu 1997"
# Of d^2 / nu: the last tabulated time, and what divides all of them.
LAST, LOOK = 0.5, 0.0025
# Particles along the channel, in which nothing changes along it: at least 4 h.
LENGTH = 16
TERMS = 400
RESOLUTIONS = ({"dx": 1 / 20}, {"dx": 1 / 40}, {"dx": 1 / 80})
# Particles across from which on the bound holds, and the bound [% of Umax].
ENOUGH, BOUND = 40, 1.0


def channel(
    name: str,
    dx: float,
    height: float,
    speed: float,
    reynolds: float,
    pushed: bool,
) -> Scene:
    """Fluid at rest between two walls; pushed: by a body force, else drawn by the upper wall.

    The quintic spline at h = 3 dx comes closest to the right second moment on a lattice, and so
    to the right viscosity: 0.1 %, where Wendland C2 at 2.5 dx misses it by 5 %. Rows that slide
    past each other lose their order after some ten heights of way; shifting keeps it.
    """
    dx, speed = positive("dx", dx), positive("speed", speed)
    height = snap(in_range("height", height, 4 * dx), dx)
    nu = speed * height / positive("reynolds", reynolds)
    length, h = LENGTH * dx, 3.0 * dx
    boundary = channel_particles(length, height, dx, layers=3)
    velocity = np.zeros_like(boundary)
    if not pushed:
        velocity[boundary[:, 1] > height, 0] = speed
    return Scene(
        name,
        x=lattice(0.0, length, 0.0, height, dx),
        dx=dx,
        h=h,
        fluid=Fluid(c0=sound_speed(speed), kernel="quintic_spline", clamp=False),
        effects=Effects(
            gravity=(8 * nu * speed / height**2, 0.0) if pushed else None,
            laminar_viscosity=nu,
            shifting=1.0,
        ),
        walls=Walls(
            particles=boundary,
            pressure="extrapolated",
            velocity=velocity,
            period_x=(0.0, length),
        ),
        duration=LAST * height**2 / nu,
        frame=LOOK * height**2 / nu,
    )


def height_of(sim: Simulation) -> float:
    """Between the walls [m]."""
    return float(np.ptp(np.asarray(sim.scene.x)[:, 1])) + sim.scene.dx


def tau(sim: Simulation) -> float:
    """nu t / d^2: time in units of that in which momentum crosses the channel."""
    nu = sim.scene.effects.laminar_viscosity
    assert nu is not None
    return nu * sim.time / height_of(sim) ** 2


def deviation(sim: Simulation, profile: Profile, top: float) -> float:
    """max |u - u_exact| / Umax over all particles [%]; top: Umax [m/s]."""
    y, u = sim.x[: sim.n_fluid, 1] / height_of(sim), sim.v[: sim.n_fluid, 0]
    return 100 * float(np.abs(u / top - profile(y, tau(sim))).max())


def look(sim: Simulation, profile: Profile, top: float) -> dict[str, object]:
    """What is seen of a moment: tau, the error, the flow across, and the mean of every row."""
    n, d = sim.n_fluid, height_of(sim)
    rows = round(d / sim.scene.dx)
    row = np.clip((sim.x[:n, 1] / sim.scene.dx).astype(int), 0, rows - 1)
    count = np.maximum(np.bincount(row, minlength=rows), 1)
    return {
        "tau": tau(sim),
        "error": deviation(sim, profile, top),
        "across": 100 * float(np.abs(sim.v[:n, 1]).max()) / top,
        "rows": np.bincount(row, sim.v[:n, 0] / top, minlength=rows) / count,
    }


def tabulated(run: Run) -> Array:
    """Which observations were made at the tabulated times: (5,) indices."""
    times = read("poiseuille_couette_startup.csv")[:, 0]
    return np.abs(run.series("tau")[:, None] - times).argmin(axis=0)


def judge(run: Run) -> list[Measure]:
    """The largest error at the tabulated times, and what must be nothing."""
    error, sim = run.series("error"), run.sim
    fine = height_of(sim) / sim.scene.dx > ENOUGH - 0.5
    unit, bound = "% of Umax", BOUND if fine else None
    worst = float(error[tabulated(run)].max())
    return [
        Measure("largest velocity error at the tabulated times", worst, unit, bound),
        Measure("velocity error at the last of them", float(error[-1]), unit, bound),
        Measure("fastest flow across the channel", float(run.series("across").max()), unit),
    ]


def chart(run: Run, profile: Profile) -> Chart:
    """Profiles at the tabulated times."""
    curves = []
    for k in tabulated(run):
        moment = run.seen[k]
        y = (np.arange(len(moment["rows"])) + 0.5) / len(moment["rows"])
        fine = np.linspace(0.0, 1.0, 101)
        curves.append(Curve(f"tau = {moment['tau']:.4g}", moment["rows"], y))
        exact = profile(fine, moment["tau"])
        curves.append(Curve(f"series, {moment['tau']:.4g}", exact, fine, reference=True))
    return Chart("u / Umax", "y / d", curves)
