"""A column of water collapses and runs along the floor: Martin & Moyce 1952, without the gate."""

import math
from typing import Any

import numpy as np

from sph_gym.scenes.shared import martin_moyce, shallow, tanks
from sph_gym.scenes.shared.family import GRAVITY, STRONG_GRAVITY, FlowFamily
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.checks import at_least_spacings, in_range, positive
from sph_gym.solver.geometry import lattice, snap, tank_particles
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls


def dam_break(
    dx: float = 0.02,
    width: float = 0.5,
    height: float = 1.0,
    tank: float = 7.0,
    gravity: float = 9.81,
    wet_bed: float = 0.0,
    obstacle: float = 0.0,
    obstacle_at: float = 4.0,
) -> Scene:
    """Column at the left wall of a tank `tank` column widths long.

    width, height: of the column [m], rounded to multiples of dx; gravity: downwards [m/s^2];
    wet_bed: depth [m] of the water that is already on the floor; obstacle: height [m] of a block
    on the floor, half as wide as high, 0 for none; obstacle_at: its left face, in column widths.
    Lasts for 4 sqrt(width / g) of collapse and until the front could have crossed the tank and
    come half the way back.
    """
    dx, width = positive("dx", dx), at_least_spacings("width", width, 3, dx)
    height, gravity = at_least_spacings("height", height, 3, dx), positive("gravity", gravity)
    length = snap(width * in_range("tank", tank, 1.0), dx)
    sides = 1.25 * height
    x = lattice(0.0, width, 0.0, height, dx)
    walls = tank_particles(length, sides, dx, layers=3)
    start = snap(width, dx)
    if in_range("wet_bed", wet_bed, 0.0, 0.9 * height) > 0 and length - start > dx / 2:
        x = np.concatenate([x, lattice(start, length, 0.0, snap(wet_bed, dx), dx)])
    obstacle_at = in_range("obstacle_at", obstacle_at, 1.0)
    if in_range("obstacle", obstacle, 0.0, sides) > 0:
        block = _block(obstacle, obstacle_at, width, length, dx)
        left, right, floor, top = block
        inside = (x > (left, floor)) & (x < (right, top))
        x = x[~inside.all(axis=1)]
        walls = np.concatenate([walls, lattice(*block, dx)])
    return Scene(
        "dam_break",
        x=x,
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=sound_speed(math.sqrt(2 * gravity * height)), kernel="mueller"),
        effects=Effects(gravity=(0.0, -gravity), xsph=True, artificial_viscosity=0.02),
        walls=Walls(particles=walls, box=(0.0, length, 0.0, math.inf)),
        duration=4 * math.sqrt(width / gravity) + 0.75 * length / math.sqrt(gravity * height),
        frame=0.05 * math.sqrt(height / gravity),
    )


def _block(
    height: float, at: float, width: float, length: float, dx: float
) -> tuple[float, float, float, float]:
    """Return the sides of the obstacle [m]; at least three particles thick, as all walls are."""
    thick = max(snap(height / 2, dx), 3 * dx)
    last = (length - thick) / width
    left = snap(width * in_range("obstacle_at", at, 1.0, last), dx)
    return left, left + thick, 0.0, snap(height, dx)


def expected(scene: Scene) -> tuple[martin_moyce.Column, shallow.Stoker | None]:
    """Return the column, and the flow over its wet bed by shallow-water theory if it has one."""
    water, gravity = martin_moyce.column(scene), -float(scene.effects.gravity_at(0.0)[1])
    wet = water.wet_bed > 0
    return water, shallow.stoker(water.height, water.wet_bed, gravity) if wet else None


def error(sim: Simulation) -> float:
    """Return the distance of the front from the measured one [% of the latter]; nan without one."""
    return 100 * martin_moyce.present_error(sim)


def observe(sim: Simulation) -> dict[str, Any]:
    """Return front, height at the left wall and bore on a wet bed [m], and `tanks.observe`."""
    water, flow = expected(sim.scene)
    half = 0.0 if flow is None else (flow.depth + water.wet_bed) / 2
    return {
        "front": martin_moyce.front(sim),
        "height": martin_moyce.left_height(sim),
        "bore": 0.0 if flow is None else shallow.bore(sim, half),
        **tanks.observe(sim),
    }


def judge(run: Run) -> list[Measure]:
    """Judge front and height where they were measured, the bore on a wet bed, and the tank."""
    scene, found = run.sim.scene, list[Measure]()
    water, flow = expected(scene)
    if martin_moyce.measured(scene):
        found = martin_moyce.judge(run, fine=water.width / scene.dx > 39.5)
    elif flow is not None and not martin_moyce.has_obstacle(scene):
        # a column that lasts, and rows enough in the bed for a bore
        fine = water.width > 3 * water.height and water.wet_bed > 5.5 * scene.dx
        speed = shallow.bore_speed(run.times, run.series("bore"), water.width, tanks.box(scene)[1])
        off = 100 * abs(speed / flow.bore - 1)
        found = [Measure("speed of the bore", off, "%", 5.0 if fine else None)]
    return [*found, *tanks.judge(run)]


def chart(run: Run) -> Chart:
    """Draw front and height at the wall, in widths and heights of the column; or the bore."""
    water, flow = expected(run.sim.scene)
    if flow is None:
        labels = "t sqrt(2 g / width) [-]", "front / width, height / initial height [-]"
        return Chart(*labels, martin_moyce.curves(run))
    path = np.minimum(water.width + flow.bore * run.times, tanks.box(run.sim.scene)[1])
    curves = [
        Curve("bore", run.times, run.series("bore")),
        Curve("bore, shallow water", run.times, path, reference=True),
    ]
    return Chart("time [s]", "place of the bore [m]", curves)


SOURCE = "Martin & Moyce 1952, tables 2 and 6, n^2 = 2; Stoker 1957 for the wet bed"
RESOLUTIONS = (
    {"dx": 0.025},
    {"dx": 0.0125},
    *({"dx": dx, "width": 0.8, "height": 0.2, "tank": 4.0, "wet_bed": 0.06} for dx in (0.02, 0.01)),
)
REFERENCE = Reference(SOURCE, "% of the measured front", error, observe, judge, chart, RESOLUTIONS)

REFINEMENT = Refinement(
    "dam_break", "width", (10, 14, 20, 28, 40), 20,
    "front, RMS at the best time shift", "of the measured front",
    "Hardly: between four and three percent at all resolutions, since the reference is an "
    "experiment, with a gate, a floor that rubs and readings of its own.",
    arguments={"tank": 5.0}, widest=3.0,
    single="its measurements are of columns twice as high as wide",
)  # fmt: skip


def draw(rng: np.random.Generator, dx: float) -> dict[str, float]:
    """Return the arguments of a column in an empty tank, except dx [m]."""
    width = rng.uniform(12, 17) * dx
    return {
        "width": width,
        "height": width * rng.uniform(1.2, 2.5),
        "tank": rng.uniform(4.0, 7.0),
        "gravity": rng.uniform(*GRAVITY),
    }


def draw_flooded_obstacle(rng: np.random.Generator, dx: float) -> dict[str, float]:
    """Return the arguments of a column behind a wet bed with an obstacle, except dx [m]."""
    width = rng.uniform(12, 16) * dx
    return {
        "width": width,
        "height": width * rng.uniform(1.2, 2.0),
        "tank": rng.uniform(4.0, 6.0),
        "gravity": rng.uniform(*GRAVITY),
        "wet_bed": rng.uniform(2, 4) * dx,
        "obstacle": rng.uniform(4, 7) * dx,
        "obstacle_at": rng.uniform(2.0, 2.8),
    }


FAMILY = FlowFamily(
    "dam_break",
    dx=0.04,
    seed=1,
    draw=draw,
    odd=STRONG_GRAVITY,
    frames_per_step=1.5,
    headroom=1.43,
    remark="small headroom",
)
