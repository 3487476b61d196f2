"""A round drop falls onto a shallow pool: free fall, a violent impact, then calm sloshing."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.scenes.shared import tanks
from sph_gym.scenes.shared.family import GRAVITY, STRONG_GRAVITY, FlowFamily
from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.solver.checks import at_least_spacings, positive
from sph_gym.solver.geometry import disc, lattice, snap, tank_particles
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls


def drop_impact(
    dx: float = 0.02,
    diameter: float = 0.3,
    drop_height: float = 0.4,
    pool_depth: float = 0.12,
    width: float = 1.2,
    gravity: float = 9.81,
) -> Scene:
    """A drop at rest, its lowest point `drop_height` above the pool, in the middle of the tank.

    diameter, drop_height, pool_depth, width (of the tank): [m], the last two
    rounded to multiples of dx; gravity: downwards [m/s^2].
    Lasts for the fall and three times the time of a wave across half the tank.
    """
    dx, gravity = positive("dx", dx), positive("gravity", gravity)
    diameter = at_least_spacings("diameter", diameter, 3, dx)
    width = at_least_spacings("width", width, 6, dx)
    drop_height = at_least_spacings("drop_height", drop_height, 1, dx)
    pool_depth = at_least_spacings("pool_depth", pool_depth, 1, dx)
    width, pool_depth = snap(width, dx), snap(pool_depth, dx)
    tanks.check_room(diameter, width, dx)
    middle = pool_depth + drop_height + diameter / 2
    drop = disc(width / 2, middle, diameter / 2, dx)
    # the centre of the drop falls to the floor
    v_max = math.sqrt(2 * gravity * middle)
    fall = math.sqrt(2 * drop_height / gravity)
    return Scene(
        "drop_impact",
        x=np.concatenate([lattice(0.0, width, 0.0, pool_depth, dx), drop]),
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=sound_speed(v_max), kernel="mueller"),
        effects=Effects(gravity=(0.0, -gravity), xsph=True, artificial_viscosity=0.02),
        walls=Walls(
            particles=tank_particles(width, middle, dx, layers=3),
            box=(0.0, width, 0.0, math.inf),
        ),
        duration=fall + 1.5 * width / math.sqrt(gravity * pool_depth),
        frame=0.06 * math.sqrt(middle / gravity),
    )


class FreeFall(NamedTuple):
    """Free fall of the drop, while nothing touches it.

    drop: (n,) True for its particles; start: its centre [m]; gap: between it and the pool
    [m]; gravity: downwards [m/s^2]; until: when the first of them are within h of each other [s].
    """

    drop: NDArray[np.bool_]
    start: NDArray[np.float64]
    gap: float
    gravity: float
    until: float

    def height(self, times: Any) -> Any:
        """Return the height of the centre [m] at times [s]."""
        return self.start[1] - self.gravity / 2 * times**2


def fall(scene: Scene) -> FreeFall:
    """Return the free fall of the particles above the widest gap between heights."""
    x = np.asarray(scene.x)
    heights = np.sort(x[:, 1])
    below = int(np.argmax(np.diff(heights)))
    drop = x[:, 1] > heights[below] + scene.dx / 2
    gap = float(heights[below + 1] - heights[below])
    gravity = -float(scene.effects.gravity_at(0.0)[1])
    until = math.sqrt(2 * max(gap - scene.h, 0.0) / gravity)
    return FreeFall(drop, x[drop].mean(axis=0), gap, gravity, until)


def centre(sim: Simulation) -> NDArray[np.float64]:
    """Return the centre (2,) [m] of the particles that were the drop."""
    return sim.x[: sim.n_fluid].astype(float)[fall(sim.scene).drop].mean(axis=0)


def error(sim: Simulation) -> float:
    """Return the distance of the drop's centre from free fall [% of the way to the pool].

    nan once the drop has come so near that the pool acts on it.
    """
    free = fall(sim.scene)
    if sim.time > free.until:
        return math.nan
    off = centre(sim) - (free.start[0], free.height(sim.time))
    return float(100 * np.hypot(*off) / free.gap)


def observe(sim: Simulation) -> dict[str, Any]:
    """Return the error [%], the height of the drop's centre [m], and `tanks.observe`."""
    return {"error": error(sim), "height": float(centre(sim)[1]), **tanks.observe(sim)}


def judge(run: Run) -> list[Measure]:
    """Judge the free fall, and the tank."""
    scene = run.sim.scene
    fine = fall(scene).gap / scene.dx > 39.5
    worst = float(np.nanmax(run.series("error")))
    return [Measure("free fall", worst, "% of the way", 0.1 if fine else None), *tanks.judge(run)]


def chart(run: Run) -> Chart:
    """Draw the height of the drop's centre, and the parabola of its fall."""
    free = fall(run.sim.scene)
    times = np.linspace(0.0, free.until, 50)
    parabola = Curve("free fall", times, free.height(times), reference=True)
    simulated = Curve("simulated", run.times, run.series("height"))
    return Chart("time [s]", "height of the drop's centre [m]", [parabola, simulated])


SOURCE = "free fall: y = y0 - g t^2 / 2; no spurious energy"
RESOLUTIONS = ({"dx": 0.02}, {"dx": 0.01})
REFERENCE = Reference(SOURCE, "% of the way to the pool", error, observe, judge, chart, RESOLUTIONS)


def draw(rng: np.random.Generator, dx: float) -> dict[str, float]:
    """Return the arguments of a drop above a pool, except dx [m]."""
    diameter = rng.uniform(9, 14) * dx
    return {
        "diameter": diameter,
        "drop_height": rng.uniform(3.0, 6.0) * diameter,
        "pool_depth": rng.uniform(2, 5) * dx,
        "width": rng.uniform(3.0, 4.5) * diameter,
        "gravity": rng.uniform(*GRAVITY),
    }


FAMILY = FlowFamily(
    "drop_impact",
    dx=0.03,
    seed=2,
    draw=draw,
    odd=STRONG_GRAVITY,
    frames_per_step=1.5,
    headroom=1.93,
)
