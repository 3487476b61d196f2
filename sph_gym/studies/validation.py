"""The physics against what should happen: every scene that has a reference, at its resolutions.

A finished run is kept as JSON in the study's folder, under a hash of the sources, of what compiles
and runs them, and of the run's arguments. An interrupted study goes on where it was; nothing stale
is taken.
"""

import hashlib
import json
import math
import sys
import time
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import sph_gym
from sph_gym import scenes
from sph_gym.scenes.shared.reference import Chart, Curve, Measure
from sph_gym.solver.checks import known
from sph_gym.solver.jit import source_hash
from sph_gym.solver.simulation import Simulation
from sph_gym.studies import gallery, store
from sph_gym.studies.table import Row

FOLDER = Path("runs/studies")


class Result(NamedTuple):
    """A finished run: of which scene with which arguments, what was found, how long it took.

    seconds: wall clock without compilation; work: particle-steps; chart: with its reference.
    """

    scene: str
    arguments: dict[str, Any]
    dx: float
    measures: list[Measure]
    chart: Chart
    seconds: float
    work: int

    @property
    def case(self) -> str:
        """Scene and arguments as text."""
        return _case(self.scene, self.arguments)


def _case(scene: str, arguments: dict[str, Any]) -> str:
    return ", ".join([scene, *(f"{name} = {_short(value)}" for name, value in arguments.items())])


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def with_reference() -> list[str]:
    """The scenes that are compared with something."""
    return [name for name in scenes.names() if scenes.reference(name) is not None]


def measure(
    quick: bool,
    folder: Path = FOLDER,
    chosen: Sequence[str] | None = None,
    again: bool = False,
) -> Iterator[Row]:
    """Rows of every scene; quick: the coarsest resolutions only.

    chosen: names of scenes, by default all that have a reference; again: don't take what an
    earlier run of the study has found. Raises ValueError for a scene without a reference.
    """
    names = with_reference()
    for name in chosen or ():
        known("scenes", name, names)
    for name in chosen or names:
        reference = scenes.reference(name)
        assert reference is not None
        resolutions = reference.resolutions[: reference.quick if quick else None]
        results = []
        for arguments in resolutions:
            try:
                result = run(name, arguments, folder, again)
            except RuntimeError as error:
                print(error, file=sys.stderr)
                yield Row("blow-ups", _case(name, arguments), math.nan, "", 0.0)
                continue
            results.append(result)
            yield from rows(result)
        yield from orders(results)
        if results:
            picture = f"{name}_quick.png" if quick else f"{name}.png"
            gallery.draw(name, reference, results, folder / "validation" / picture)


def rows(result: Result) -> Iterator[Row]:
    """What was found in one run."""
    for found in result.measures:
        yield Row(found.quantity, result.case, found.value, found.unit, found.bound)
    yield Row("wall clock", result.case, result.seconds, "s")


def orders(results: Sequence[Result]) -> Iterator[Row]:
    """The order of convergence of the first measure between runs that differ in dx alone."""
    for coarse, fine in pairwise(results):
        others = [
            {name: value for name, value in result.arguments.items() if name != "dx"}
            for result in (coarse, fine)
        ]
        errors = [abs(result.measures[0].value) for result in (coarse, fine)]
        if others[0] != others[1] or not min(errors) > 0 or coarse.dx == fine.dx:
            continue
        order = math.log(errors[0] / errors[1]) / math.log(coarse.dx / fine.dx)
        case = f"{fine.scene}, dx = {_short(coarse.dx)} to {_short(fine.dx)}"
        yield Row(f"order of convergence, {fine.measures[0].quantity}", case, order, "")


def run(name: str, arguments: dict[str, Any], folder: Path, again: bool = False) -> Result:
    """One run, from the folder if it is there; with a progress bar."""
    path = folder / "validation" / f"{name}-{_key(name, arguments)}.json"
    stored = None if again else _read(path)
    if stored is not None:
        return stored
    reference = scenes.reference(name)
    assert reference is not None
    sim = Simulation(scenes.make(name, **arguments))
    _compile(sim)
    with _bar(f"{name} {sim.n_fluid} particles") as bar:
        began, steps = time.perf_counter(), _Steps(sim)
        ended = reference.run(sim, lambda share: bar.update(round(100 * share) - bar.n))
        seconds = time.perf_counter() - began
    result = Result(
        name, arguments, sim.scene.dx, reference.judge(ended), reference.chart(ended), seconds,
        steps.n * sim.n_particles,
    )  # fmt: skip
    _write(result, path)
    return result


class _Steps:
    """Counts the substeps of a simulation from now on."""

    def __init__(self, sim: Simulation) -> None:
        self.n, advance = 0, sim.advance

        def counted(seconds: float) -> Any:
            report = advance(seconds)
            self.n += report.n_substeps
            return report

        sim.advance = counted  # type: ignore[method-assign]


def _compile(sim: Simulation) -> None:
    """So that the first run doesn't pay for all others."""
    home = sim.snapshot()
    sim.advance(sim.controls.dt)
    sim.evaluate()
    sim.diagnostics()
    sim.restore(home)


def _bar(title: str) -> Any:
    try:
        from tqdm import tqdm
    except ImportError:
        raise ImportError('studies need more: pip install "sph_gym[studies]"') from None
    return tqdm(total=100, desc=title, unit="%", leave=False, file=sys.stderr, mininterval=0.5)


# --- On disk --------------------------------------------------------------------------------


@cache
def _sources() -> bytes:
    """Of the solver, the scenes and this file: all of ours that a result depends on."""
    root = Path(sph_gym.__file__).parent
    paths = sorted(
        [
            *root.glob("solver/*.py"),
            *root.glob("scenes/*.py"),
            *root.glob("scenes/data/*"),
            Path(__file__).resolve(),
        ]
    )
    return b"".join(path.read_bytes() for path in paths)


def _key(name: str, arguments: dict[str, Any]) -> str:
    # source_hash: of the compiler, the interpreter and the processor too
    digest = hashlib.sha256(f"{source_hash()} {np.__version__}".encode() + _sources())
    digest.update(json.dumps([name, arguments], sort_keys=True).encode())
    return digest.hexdigest()[:16]


def _write(result: Result, path: Path) -> None:
    chart = result.chart
    curves = [
        [curve.label, np.asarray(curve.x).tolist(), np.asarray(curve.y).tolist(), curve.reference]
        for curve in chart.curves
    ]
    measures = [
        [found.quantity, float(found.value), found.unit, found.bound] for found in result.measures
    ]
    fields = result._replace(measures=measures, chart=[chart.x_label, chart.y_label, curves])  # type: ignore[arg-type]
    store.write(path, {"result": fields._asdict()})


def _read(path: Path) -> Result | None:
    """A finished run; None if there is none or it is damaged."""
    stored = store.read(path)
    if stored is None:
        return None
    fields = stored["result"]
    x_label, y_label, curves = fields.pop("chart")
    measures = [Measure(*found) for found in fields.pop("measures")]
    chart = Chart(x_label, y_label, [Curve(*curve) for curve in curves])
    return Result(**fields, measures=measures, chart=chart)
