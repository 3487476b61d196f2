"""A plane channel that starts from rest: the common parts of `poiseuille` and `couette`."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run, read
from sph_gym.solver.checks import at_least_spacings, positive
from sph_gym.solver.geometry import channel_particles, lattice, snap
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls

Array = NDArray[np.float64]
# (y / d, tau) -> u / Umax
Profile = Callable[[Array, float], Array]

# In units of d^2 / nu: the last tabulated time, and a common divisor of all of them.
LAST, FRAME = 0.5, 0.0025
# Particles along the channel, where nothing changes: at least 4 h.
LENGTH = 16
# Terms of the series solutions.
TERMS = 400
# The bound [% of Umax], and the particles across from which on it holds.
BOUND, ENOUGH = 1.0, 40


def build(
    name: str, dx: float, height: float, speed: float, reynolds: float, pushed: bool
) -> Scene:
    """Return fluid at rest between two walls; pushed: by a body force, else drawn by the upper one.

    A narrow support: the error grows with h, 1.5 to 3 times from 2.6 to 3 dx. Rows that slide past
    each other lose their order after some ten heights of way; shifting keeps it.
    """
    dx, speed = positive("dx", dx), positive("speed", speed)
    height = snap(at_least_spacings("height", height, 4, dx), dx)
    nu = speed * height / positive("reynolds", reynolds)
    length, h = LENGTH * dx, 2.6 * dx
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
        frame=FRAME * height**2 / nu,
    )


def height_of(sim: Simulation) -> float:
    """Return the distance of the walls [m]."""
    return float(np.ptp(np.asarray(sim.scene.x)[:, 1])) + sim.scene.dx


def tau(sim: Simulation) -> float:
    """Return nu t / d^2: time in units of that in which momentum crosses the channel."""
    nu = sim.scene.effects.laminar_viscosity
    assert nu is not None
    return nu * sim.time / height_of(sim) ** 2


def tabulated(run: Run) -> Array:
    """Return the indices (5,) of the observations at the tabulated times."""
    times = read("poiseuille_couette_startup.csv")[:, 0]
    return np.abs(run.series("tau")[:, None] - times).argmin(axis=0)


def judge(run: Run) -> list[Measure]:
    """Return the largest errors at the tabulated times, and the flow across, which must be none."""
    error, sim = run.series("error"), run.sim
    fine = height_of(sim) / sim.scene.dx > ENOUGH - 0.5
    unit, bound = "% of Umax", BOUND if fine else None
    worst = float(error[tabulated(run)].max())
    return [
        Measure("largest velocity error at the tabulated times", worst, unit, bound),
        Measure("velocity error at the last of them", float(error[-1]), unit, bound),
        Measure("fastest flow across the channel", float(run.series("across").max()), unit),
    ]


def reference(velocity: Profile, top: Callable[[Simulation], float]) -> Reference:
    """Return the comparison of a scene with its series solution; top: returns Umax [m/s]."""

    def error(sim: Simulation) -> float:
        """Return max |u - u_exact| over all fluid particles [% of Umax]."""
        y, u = sim.x[: sim.n_fluid, 1] / height_of(sim), sim.v[: sim.n_fluid, 0]
        return 100 * float(np.abs(u / top(sim) - velocity(y, tau(sim))).max())

    def observe(sim: Simulation) -> dict[str, Any]:
        """Return tau, the error and the flow across [%], and the mean u / Umax of every row."""
        n, rows = sim.n_fluid, round(height_of(sim) / sim.scene.dx)
        row = np.clip((sim.x[:n, 1] / sim.scene.dx).astype(int), 0, rows - 1)
        count = np.maximum(np.bincount(row, minlength=rows), 1)
        return {
            "tau": tau(sim),
            "error": error(sim),
            "across": 100 * float(np.abs(sim.v[:n, 1]).max()) / top(sim),
            "rows": np.bincount(row, sim.v[:n, 0] / top(sim), minlength=rows) / count,
        }

    def chart(run: Run) -> Chart:
        """Draw the profiles at the tabulated times."""
        curves, fine = [], np.linspace(0.0, 1.0, 101)
        for k in tabulated(run):
            moment = run.seen[k]
            y = (np.arange(len(moment["rows"])) + 0.5) / len(moment["rows"])
            curves.append(Curve(f"tau = {moment['tau']:.4g}", moment["rows"], y))
            exact = velocity(fine, moment["tau"])
            curves.append(Curve(f"series, {moment['tau']:.4g}", exact, fine, reference=True))
        return Chart("u / Umax", "y / d", curves)

    return Reference(
        source="series solution, Morris, Fox & Zhu 1997",
        unit="% of Umax",
        error=error,
        observe=observe,
        judge=judge,
        chart=chart,
        resolutions=({"dx": 1 / 20}, {"dx": 1 / 40}, {"dx": 1 / 80}),
        quick=2,
    )
