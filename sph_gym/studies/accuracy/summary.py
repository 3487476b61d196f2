"""All scenes at a glance: what was found against their own settings, and what each knob buys."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.studies.accuracy import gains, luck
from sph_gym.studies.accuracy.axes import figure_of, readable, save, widen
from sph_gym.studies.accuracy.figures import STYLES
from sph_gym.studies.accuracy.plan import rungs
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.accuracy.problems import Problem, problem

FRONT = "#D55E00"
# Gains that are shown as numbers.
NOTICED, MOST = 1.05, 8.0


def draw(by_scene: Mapping[str, Sequence[Point]], path: Path) -> Path:
    """Every scene's own settings against its front, and what each knob buys by itself."""
    figure = figure_of(15, 8.4)
    left, right = figure.subfigures(1, 2, width_ratios=(1.25, 1))
    _draw_multiples(left, by_scene)
    _draw_gains(right, by_scene)
    return save(figure, path)


def _draw_multiples(figure: Any, by_scene: Mapping[str, Sequence[Point]]) -> None:
    n_columns = min(4, max(len(by_scene), 1))
    n_rows = -(-len(by_scene) // n_columns)
    grid = figure.subplots(n_rows, n_columns, squeeze=False)
    figure.subplots_adjust(left=0.09, right=0.985, top=0.86, bottom=0.1, wspace=0.32, hspace=0.62)
    figure.supxlabel(
        "processor seconds of the whole run, one thread, corrected by a benchmark", fontsize=9.5
    )
    figure.supylabel("error [%]", fontsize=9.5)
    for axes in grid.flat[len(by_scene) :]:
        axes.set_visible(False)
    for axes, (name, points) in zip(grid.flat, by_scene.items(), strict=False):
        _draw_small(axes, name, points)
    figure.suptitle(
        "Error over time\n"
        "black: the scene's own settings at several resolutions; orange: the best that was found",
        fontsize=10.5, y=0.975,
    )  # fmt: skip


def _draw_small(axes: Any, name: str, points: Sequence[Point]) -> None:
    ladder = sorted((p for p in rungs(points) if p.good), key=lambda p: p.dx)
    best = luck.front(points, "time")
    for runs, style, colour, size in ((ladder, "o-", "black", 3.5), (best, "s--", FRONT, 3.0)):
        axes.plot(
            [p.time for p in runs], [100 * p.error for p in runs], style, color=colour,
            markersize=size, linewidth=1.3,
        )  # fmt: skip
    gain = gains.headline(points, luck.sober(points), "time")
    bold = f"{gain:.1f} times at equal error" if math.isfinite(gain) else ""
    bold = bold if best else "errors within scatter"
    axes.set_title(f"{name.replace('_', ' ')}\n{bold}", fontsize=8.5, pad=3)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(0.1)
    widen(axes)
    readable(axes)
    axes.tick_params(labelsize=7.5)


def _draw_gains(figure: Any, by_scene: Mapping[str, Sequence[Point]]) -> None:
    """A table of numbers on shades: the best value of each knob alone, at equal error."""
    axes = figure.subplots()
    figure.subplots_adjust(left=0.24, right=0.97, top=0.86, bottom=0.2)
    table = np.array([[_best(points, knob) for knob in STYLES] for points in by_scene.values()])
    shades = np.log2(np.clip(np.nan_to_num(table, nan=1.0), 1.0, 8.0))
    axes.imshow(shades, cmap="Blues", vmin=0.0, vmax=3.6, aspect="auto")
    for (row, column), gain in np.ndenumerate(table):
        text = "" if math.isnan(gain) else _short(gain)
        dark = shades[row, column] > 2.2
        axes.text(
            column, row, text, ha="center", va="center", fontsize=9,
            color="white" if dark else "black",
        )  # fmt: skip
    names = [name.replace("_", " ") + _star(problem(name)) for name in by_scene]
    axes.set_yticks(range(len(names)), names, fontsize=9)
    labels = [label for _, _, label in STYLES.values()]
    axes.set_xticks(range(len(labels)), labels, fontsize=9, rotation=35, ha="right")
    axes.tick_params(length=0)
    figure.suptitle(
        "How many times faster a run gets at equal error\n"
        "by the best value of one knob alone (·: none helps)", fontsize=10.5, y=0.975,
    )  # fmt: skip
    figure.text(
        0.02, 0.03, "* its error doesn't fall steadily with dx: numbers leave room for chance",
        fontsize=8.5, color="#333333",
    )  # fmt: skip


def _short(gain: float) -> str:
    """As much of a number as can be believed of a single run."""
    if gain < NOTICED:
        return "·"
    return f"{gain:.2g}" if gain < MOST else f"> {MOST:g}"


def _star(scene: Problem) -> str:
    return "" if scene.order is not None else " *"


def _best(points: Sequence[Point], knob: str) -> float:
    """The largest gain by a knob; NaN where it wasn't turned."""
    found = gains.best(points, knob, "cost")
    return math.nan if found is None else found.gain
