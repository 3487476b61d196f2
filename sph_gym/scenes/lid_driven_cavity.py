"""A closed square cavity whose lid slides: one large vortex, Ghia, Ghia & Shin 1982, Re = 100."""

from typing import Any

import numpy as np

from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run, read
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.checks import at_least_spacings, in_range, positive
from sph_gym.solver.geometry import lattice, snap, tank_particles
from sph_gym.solver.sampling import interpolate
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls

TABLES = ("ghia_1982_cavity_re100_u.csv", "ghia_1982_cavity_re100_v.csv")
# In units of size / speed: the duration (it is steady from about 10 on), and its last part, over
# which the mean is taken. Particles come and go, so that a single moment is noisier than the flow.
LAST, MEAN = 20.0, 5.0
# Particles across from which on the bound holds, and the bound [of U].
ENOUGH, BOUND = 60, 0.03


def lid_driven_cavity(
    dx: float = 1 / 60, size: float = 1.0, speed: float = 1.0, reynolds: float = 100.0
) -> Scene:
    """A cavity full of fluid at rest; its lid slides to the right from the start on.

    size: of the cavity [m], rounded to a multiple of dx; speed: of the lid [m/s], its ends
    included; reynolds: speed size / nu, at least 10 (slower flows need a stiffer fluid); the
    reference is that of 100. Walls take on the pressure of the fluid, since under suction those
    with a pressure of their own let it through; shifting closes the voids that suction opens.
    """
    dx, speed = positive("dx", dx), positive("speed", speed)
    size = snap(at_least_spacings("size", size, 5, dx), dx)
    boundary = tank_particles(size, size, dx, layers=4, lid=True)
    velocity = np.zeros_like(boundary)
    velocity[boundary[:, 1] > size, 0] = speed
    nu = speed * size / in_range("reynolds", reynolds, 10.0)
    return Scene(
        "lid_driven_cavity",
        x=lattice(0.0, size, 0.0, size, dx),
        dx=dx,
        h=4.0 * dx,
        fluid=Fluid(c0=sound_speed(speed), kernel="wendland_c2", clamp=False),
        effects=Effects(laminar_viscosity=nu, shifting=2.0),
        walls=Walls(particles=boundary, pressure="extrapolated", velocity=velocity),
        duration=LAST * size / speed,
        frame=0.2 * size / speed,
    )


def _size_and_speed(sim: Simulation) -> tuple[float, float]:
    assert sim.scene.walls is not None
    return float(np.ptp(np.asarray(sim.scene.x)[:, 0])) + sim.scene.dx, sim.scene.walls.top_speed


def profiles(sim: Simulation) -> np.ndarray:
    """Return (2, 15) u / U and v / U on both centre lines, at Ghia's points."""
    size, speed = _size_and_speed(sim)
    y, x = (read(table)[:, 0] for table in TABLES)
    half = np.full(len(y), 0.5)
    points = np.concatenate([np.stack([half, y], axis=-1), np.stack([x, half], axis=-1)])
    u, v = interpolate(sim, points * size).T / speed
    return np.stack([u[: len(y)], v[len(y) :]])


def deviation(seen: np.ndarray) -> float:
    """Return the largest difference of (2, 15) velocities from both tables [of U]."""
    return float(np.abs(seen - [read(table)[:, 1] for table in TABLES]).max())


def error(sim: Simulation) -> float:
    """Return the largest difference of the present velocities from both tables [of U]."""
    return deviation(profiles(sim))


def observe(sim: Simulation) -> dict[str, Any]:
    """Return `profiles`, kinetic energy [J/m] and the count behind the walls' first layer."""
    x, (size, _), dx = sim.x[: sim.n_fluid], _size_and_speed(sim), sim.scene.dx
    return {
        "profiles": profiles(sim),
        "kinetic": sim.diagnostics()["kinetic_energy"],
        "outside": int(((x < -dx) | (x > size + dx)).any(axis=1).sum()),
    }


def _steady(run: Run) -> np.ndarray:
    """Return the mask of the observations that count for the mean."""
    return run.times > run.sim.time * (1 - MEAN / LAST) * (1 + 1e-9)


def judge(run: Run) -> list[Measure]:
    """Judge the mean of the last observations, the very last one, and the steadiness."""
    size, _ = _size_and_speed(run.sim)
    bound = BOUND if size / run.sim.scene.dx > ENOUGH - 0.5 else None
    late, seen = _steady(run), run.series("profiles")
    kinetic = run.series("kinetic")[late]
    return [
        Measure("largest error of the mean profiles", deviation(seen[late].mean(0)), "U", bound),
        Measure("largest error at the end", deviation(seen[-1]), "U", bound),
        Measure("kinetic energy, spread / mean", float(np.ptp(kinetic) / kinetic.mean()), ""),
        Measure("most particles outside", float(run.series("outside").max()), "", 0.0),
    ]


def chart(run: Run) -> Chart:
    """Draw the mean profiles on both centre lines, and Ghia's."""
    u, v = run.series("profiles")[_steady(run)].mean(axis=0)
    table_u, table_v = (read(table) for table in TABLES)
    curves = [
        Curve("u on the vertical centre line", table_u[:, 0], u),
        Curve("u, Ghia et al.", table_u[:, 0], table_u[:, 1], reference=True),
        Curve("v on the horizontal centre line", table_v[:, 0], v),
        Curve("v, Ghia et al.", table_v[:, 0], table_v[:, 1], reference=True),
    ]
    return Chart("y / L of u, x / L of v", "u / U, v / U", curves)


SOURCE = "Ghia, Ghia & Shin 1982, tables I and II, Re = 100"
RESOLUTIONS = ({"dx": 1 / 30}, {"dx": 1 / 60})
REFERENCE = Reference(SOURCE, "U", error, observe, judge, chart, RESOLUTIONS, quick=2)

REFINEMENT = Refinement(
    "lid_driven_cavity", "size", (12, 16, 20, 28, 40), 20,
    "largest error of the mean profiles", "of U",
    "Between first and second order, until the tables' own digits are left.",
    order=1.4, widest=4.0,
    single="its tables are read at one Reynolds number; speed and size only change the units",
)  # fmt: skip
