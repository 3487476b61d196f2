"""References: tables that come with the package, and the comparison of a scene with them.

A scene with a reference has a `REFERENCE` beside its builder: what is observed while it runs, the
error of the present state, what is judged in the end, and a chart with the reference drawn in.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sph_gym.solver.simulation import Simulation


class Measure(NamedTuple):
    """One result of a run: quantity, value, unit and upper bound.

    bound: None where nothing is demanded, as at resolutions that are too coarse.
    """

    quantity: str
    value: float
    unit: str
    bound: float | None = None


class Curve(NamedTuple):
    """A line, or the points of a reference, in a chart."""

    label: str
    x: ArrayLike
    y: ArrayLike
    reference: bool = False


class Chart(NamedTuple):
    """Labels with units, and the curves to draw."""

    x_label: str
    y_label: str
    curves: list[Curve]


class Run(NamedTuple):
    """A scene from start to end.

    sim: as it ended; times: (n,) [s] of the observations, the start included; seen: what
    `Reference.observe` returned at each of them.
    """

    sim: Simulation
    times: NDArray[np.float64]
    seen: list[dict[str, Any]]

    def series(self, name: str) -> NDArray[np.float64]:
        """Return the observations (n, ...) of one kind."""
        return np.array([moment[name] for moment in self.seen])


@dataclass(frozen=True)
class Reference:
    """Comparison of a scene with an exact, measured or conserved quantity.

    source: of the reference. error: returns the error of the present state, in `unit`; nan where
    it is unknown. observe: called at the start and after every frame. judge: returns the measures
    of a whole run, the first being the error whose convergence order is of interest. chart:
    returns the chart of a run, its reference included. resolutions: arguments of the scene, coarse
    first. quick: how many of them are enough for a first look.
    """

    source: str
    unit: str
    error: Callable[[Simulation], float]
    observe: Callable[[Simulation], dict[str, Any]]
    judge: Callable[[Run], list[Measure]]
    chart: Callable[[Run], Chart]
    resolutions: tuple[dict[str, Any], ...]
    quick: int = 1

    def run(self, sim: Simulation, look: Callable[[float], None] = lambda share: None) -> Run:
        """Run a simulation to the end of its scene; look: called with the share that is done.

        Raises RuntimeError if it blows up.
        """
        scene = sim.scene
        times, seen = [sim.time], [self.observe(sim)]
        while sim.time < scene.duration * (1 - 1e-9):
            report = sim.advance(min(scene.frame, scene.duration - sim.time))
            if report.diverged:
                raise RuntimeError(
                    f"{scene.name}: blew up at t = {sim.time:g} s: cause {report.cause}, "
                    f"link {report.link}, particle {report.bad_particle}"
                )
            times.append(sim.time)
            seen.append(self.observe(sim))
            look(sim.time / scene.duration)
        return Run(sim, np.array(times), seen)


def read(name: str) -> NDArray[np.float64]:
    """Return a table as (rows, columns); its source is in the comments on top of the file."""
    with (resources.files("sph_gym.scenes") / "data" / name).open() as file:
        _, *rows = (line for line in file if not line.startswith("#"))
    return np.loadtxt(rows, delimiter=",", ndmin=2)
