"""The collapse of a column of water on a dry floor, as measured by Martin & Moyce 1952."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.scenes.shared import tanks
from sph_gym.scenes.shared.reference import Curve, Measure, Run, read
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation

# Shifts of simulated T: the gate of the experiment needed time to open.
SHIFTS = np.linspace(0.0, 0.4, 81)
# The front is compared up to this T, when it has come this many widths far.
LAST, FARTHEST = 3.3, 4.5


class Column(NamedTuple):
    """Water at the start [m]: width and height of the column, depth of the bed ahead of it."""

    width: float
    height: float
    wet_bed: float


def column(scene: Scene) -> Column:
    """Return the column of a scene at its start."""
    (x, y), edge = np.asarray(scene.x).T, scene.dx / 2
    height = float(y.max()) + edge
    width = float(x[y > height - scene.dx].max()) + edge
    return Column(width, height, float(y[x > width].max(initial=-edge)) + edge)


def has_obstacle(scene: Scene) -> bool:
    """Return True if a block stands on the floor."""
    left, right, floor, _ = tanks.box(scene)
    assert scene.walls is not None
    x, y = np.asarray(scene.walls.particles).T
    return bool(((x > left) & (x < right) & (y > floor)).any())


def measured(scene: Scene) -> bool:
    """Return True for a column that was measured: twice as high as wide, on a dry, empty floor."""
    water = column(scene)
    free = tanks.box(scene)[1] > FARTHEST * water.width and not has_obstacle(scene)
    return free and water.wet_bed == 0 and abs(water.height / water.width - 2) < 0.1


def front(sim: Simulation) -> float:
    """Return the position of the surge front [m]: the foremost fluid particle's edge."""
    return float(sim.x[: sim.n_fluid, 0].max()) + sim.scene.dx / 2


def left_height(sim: Simulation) -> float:
    """Return the height of the water at the left wall [m]: its highest particle's edge."""
    x, y = sim.x[: sim.n_fluid].astype(float).T
    return float(y[x < sim.scene.h].max(initial=-sim.scene.dx / 2)) + sim.scene.dx / 2


def front_error(history: NDArray[np.float64], shift: float = 0.0) -> float:
    """Return the RMS of (simulated - measured) / measured position up to T = 3.3.

    history: (n, 2) T = t sqrt(2 g / width) and front / width; shift: added to the simulated time,
    since the gate of the experiment needed time to open. Source: table 2, n^2 = 2.
    """
    table = read("martin_moyce_1952_front_n2_2.csv")
    table = table[table[:, 0] <= LAST]
    simulated = np.interp(table[:, 0], history[:, 0] + shift, history[:, 1])
    return float(np.sqrt(np.mean((simulated / table[:, 1] - 1) ** 2)))


def height_error(history: NDArray[np.float64]) -> float:
    """Return the RMS over the measured points of simulated - measured height [initial height].

    history: (n, 2) tau = t sqrt(g / width) and height at the left wall / initial height.
    Source: table 6, n^2 = 2.
    """
    table = read("martin_moyce_1952_height_n2_2.csv")
    table = table[table[:, 0] <= history[-1, 0]]
    simulated = np.interp(table[:, 0], *history.T)
    return float(np.sqrt(np.mean((simulated - table[:, 1]) ** 2)))


def present_error(sim: Simulation) -> float:
    """Return the front off the measured one now, as a share of that; nan where it is unknown."""
    table, width = read("martin_moyce_1952_front_n2_2.csv"), column(sim.scene).width
    gravity = -float(sim.scene.effects.gravity_at(sim.time)[1])
    moment = sim.time * math.sqrt(2 * gravity / width)
    if not measured(sim.scene) or not table[0, 0] <= moment <= table[-1, 0]:
        return math.nan
    return abs(front(sim) / width / float(np.interp(moment, *table.T)) - 1)


def histories(run: Run) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (n, 2) T and front / width, and (n, 2) tau and height / initial height, of a run."""
    water, scene = column(run.sim.scene), run.sim.scene
    tau = run.times * math.sqrt(-float(scene.effects.gravity_at(0.0)[1]) / water.width)
    fronts, heights = run.series("front") / water.width, run.series("height") / water.height
    return np.stack([math.sqrt(2) * tau, fronts], axis=-1), np.stack([tau, heights], axis=-1)


def judge(run: Run, fine: bool) -> list[Measure]:
    """Judge front and height over time; fine: True if the bounds hold at this resolution."""
    fronts, heights = histories(run)
    best = min(front_error(fronts, shift) for shift in SHIFTS)
    return [
        Measure("front, RMS", 100 * front_error(fronts), "%", 8.0 if fine else None),
        Measure("front, RMS at the best time shift", 100 * best, "%", 3.5 if fine else None),
        Measure("height at the wall, RMS", 100 * height_error(heights), "% of the initial one"),
    ]


def curves(run: Run) -> list[Curve]:
    """Return front and height at the wall over T, and the measured ones where there are any."""
    fronts, heights = histories(run)
    drawn = [Curve("front", *fronts.T), Curve("height", fronts[:, 0], heights[:, 1])]
    if measured(run.sim.scene):
        tau, height = read("martin_moyce_1952_height_n2_2.csv").T
        moment, place = read("martin_moyce_1952_front_n2_2.csv").T
        drawn += [
            Curve("front, measured", moment, place, reference=True),
            Curve("height, measured", math.sqrt(2) * tau, height, reference=True),
        ]
    return drawn
