"""All scenes at a glance: what was found against their own settings, and what each knob buys."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.studies.accuracy import gains, luck
from sph_gym.studies.accuracy.axes import figure_of, readable, save, widen
from sph_gym.studies.accuracy.figures import STYLES, slopes
from sph_gym.studies.accuracy.fronts import Worth
from sph_gym.studies.accuracy.plan import rungs
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.accuracy.problems import Problem, problem

FRONT = "#D55E00"
# Gains that are shown as numbers.
NOTICED = 1.05


def draw(by_scene: Mapping[str, Sequence[Point]], path: Path) -> Path:
    """Every scene's own settings against its front, and what each knob buys by itself."""
    figure = figure_of(17, 10)
    left, right = figure.subfigures(1, 2, width_ratios=(1.25, 1))
    _draw_multiples(left, by_scene)
    _draw_gains(right, by_scene)
    return save(figure, path)


def _draw_multiples(figure: Any, by_scene: Mapping[str, Sequence[Point]]) -> None:
    n_columns = min(4, max(len(by_scene), 1))
    n_rows = -(-len(by_scene) // n_columns)
    grid = figure.subplots(n_rows, n_columns, squeeze=False)
    figure.subplots_adjust(left=0.075, right=0.985, top=0.86, bottom=0.08, wspace=0.55, hspace=0.6)
    figure.supxlabel(
        "seconds per simulated second, one pinned thread (corrected by a benchmark)",
        fontsize=9.5,
    )
    for axes in grid.flat[len(by_scene) :]:
        axes.set_visible(False)
    for axes, (name, points) in zip(grid.flat, by_scene.items(), strict=False):
        _draw_small(axes, name, points)
    figure.suptitle(
        "Error over time\n"
        "black: the scene's own settings at several resolutions; orange: the best that was found\n"
        "grey: slopes of first (dotted) and second order (dashed) in dx",
        fontsize=10.5, y=0.975,
    )  # fmt: skip


def _draw_small(axes: Any, name: str, points: Sequence[Point]) -> None:
    ladder = sorted((p for p in rungs(points) if p.good), key=lambda p: p.dx)
    best = luck.front(points, "cost")
    for runs, style, colour, size in ((ladder, "o-", "black", 3.5), (best, "s--", FRONT, 3.0)):
        axes.plot(
            [p.cost for p in runs], [100 * p.error for p in runs], style, color=colour,
            markersize=size, linewidth=1.3,
        )  # fmt: skip
    scene, found = problem(name), luck.headline(points, "cost")
    sign = "> " if found.bound else ""
    bold = f"{sign}{found.gain:.2g} times at equal error" if math.isfinite(found.gain) else ""
    bold = luck.chance(points) or bold
    axes.set_title(f"{name.replace('_', ' ')}\n{bold}", fontsize=8.5, pad=3)
    label = f"{textwrap.fill(scene.measure, 26)}\n[% {scene.of}]"
    axes.set_ylabel(label, fontsize=6.3, labelpad=1)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(0.1)
    widen(axes)
    if points[0].good and scene.order is not None:
        slopes(axes, points[0], "cost")
    readable(axes)
    axes.tick_params(labelsize=7.5)


def _draw_gains(figure: Any, by_scene: Mapping[str, Sequence[Point]]) -> None:
    """A table of numbers on shades: the best value of each knob alone, at equal error."""
    axes = figure.subplots()
    figure.subplots_adjust(left=0.24, right=0.97, top=0.86, bottom=0.2)
    found = [[_best(points, knob) for knob in STYLES] for points in by_scene.values()]
    table = np.array([[worth.gain for worth in row] for row in found])
    shades = np.log2(np.clip(np.nan_to_num(table, nan=1.0), 1.0, 8.0))
    axes.imshow(shades, cmap="Blues", vmin=0.0, vmax=3.6, aspect="auto")
    for (row, column), gain in np.ndenumerate(table):
        text = "-" if math.isnan(gain) else _short(gain, found[row][column].bound)
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
        0.02, 0.03,
        "* its error doesn't fall steadily with dx, or is partly chance: numbers leave room\n"
        "-  not turned, or no value went well at two resolutions; >, <: at least, at most, since "
        "its errors\n    are outside of what the scene's own settings were measured to have",
        fontsize=8.5, color="#333333",
    )  # fmt: skip


def _short(gain: float, bound: str) -> str:
    """As much of a number as can be believed of a single run."""
    return "·" if gain < NOTICED else f"{bound} {gain:.2g}".strip()


def _star(scene: Problem) -> str:
    return "" if scene.order is not None and not scene.erratic else " *"


def _best(points: Sequence[Point], knob: str) -> Worth:
    """The largest gain by a knob; NaN where it wasn't turned."""
    found = gains.best(points, knob, "cost")
    return Worth(math.nan) if found is None else Worth(found.gain, found.bound)
