"""The physics against references: every scene that has one, at its resolutions.

A finished run is kept in the study's folder, under a hash of everything that it depends on. An
interrupted study goes on where it was; nothing stale is taken.
"""

import math
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym import scenes
from sph_gym.extras import progress_bar
from sph_gym.recommend.runs import Meter, compile_ahead
from sph_gym.scenes.shared.reference import Chart, Curve, Measure
from sph_gym.solver.simulation import Simulation
from sph_gym.studies import gallery
from sph_gym.studies.results import Results
from sph_gym.studies.table import Row


class Validated(NamedTuple):
    """A finished run: its scene and arguments, what was found, how long it took.

    warnings: kind, value and limit of the simulation's at the end; seconds: wall clock without
    compilation; work: particle-steps; chart: with its reference.
    """

    scene: str
    arguments: dict[str, Any]
    dx: float
    measures: list[Measure]
    chart: Chart
    seconds: float
    work: int
    warnings: Sequence[tuple[str, float, float]] = ()

    @classmethod
    def from_json(cls, stored: dict[str, Any]) -> "Validated":
        """Return the run that JSON holds in plain lists."""
        run = cls(**stored)
        x_label, y_label, curves = run.chart
        chart = Chart(x_label, y_label, [Curve(*curve) for curve in curves])
        return run._replace(chart=chart, measures=[Measure(*each) for each in run.measures])


def _case(scene: str, arguments: dict[str, Any]) -> str:
    return ", ".join([scene, *(f"{name} = {_short(value)}" for name, value in arguments.items())])


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def names() -> list[str]:
    """Return the names of the scenes that are compared with something."""
    return [name for name in scenes.names() if scenes.reference(name) is not None]


def measure(
    quick: bool,
    folder: Path,
    chosen: Sequence[str] | None = None,
    again: bool = False,
) -> Iterator[Row]:
    """Yield rows of every scene; quick: the coarsest resolutions only.

    chosen: names of scenes, by default all that have a reference; again: don't take what an
    earlier run of the study has found.
    """
    for name in chosen or names():
        reference = scenes.reference(name)
        assert reference is not None
        results = []
        for arguments in reference.resolutions[: reference.quick if quick else None]:
            try:
                results.append(run(name, arguments, folder, again))
            except RuntimeError as error:
                print(error, file=sys.stderr)
                yield Row("blow-ups", _case(name, arguments), math.nan, "", 0.0)
                continue
            yield from rows(results[-1])
        yield from orders(results)
        if results:
            picture = f"{name}_quick.png" if quick else f"{name}.png"
            gallery.draw(name, reference, results, folder / "validation" / picture)


def rows(result: Validated) -> Iterator[Row]:
    """Yield the measures of one run, its warnings, which fail, and its time."""
    case = _case(result.scene, result.arguments)
    for found in result.measures:
        yield Row(found.quantity, case, found.value, found.unit, found.bound)
    for kind, value, limit in result.warnings:
        yield Row(f"warning: {kind}", case, value, "", limit)
    yield Row("wall clock", case, result.seconds, "s")


def orders(results: Sequence[Validated]) -> Iterator[Row]:
    """Yield the convergence order of the first measure between runs that differ in dx alone."""
    for coarse, fine in pairwise(results):
        errors = [abs(result.measures[0].value) for result in (coarse, fine)]
        comparable = {**coarse.arguments, "dx": 0} == {**fine.arguments, "dx": 0}
        if not comparable or not min(errors) > 0 or coarse.dx == fine.dx:
            continue
        order = math.log(errors[0] / errors[1]) / math.log(coarse.dx / fine.dx)
        case = f"{fine.scene}, dx = {_short(coarse.dx)} to {_short(fine.dx)}"
        yield Row(f"order of convergence, {fine.measures[0].quantity}", case, order, "")


# --- Running --------------------------------------------------------------------------------


def run(name: str, arguments: dict[str, Any], folder: Path, again: bool = False) -> Validated:
    """Return one run, from the folder if it is there and not asked for `again`."""
    key, compute = run_key(name, arguments), lambda: _run(name, arguments)._asdict()
    return results(folder).get(key, compute, Validated.from_json, again)


def results(folder: Path) -> Results:
    """Return the store of runs below the folder of all studies."""
    return Results(folder / "validation", "studies/validation.py", common=("solver", "scenes"))


def run_key(name: str, arguments: dict[str, Any]) -> list[Any]:
    """Return what a run depends on besides sources, compiler and processor."""
    return [name, arguments, np.__version__]


def _run(name: str, arguments: dict[str, Any]) -> Validated:
    reference = scenes.reference(name)
    assert reference is not None
    sim = Simulation(scenes.make(name, **arguments))
    compile_ahead(sim)
    meter = Meter(sim)
    with progress_bar(100, f"{name} {sim.n_fluid} particles", "%") as bar:
        began = time.perf_counter()
        ended = reference.run(sim, lambda share: bar.update(round(100 * share) - bar.n))
        seconds = time.perf_counter() - began
    found, chart = reference.judge(ended), reference.chart(ended)
    work = meter.substeps * sim.n_particles
    told = [(warning.kind, warning.value, warning.limit) for warning in sim.warnings]
    return Validated(name, arguments, sim.scene.dx, found, chart, seconds, work, told)
