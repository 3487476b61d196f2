"""Pictures of the study: a work-precision diagram of every scene, and all scenes at a glance."""

import math
import textwrap
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.recommend.settings import RULES, TITLES, is_agent, nominal, write_changes
from sph_gym.scenes.shared.refinement import Refinement, refinement
from sph_gym.studies.accuracy import analysis
from sph_gym.studies.accuracy.analysis import TIME
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.picture import new_figure, save

# Colours of M. Okabe and K. Ito, which colour-blind eyes tell apart; in grey the markers do.
STYLES = {
    "width": ("#0072B2", "s"), "step": ("#D55E00", "^"), "sound": ("#009E73", "D"),
    "kernel": ("#CC79A7", "P"), "density": ("#E69F00", "X"), "dtype": ("#56B4E9", "v"),
    "integrator": ("#7F3C8D", "<"), "xsph": ("#8C6D31", ">"), "controller": ("#B8A300", "h"),
}  # fmt: skip
FRONT, GUIDE = "#FFC20A", "#8A8A8A"
# Costs of the two panels of a scene, and their labels.
PAIRS = "interactions"
PANELS = {
    TIME: "seconds per simulated second, one pinned thread",
    PAIRS: "pair interactions per simulated second",
}
# Share of the size of a front that points with numbers are apart at least.
APART = 0.14
# Ratio of the ends of an error axis, at least: errors that hardly differ look so.
LEAST_RANGE = 8.0
LUCK = (
    "Luck apart: on the front are settings that were run up to the finest resolution, and an error "
    "counts at least as much as those of finer runs of the same settings."
)
NO_FRONT = "No front: errors are within their scatter, or partly chance."
CLOCK = (
    "Times are processor seconds, corrected for the machine's momentary speed by a benchmark "
    "beside each run."
)
THINKING = "* What the agent itself takes to think isn't counted."
# Scenes of the summary, those that tell most first, and columns for so many of them.
TELLING = (
    "elliptical_drop", "taylor_green", "standing_wave", "couette", "colliding_patches", "dam_break",
)  # fmt: skip
N_COLUMNS = {1: 1, 2: 2, 3: 3, 4: 2, 6: 3}
# Gains that are shown as numbers.
NOTICED = 1.05
# Knob, title and values of the columns of the summary's table.
GAINS: tuple[tuple[str, str, Callable[[str], bool]], ...] = (
    *((knob, title, lambda value: True) for knob, title in (
        ("width", "h / dx"), ("step", "dt"), ("sound", "stiff-\nness"), ("kernel", "kernel"),
        ("density", "density"), ("dtype", "preci-\nsion"), ("integrator", "inte-\ngrator"),
        ("xsph", "XSPH"),
    )),
    ("controller", "CFL\nrules", RULES.__contains__), ("controller", "agents", is_agent),
)  # fmt: skip


# --- Diagrams -------------------------------------------------------------------------------


def _plot(axes: Any, points: Sequence[Point], cost: str, style: str, **look: Any) -> None:
    axes.plot([_cost(p, cost) for p in points], [100 * p.error for p in points], style, **look)


def _cost(point: Point, cost: str) -> float:
    """Return a cost per simulated second."""
    return point.interactions / point.seconds if cost == PAIRS else point.cost


def _draw_series(axes: Any, points: Sequence[Point], cost: str) -> list[Point]:
    """Draw the front and the nominal settings by resolution; return the latter, fine first."""
    own = sorted((p for p in analysis.nominal_series(points) if p.good), key=lambda p: p.dx)
    _plot(
        axes, analysis.front(points, cost), cost, "-", color=FRONT, linewidth=7, alpha=0.6,
        solid_capstyle="round", zorder=1, label="Pareto front, luck apart",
    )  # fmt: skip
    label = "the scene's own settings, by dx"
    _plot(axes, own, cost, "o-", color="black", markersize=5, linewidth=1.5, label=label, zorder=4)
    axes.set(xscale="log", yscale="log")
    axes.margins(0.1)
    low, high = axes.get_ylim()
    room = math.sqrt(max(LEAST_RANGE / (high / low), 1.0))
    axes.set_ylim(low / room, high * room)
    return own


def _guide(axes: Any) -> None:
    """Draw slopes of first and second order in dx, where the cost goes as dx^-3, at the right."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    axes.set_xlim(left, right * (right / left) ** 0.12)
    begin, end = (left * (right / left) ** share for share in (0.72, 1.0))
    start = low * (high / low) ** 0.95
    for order, label in ((1, "slopes of order 1 and 2 in dx"), (2, "_")):
        last = start * (end / begin) ** (-order / 3)
        axes.plot([begin, end], [start, last], "-", color=GUIDE, linewidth=1.0, label=label)
        axes.annotate(
            str(order), (end, last), xytext=(3, 0), textcoords="offset points", va="center"
        )


def set_ticks(axes: Any) -> None:
    """Set plain round numbers on both logarithmic axes, and a light grid."""
    from matplotlib import ticker

    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        decades = math.log10(high / low)
        subs = (1.0,) if decades > 3 else (1.0, 3.0) if decades > 1.7 else (1.0, 2.0, 5.0)
        locator: Any = ticker.LogLocator(subs=subs, numticks=12)
        if decades < 0.8:
            locator = ticker.MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10])
        ticks = [tick for tick in locator.tick_values(low, high) if low <= tick <= high]
        axis.set_major_locator(ticker.FixedLocator(ticks))
        axis.set_minor_locator(ticker.NullLocator())
        power = ticker.LogFormatterSciNotation(minor_thresholds=(math.inf, math.inf))
        axis.set_major_formatter(ticker.StrMethodFormatter("{x:g}") if high < 1e4 else power)
    axes.grid(alpha=0.25)


# --- One scene ------------------------------------------------------------------------------


def draw_scene(case: Refinement, points: Sequence[Point], path: Path) -> Path:
    """Draw error over time and over work, with the front numbered and explained below."""
    best = _spread_out(analysis.front(points, TIME))
    text = _explanation(case, points, best)
    heights = 6.4, 0.2 * (text.count("\n") + 2)
    figure = new_figure(12.0, sum(heights))
    upper, lower = figure.subfigures(2, 1, height_ratios=heights)
    every = upper.subplots(1, 2, sharey=True)
    for axes, (cost, label) in zip(every, PANELS.items(), strict=True):
        _draw_panel(axes, case, points, cost)
        axes.set_xlabel(label)
    for k, point in enumerate(best, 1):
        every[0].annotate(
            str(k), (point.cost, 100 * point.error), xytext=(-11, -11), zorder=8,
            textcoords="offset points", fontsize=8.5, fontweight="bold", ha="center", va="center",
            bbox={"boxstyle": "circle,pad=0.15", "fc": "white", "ec": "black", "lw": 0.7},
        )  # fmt: skip
    every[0].set_ylabel(f"error [% {case.of}]")
    handles, labels = every[0].get_legend_handles_labels()
    upper.legend(handles, labels, frameon=False, ncols=5, fontsize=9, loc="outside lower center")
    title = f"{case.scene.replace('_', ' ')}: {case.measure}\n{_conclusion(points)}"
    upper.suptitle(title, fontsize=12)
    lower.text(0.05, 0.97, text, fontsize=9, va="top", linespacing=1.4)
    return save(figure, path)


def _draw_panel(axes: Any, case: Refinement, points: Sequence[Point], cost: str) -> None:
    start = points[0]
    others = [
        p for p in points
        if p.good and p.knob not in ("nominal", "resolution")
        and (p.knob == analysis.COMBINED or p.setting.across != start.setting.across)
    ]  # fmt: skip
    _plot(axes, others, cost, ".", color="#999999", markersize=6, label="other runs")
    own = _draw_series(axes, points, cost)
    for knob in (name for name in analysis.knobs(points) if name in STYLES):
        _draw_knob(axes, points, knob, cost)
    if start.good:
        _plot(
            axes, [start], cost, "*", color="black", markersize=17, markeredgecolor="white",
            label="nominal", zorder=6,
        )  # fmt: skip
        if case.order is not None:
            _guide(axes)
    for end, place in ((own[0], (7, 7)), (own[-1], (-2, -15))) if len(own) > 1 else ():
        axes.annotate(
            f"{case.length} / {end.setting.across}", (_cost(end, cost), 100 * end.error),
            xytext=place, textcoords="offset points", fontsize=8.5, zorder=7,
        )  # fmt: skip
    set_ticks(axes)


def _draw_knob(axes: Any, points: Sequence[Point], knob: str, cost: str) -> None:
    """Draw the values of a knob, numbers as a thin line through the nominal point."""
    start, (colour, marker) = points[0], STYLES[knob]
    across = start.setting.across
    turned = [p for p in points if p.knob == knob and p.good and p.setting.across == across]
    if knob in analysis.NUMBERS and start.good and turned:
        line = sorted([start, *turned], key=lambda p: getattr(p.setting, knob))
        _plot(axes, line, cost, "-", color=colour, linewidth=0.9, alpha=0.8, zorder=2)
    _plot(
        axes, turned, cost, marker, color=colour, markersize=6.5, markeredgecolor="white",
        markeredgewidth=0.6, label=TITLES[knob][0], zorder=3,
    )  # fmt: skip
    # agents are named along the lower edge, one above the other, where no runs are
    for k, point in enumerate(sorted(turned, key=lambda p: p.cost) if knob == "controller" else ()):
        name = point.setting.controller
        axes.annotate(
            name.replace("_", " ") + "*" * is_agent(name), (_cost(point, cost), 100 * point.error),
            xytext=(_cost(point, cost), 0.03 + 0.04 * k), textcoords=("data", "axes fraction"),
            fontsize=8, arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.5}, zorder=9,
        )  # fmt: skip


def _spread_out(best: Sequence[Point]) -> list[Point]:
    """Return some points of a front, its ends among them, none close to another."""
    if len(best) < 2:
        return list(best)
    places = np.log([[point.cost, point.error] for point in best])
    places = (places - places.min(axis=0)) / np.maximum(np.ptp(places, axis=0), 1e-9)
    chosen = [0]
    for k in range(1, len(best) - 1):
        if min(np.hypot(*(places[k] - places[j])) for j in (chosen[-1], -1)) > APART:
            chosen.append(k)
    return [best[k] for k in [*chosen, len(best) - 1]]


def _conclusion(points: Sequence[Point]) -> str:
    found = analysis.best_gain(points, TIME)
    if not math.isfinite(found.gain):
        reason = analysis.chance(points) or "errors blow up"
        return f"{reason}: no gain at equal error.".capitalize()
    least = "at least " if found.bound else ""
    return (
        f"At equal error the best combination is {least}{found.gain:.2g} times as fast as the "
        "scene's own settings (median over resolutions)."
    )


def _explanation(case: Refinement, points: Sequence[Point], best: Sequence[Point]) -> str:
    """Return what the numbered points are, how the error converges, and what times are."""
    lines = [
        "On the front at the left: error, processor time of the whole run, and what is set"
        if best else NO_FRONT
    ]  # fmt: skip
    for k, point in enumerate(best, 1):
        changes = point.setting.differences(nominal(case, point.setting.across))
        what = ", ".join([f"{case.length} / {point.setting.across}", *write_changes(changes)])
        lines.append(f"{k}  {100 * point.error:.2g} %, {point.time:.2g} s: {what}")
    agents = any(point.good and is_agent(point.setting.controller) for point in points)
    notes = [case.note, LUCK if best else "", CLOCK, THINKING if agents else ""]
    return "\n".join([*lines, textwrap.fill(" ".join(filter(None, notes)), 160)])


# --- All scenes -----------------------------------------------------------------------------


def draw_summary(points: Sequence[Point], path: Path) -> Path:
    """Draw own settings against fronts, and a table of the gain of each knob by itself."""
    by_scene = {name: list(own) for name, own in groupby(points, lambda point: point.scene)}
    chosen = list(dict.fromkeys(name for name in (*TELLING, *by_scene) if name in by_scene))
    chosen = chosen[: max(n for n in N_COLUMNS if n <= len(chosen))]
    n_columns = N_COLUMNS[len(chosen)]
    n_rows = math.ceil(len(chosen) / n_columns)
    heights = 0.8 + 2.6 * n_rows, 1.7 + 0.27 * len(by_scene)
    figure = new_figure(10.0, sum(heights))
    upper, lower = figure.subfigures(2, 1, height_ratios=heights)
    grid = upper.subplots(n_rows, n_columns, squeeze=False)
    for axes, name in zip(grid.flat, chosen, strict=True):
        _draw_small(axes, refinement(name), by_scene[name])
    upper.supxlabel("processor seconds per simulated second, one thread", fontsize=10.5)
    upper.supylabel("error [%]", fontsize=10.5)
    handles, labels = grid.flat[0].get_legend_handles_labels()
    upper.legend(handles, labels, frameon=False, ncols=3, loc="outside upper center")
    _draw_gains(lower, by_scene)
    return save(figure, path)


def _draw_small(axes: Any, case: Refinement, points: Sequence[Point]) -> None:
    _draw_series(axes, points, TIME)
    found, chance = analysis.best_gain(points, TIME), analysis.chance(points)
    sign = "> " if found.bound else ""
    gain = f"{sign}{found.gain:.2g} times faster" if math.isfinite(found.gain) else "no gain"
    axes.set_title(f"{case.scene.replace('_', ' ')}: {chance or gain}", fontsize=10)
    best = analysis.front(points, TIME)
    if best:
        low, high = axes.get_ylim()
        axes.set_ylim(low * (low / high) ** 0.2, high)
        _guide(axes)
        # of most points of the front
        [(series, _)] = Counter(point.setting.series for point in best).most_common(1)
        changes = write_changes(series.differences(nominal(case)))
        label = textwrap.fill("front: " + (", ".join(changes) or "its own settings"), 30)
        axes.text(0.03, 0.04, label, transform=axes.transAxes, fontsize=9.5, color="#7A5C00")
    set_ticks(axes)


def _draw_gains(figure: Any, by_scene: Mapping[str, Sequence[Point]]) -> None:
    """Draw a table of numbers on shades: the best value of each knob alone, at equal error."""
    axes = figure.subplots()
    none = analysis.Gain(math.nan)
    found = [
        [analysis.best_value(own, knob, TIME, among) or none for knob, _, among in GAINS]
        for own in by_scene.values()
    ]
    table = np.array([[gain.gain for gain in row] for row in found])
    shades = np.log2(np.clip(np.nan_to_num(table, nan=1.0), 1.0, 8.0))
    axes.imshow(shades, cmap="Greys", vmin=0.0, vmax=4.2, aspect="auto")
    for (row, column), gain in np.ndenumerate(table):
        text = f"{found[row][column].bound} {gain:.2g}".strip() if gain >= NOTICED else "·"
        colour = "white" if shades[row, column] > 2.2 else "black"
        text = "-" if math.isnan(gain) else text
        axes.text(column, row, text, ha="center", va="center", fontsize=10.5, color=colour)
    cases = [refinement(name) for name in by_scene]
    names = [c.scene.replace("_", " ") + " *" * (c.order is None or c.erratic) for c in cases]
    axes.set_yticks(range(len(names)), names, fontsize=10.5)
    axes.set_xticks(range(len(GAINS)), [title for _, title, _ in GAINS], fontsize=10)
    axes.tick_params(length=0, top=False, labeltop=True, bottom=False, labelbottom=False)
    axes.set_title("How many times faster at equal error, by one knob alone", fontsize=11.5)
    axes.set_xlabel(
        "·  none helps     -  not turned, not at two resolutions, or it makes the fluid too soft"
        "     *  partly chance\n"
        ">, <  at least, at most: its errors lie outside of what the scene's own settings have",
        fontsize=9.5, loc="left",
    )  # fmt: skip
