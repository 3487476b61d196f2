"""A column of water collapses and runs along the floor: Martin & Moyce 1952, without the gate."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sph_gym.scenes.reference import read
from sph_gym.solver.checks import in_range, positive
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
) -> Scene:
    """Column at the left wall of a tank `tank` column widths long.

    width, height: of the column [m], rounded to multiples of dx; gravity: downwards [m/s^2].
    Lasts for 4 sqrt(width / g) of collapse and until the front could have crossed the tank and
    come half the way back.
    """
    dx, width = positive("dx", dx), in_range("width", width, 3 * dx)
    height, gravity = in_range("height", height, 3 * dx), positive("gravity", gravity)
    length = snap(width * in_range("tank", tank, 1.0), dx)
    sides = 1.25 * height
    return Scene(
        "dam_break",
        x=lattice(0.0, width, 0.0, height, dx),
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=sound_speed(math.sqrt(2 * gravity * height))),
        effects=Effects(gravity=(0.0, -gravity), xsph=True, artificial_viscosity=0.02),
        walls=Walls(
            particles=tank_particles(length, sides, dx),
            box=(0.0, length, 0.0, math.inf),
        ),
        duration=4 * math.sqrt(width / gravity) + 0.75 * length / math.sqrt(gravity * height),
        frame=0.05 * math.sqrt(height / gravity),
    )


def front(sim: Simulation) -> float:
    """Position of the surge front [m]: the foremost fluid particle's edge."""
    return float(sim.x[: sim.n_fluid, 0].max()) + sim.scene.dx / 2


def front_history(
    sim: Simulation,
    width: float,
    gravity: float = 9.81,
    last: float = 3.4,
    look: Callable[[Simulation], None] | None = None,
) -> NDArray[np.float64]:
    """Run to T = `last`. Returns (n, 2): T = t sqrt(2 g / width), front / width.

    look: called after each of the about fifty legs per unit of T.
    Raises RuntimeError if the simulation blows up.
    """
    unit = math.sqrt(width / (2 * gravity))
    history = [(0.0, front(sim) / width)]
    while sim.time < last * unit:
        if sim.advance(0.02 * unit).diverged:
            raise RuntimeError(f"the dam break blew up at t = {sim.time:g} s")
        if look is not None:
            look(sim)
        history.append((sim.time / unit, front(sim) / width))
    return np.array(history)


def front_error(history: NDArray[np.float64], shift: float = 0.0) -> float:
    """RMS over the measured points up to T = 3.3 of (simulated - measured) / measured position.

    shift: added to the simulated time, since the gate of the experiment needed time to open.
    Source: Martin & Moyce 1952, table 2, n^2 = 2.
    """
    measured = read("martin_moyce_1952_front_n2_2.csv")
    measured = measured[measured[:, 0] <= 3.3]
    simulated = np.interp(measured[:, 0], history[:, 0] + shift, history[:, 1])
    return float(np.sqrt(np.mean((simulated / measured[:, 1] - 1) ** 2)))
