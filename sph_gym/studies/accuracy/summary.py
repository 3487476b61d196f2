"""All scenes at a glance: what was found against their own settings, and what each knob buys."""

import math
import textwrap
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.studies.accuracy import gains, luck
from sph_gym.studies.accuracy.axes import figure_of, readable, save, widen
from sph_gym.studies.accuracy.figures import words
from sph_gym.studies.accuracy.fronts import Worth
from sph_gym.studies.accuracy.plan import rungs
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.accuracy.policies import RULES, needs_schedule
from sph_gym.studies.accuracy.problems import Problem, problem
from sph_gym.studies.accuracy.settings import nominal

# Scenes that are drawn, those that tell most first; how many there may be, so that no row is half
# empty, and in how many columns.
TELLING = (
    "elliptical_drop", "taylor_green", "standing_wave", "couette", "colliding_patches", "dam_break",
)  # fmt: skip
LAYOUTS = {1: 1, 2: 2, 3: 3, 4: 2, 6: 3}
# Inches: a page that is shown 890 pixels wide has letters of 9 points if ours have WIDTH of them.
WIDTH, TOP, PANEL, ROW, FOOT = 10.0, 0.95, 2.55, 0.27, 2.0
SIZE = 10.0
FRONT, GUIDE = "#D55E00", "#9A9A9A"
# Gains that are shown as numbers.
NOTICED = 1.05


def _any(value: str) -> bool:
    return True


# Knob, its label, and which of its values count.
COLUMNS: tuple[tuple[str, str, Callable[[str], bool]], ...] = (
    ("width", "h / dx", _any), ("step", "dt", _any), ("sound", "stiff-\nness", _any),
    ("kernel", "kernel", _any), ("density", "density", _any), ("dtype", "preci-\nsion", _any),
    ("integrator", "inte-\ngrator", _any), ("xsph", "XSPH", _any),
    ("controller", "CFL\nrules", RULES.__contains__), ("controller", "agents", needs_schedule),
)  # fmt: skip


def draw(by_scene: Mapping[str, Sequence[Point]], path: Path) -> Path:
    """Some scenes' own settings against their fronts, and of all what each knob buys by itself."""
    known = [name for name in (*TELLING, *by_scene) if name in by_scene]
    chosen = list(dict.fromkeys(known))[: max(LAYOUTS)]
    chosen = chosen[: max(n for n in LAYOUTS if n <= len(chosen))]
    panels = PANEL * math.ceil(len(chosen) / LAYOUTS[len(chosen)])
    table = ROW * len(by_scene) + FOOT
    figure = figure_of(WIDTH, TOP + panels + table)
    upper, lower = figure.subfigures(2, 1, height_ratios=(TOP + panels, table))
    _draw_panels(upper, {name: by_scene[name] for name in chosen}, TOP + panels)
    _draw_gains(lower, by_scene, table)
    return save(figure, path)


# --- Error over time ------------------------------------------------------------------------


def _draw_panels(figure: Any, chosen: Mapping[str, Sequence[Point]], height: float) -> None:
    n_columns = LAYOUTS[len(chosen)]
    grid = figure.subplots(math.ceil(len(chosen) / n_columns), n_columns, squeeze=False)
    figure.subplots_adjust(
        left=0.085,
        right=0.985,
        top=1 - 0.75 / height,
        bottom=0.68 / height,
        wspace=0.26,
        hspace=0.36,
    )
    for axes, (name, points) in zip(grid.flat, chosen.items(), strict=True):
        _draw_small(axes, name, points)
    figure.supxlabel(
        "processor seconds per simulated second, one thread",
        fontsize=SIZE + 0.5,
        y=0.08 / height,
    )
    figure.supylabel("error [%]", fontsize=SIZE + 0.5, x=0.008)
    handles, labels = grid.flat[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, frameon=False, ncols=3, fontsize=SIZE + 0.5, loc="upper center",
        bbox_to_anchor=(0.52, 1.0),
    )  # fmt: skip


def _draw_small(axes: Any, name: str, points: Sequence[Point]) -> None:
    ladder = sorted((p for p in rungs(points) if p.good), key=lambda p: p.dx)
    best = luck.front(points, "cost")
    axes.plot(
        [p.cost for p in best], [100 * p.error for p in best], "s-", color=FRONT, markersize=5.5,
        linewidth=3.6, label="front: the best found, luck apart", zorder=3,
    )  # fmt: skip
    axes.plot(
        [p.cost for p in ladder], [100 * p.error for p in ladder], "o-", color="black",
        markersize=5, linewidth=1.4, markerfacecolor="white", zorder=4,
        label="the scene's own settings, by dx",
    )  # fmt: skip
    found, chance = luck.headline(points, "cost"), luck.chance(points)
    sign = "> " if found.bound else ""
    gain = f"{sign}{found.gain:.2g} times faster" if math.isfinite(found.gain) else "no gain"
    axes.set_title(f"{name.replace('_', ' ')}: {chance or gain}", fontsize=SIZE, pad=4)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(0.1)
    widen(axes)
    if not chance:
        _leave_room(axes)
        _guides(axes)
    readable(axes)
    axes.tick_params(labelsize=SIZE)
    axes.text(
        0.03, 0.04, _label(problem(name), best), transform=axes.transAxes, fontsize=SIZE - 0.3,
        color="#A34700", va="bottom", linespacing=1.05, zorder=6,
    )  # fmt: skip


def _leave_room(axes: Any) -> None:
    """Below the curves, for what the front sets, and to their right, for the slopes."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    axes.set_xlim(left, right * (right / left) ** 0.12)
    axes.set_ylim(low * (low / high) ** 0.2, high)


def _guides(axes: Any) -> None:
    """Slopes of first and second order in dx, where the cost goes as dx^-3, named at their ends."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    begin, end = (left * (right / left) ** share for share in (0.62, 0.9))
    start = low * (high / low) ** 0.93
    label = "slopes of order 1 and 2 in dx"
    for order in (1, 2):
        last = start * (end / begin) ** (-order / 3)
        axes.plot([begin, end], [start, last], "-", color=GUIDE, linewidth=1.0, label=label)
        axes.annotate(
            str(order), (end, last), xytext=(3, 0), textcoords="offset points", fontsize=SIZE,
            color="#555555", va="center",
        )  # fmt: skip
        label = "_"


def _label(scene: Problem, best: Sequence[Point]) -> str:
    """What most of a front sets otherwise than the scene does."""
    if not best:
        return ""
    line, _ = Counter(point.setting.line for point in best).most_common(1)[0]
    changes = words(line.differences(nominal(scene)))
    return textwrap.fill("front: " + (", ".join(changes) or "its own settings"), 30)


# --- What each knob buys --------------------------------------------------------------------


def _draw_gains(figure: Any, by_scene: Mapping[str, Sequence[Point]], height: float) -> None:
    """A table of numbers on shades: the best value of each knob alone, at equal error."""
    axes = figure.subplots()
    figure.subplots_adjust(left=0.2, right=0.985, top=1 - 1.0 / height, bottom=0.85 / height)
    found = [
        [_best(points, knob, among) for knob, _, among in COLUMNS] for points in by_scene.values()
    ]
    table = np.array([[worth.gain for worth in row] for row in found])
    shades = np.log2(np.clip(np.nan_to_num(table, nan=1.0), 1.0, 8.0))
    axes.imshow(shades, cmap="Greys", vmin=0.0, vmax=4.2, aspect="auto")
    for (row, column), gain in np.ndenumerate(table):
        text = "-" if math.isnan(gain) else _short(gain, found[row][column].bound)
        dark = shades[row, column] > 2.2
        axes.text(
            column, row, text, ha="center", va="center", fontsize=SIZE + 0.5,
            color="white" if dark else "black",
        )  # fmt: skip
    names = [name.replace("_", " ") + _star(problem(name)) for name in by_scene]
    axes.set_yticks(range(len(names)), names, fontsize=SIZE + 0.5)
    labels = [label for _, label, _ in COLUMNS]
    axes.set_xticks(range(len(labels)), labels, fontsize=SIZE)
    axes.tick_params(length=0, top=False, labeltop=True, bottom=False, labelbottom=False)
    figure.text(
        0.5, 1 - 0.3 / height, "How many times faster at equal error, by one knob alone",
        fontsize=SIZE + 1.5, ha="center",
    )  # fmt: skip
    figure.text(
        0.02, 0.12 / height,
        "·  none helps     -  not turned, not at two resolutions, or it makes mush of the fluid    "
        " *  partly chance\n"
        ">, <  at least, at most: its errors lie outside of what the scene's own settings have",
        fontsize=SIZE, color="#333333", linespacing=1.4,
    )  # fmt: skip


def _short(gain: float, bound: str) -> str:
    """As much of a number as can be believed of a few runs."""
    return "·" if gain < NOTICED else f"{bound} {gain:.2g}".strip()


def _star(scene: Problem) -> str:
    return "" if scene.order is not None and not scene.erratic else " *"


def _best(points: Sequence[Point], knob: str, among: Callable[[str], bool]) -> Worth:
    """The largest gain by a knob; NaN where it wasn't turned."""
    found = gains.best(points, knob, "cost", among)
    return Worth(math.nan) if found is None else Worth(found.gain, found.bound)
