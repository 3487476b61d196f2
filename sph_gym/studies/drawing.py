"""Time pictures: the first one, further ones, and frames of the window."""

import os
from collections.abc import Iterator

import numpy as np

from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.studies.table import Row
from sph_gym.timing import clocked, own_clock
from sph_gym.view import Painter, Window

# Pictures a second of an environment, frames a second of the window, and how long one waits there
# for the numbers of a particle that was picked [ms].
PICTURES, FRAMES, WAIT = 150.0, 60.0, 50.0
PIXELS = (640, 480)


def measure(small: Scene, large: Scene, rounds: int) -> Iterator[Row]:
    """Yield rows by the processor time of this thread, since a window waits between frames.

    small: shown as an environment shows it; large: shown in the window, without a screen.
    """
    clock, sim = own_clock(), Simulation(small, threads=1)
    began = clock()
    painter = Painter(small, PIXELS)
    painter.paint(sim)
    first = clock() - began
    times = [clocked(lambda: painter.paint(sim), clock) for _ in range(rounds)]
    size = f"{sim.n_fluid} fluid particles"
    yield Row("first picture", size, 1e3 * first, "ms")
    rate = rounds / (first + sum(times))
    yield Row("pictures, the first one included", size, rate, "1/s", PICTURES, at_least=True)
    yield from _window(Simulation(large, threads=1), rounds)


def _window(sim: Simulation, rounds: int) -> Iterator[Row]:
    # a study opens no window on the screen
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    size, window = f"{sim.n_fluid} fluid particles", Window(sim.scene)
    free = float(np.median(_frames(window, sim, rounds)))
    window.picked = 0
    picked = float(np.median(_frames(window, sim, rounds)))
    window.close()
    yield Row("frames of the window", size, 1 / free, "1/s", FRAMES, at_least=True)
    yield Row("frame with the numbers of a picked particle", size, 1e3 * picked, "ms", WAIT)


def _frames(window: Window, sim: Simulation, rounds: int) -> list[float]:
    """Return how long each of some frames took [s]."""
    clock, times = own_clock(), []
    for _ in range(rounds):
        sim.advance(sim.controls.dt)
        times.append(clocked(lambda: window.show(sim), clock))
    return times
