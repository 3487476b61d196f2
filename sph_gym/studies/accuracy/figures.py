"""The picture of a scene: its work-precision diagram, over time and over work."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.studies.accuracy import luck
from sph_gym.studies.accuracy.axes import figure_of, readable, save, widen
from sph_gym.studies.accuracy.plan import COMBINED, knobs, rungs
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.accuracy.policies import needs_schedule
from sph_gym.studies.accuracy.problems import Problem
from sph_gym.studies.accuracy.settings import nominal

# Colours of M. Okabe and K. Ito, which colour-blind eyes tell apart; in grey the markers do.
STYLES = {
    "width": ("#0072B2", "s", "h / dx"),
    "step": ("#D55E00", "^", "dt / stable step"),
    "sound": ("#009E73", "D", "stiffness, by c / c0"),
    "kernel": ("#CC79A7", "P", "kernel"),
    "density": ("#E69F00", "X", "density"),
    "dtype": ("#56B4E9", "v", "precision"),
    "integrator": ("#7F3C8D", "<", "integrator"),
    "xsph": ("#8C6D31", ">", "XSPH epsilon"),
    "controller": ("#B8A300", "h", "controller"),
}
SHORT = {
    "width": "h = {} dx", "step": "dt = {} stable", "sound": "c = {} c0", "kernel": "{}",
    "density": "{}", "dtype": "{}", "integrator": "{}", "xsph": "epsilon {}", "controller": "{}",
}  # fmt: skip
# Of the size of a front: how far apart points that are numbered are at least.
APART = 0.14
LUCK = (
    "Luck apart: on the front are settings that were run up to the finest resolution, and an error "
    "counts at least as much as those of finer runs of the same settings."
)
SCATTER = "No front: errors are within their scatter, or partly chance."
CLOCK = (
    "Times are processor seconds, corrected for the machine's momentary speed by a benchmark "
    "beside each run."
)
THINKING = "* What the agent itself takes to think isn't counted."
# Cost and its label, of the two panels.
PANELS = (
    ("cost", "seconds per simulated second, one pinned thread"),
    ("pairs", "pair interactions per simulated second"),
)


# --- One scene ------------------------------------------------------------------------------


def draw(scene: Problem, points: Sequence[Point], path: Path) -> Path:
    """Error over time and over work, with the front numbered and explained below."""
    figure = figure_of(12, 8)
    every = figure.subplots(1, 2, sharey=True)
    figure.subplots_adjust(left=0.07, right=0.95, top=0.88, bottom=0.4, wspace=0.06)
    best = luck.front(points, "cost")
    for axes, (cost, label) in zip(every, PANELS, strict=True):
        _draw_panel(axes, scene, points, cost)
        axes.set_xlabel(label)
    for axes in every:
        readable(axes)
    every[0].set_ylabel(f"error [% {scene.of}]")
    _number(every[0], best)
    handles, labels = every[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, frameon=False, ncols=6, fontsize=8.5, loc="upper center",
        bbox_to_anchor=(0.51, 0.33),
    )  # fmt: skip
    _explain(figure, scene, points, best)
    figure.suptitle(_title(scene), fontsize=13, x=0.07, ha="left", y=0.97)
    figure.text(0.07, 0.905, _conclusion(scene, points), fontsize=10, color="#333333")
    return save(figure, path)


def _title(scene: Problem) -> str:
    return f"{scene.scene.replace('_', ' ')}: {scene.measure}"


def _conclusion(scene: Problem, points: Sequence[Point]) -> str:
    """What the diagram shows, in one line."""
    found = luck.headline(points, "cost")
    if not math.isfinite(found.gain):
        return f"{luck.chance(points) or 'errors blow up'}: no gain at equal error.".capitalize()
    least = "at least " if found.bound else ""
    return (
        f"At equal error the best combination is {least}{found.gain:.2g} times as fast as the "
        "scene's own settings (median over resolutions)."
    )


def value(point: Point, cost: str) -> float:
    """A cost of a point, per simulated second."""
    return point.interactions / point.seconds if cost == "pairs" else point.cost


def _draw_panel(axes: Any, scene: Problem, points: Sequence[Point], cost: str) -> None:
    ladder = sorted((p for p in rungs(points) if p.good), key=lambda p: p.dx)
    across = points[0].setting.across
    combined = [p for p in points if p.knob not in ("nominal", "resolution") and p.good]
    combined = [p for p in combined if p.knob == COMBINED or p.setting.across != across]
    axes.plot(
        [value(p, cost) for p in combined], [100 * p.error for p in combined], ".",
        color="#999999", markersize=6, label="other runs",
    )  # fmt: skip
    best = luck.front(points, "cost" if cost == "cost" else "interactions")
    if best:
        axes.plot(
            [value(p, cost) for p in best], [100 * p.error for p in best], "-", color="#FFC20A",
            linewidth=7, alpha=0.55, solid_capstyle="round", zorder=1,
            label="Pareto front, luck apart",
        )  # fmt: skip
    axes.plot(
        [value(p, cost) for p in ladder], [100 * p.error for p in ladder], "o-", color="black",
        markersize=5, linewidth=1.6, label="resolution, all else nominal", zorder=4,
    )  # fmt: skip
    _draw_arms(axes, points, cost)
    start = points[0]
    if start.good:
        axes.plot(
            [value(start, cost)], [100 * start.error], "*", color="black", markersize=17,
            markeredgecolor="white", label="nominal", zorder=6, linestyle="none",
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(0.1)
    widen(axes)
    if start.good and scene.order is not None:
        slopes(axes, start, cost)
    _mark_ends(axes, scene, ladder, cost)


def _draw_arms(axes: Any, points: Sequence[Point], cost: str) -> None:
    """Every knob alone, as a thin line through the nominal point."""
    start = points[0]
    for knob in knobs(points):
        if knob not in STYLES:
            continue
        colour, marker, label = STYLES[knob]
        across = start.setting.across
        turned = [p for p in points if p.knob == knob and p.good and p.setting.across == across]
        if not turned:
            continue
        places = [(value(p, cost), 100 * p.error) for p in turned]
        if knob in ("width", "step", "sound", "xsph") and start.good:
            line = sorted([start, *turned], key=lambda p: getattr(p.setting, knob))
            axes.plot(
                [value(p, cost) for p in line], [100 * p.error for p in line], "-",
                color=colour, linewidth=0.9, alpha=0.8, zorder=2,
            )  # fmt: skip
        axes.plot(
            *zip(*places, strict=True), marker=marker, linestyle="none", color=colour,
            markersize=6.5, markeredgecolor="white", markeredgewidth=0.6, label=label, zorder=3,
        )  # fmt: skip
        if knob == "controller":
            _name_controllers(axes, turned, cost)


def _name_controllers(axes: Any, turned: Sequence[Point], cost: str) -> None:
    # along the lower edge, one above the other, where no runs are
    for k, point in enumerate(sorted(turned, key=lambda p: value(p, cost))):
        axes.annotate(
            agent_name(point.setting.controller), (value(point, cost), 100 * point.error),
            xytext=(value(point, cost), 0.03 + 0.04 * k), textcoords=("data", "axes fraction"),
            fontsize=8, color="#5A5000", zorder=9, ha="left",
            arrowprops={"arrowstyle": "-", "color": "#5A5000", "lw": 0.5},
            bbox={"fc": "white", "ec": "none", "pad": 0.6, "alpha": 0.8},
        )  # fmt: skip


def agent_name(controller: str) -> str:
    """Of a controller; with an asterisk if what it thinks isn't in its time."""
    return controller.replace("_", " ") + ("*" if needs_schedule(controller) else "")


def slopes(axes: Any, start: Point, cost: str) -> None:
    """What first and second order in dx would give where the cost goes as dx^-3."""
    ends = axes.get_xlim(), axes.get_ylim()
    here, reach = value(start, cost), np.array([1e-4, 1e4])
    for order, style in ((1, (0, (1, 1.5))), (2, (0, (5, 2)))):
        axes.plot(
            here * reach, 100 * start.error * reach ** (-order / 3), color="#777777",
            linestyle=style, linewidth=1.1, label=f"slope of order {order} in dx", zorder=1,
        )  # fmt: skip
    axes.set(xlim=ends[0], ylim=ends[1])


def _mark_ends(axes: Any, scene: Problem, ladder: Sequence[Point], cost: str) -> None:
    """How many particles the coarsest and the finest run have along the scene's length."""
    for point, place, side in ((ladder[-1:], (7, 7), "left"), (ladder[:1], (-2, -15), "center")):
        for end in point if len(ladder) > 1 else ():
            axes.annotate(
                f"{scene.length} / {end.setting.across}", (value(end, cost), 100 * end.error),
                xytext=place, textcoords="offset points", fontsize=8.5, ha=side, zorder=7,
            )  # fmt: skip


def _number(axes: Any, best: Sequence[Point]) -> None:
    for k, point in enumerate(_numbered(best), 1):
        axes.annotate(
            str(k), (point.cost, 100 * point.error), xytext=(-11, -11),
            textcoords="offset points", fontsize=8.5, fontweight="bold", ha="center",
            va="center", zorder=8,
            bbox={"boxstyle": "circle,pad=0.15", "fc": "white", "ec": "black", "lw": 0.7},
        )  # fmt: skip


def _numbered(best: Sequence[Point]) -> list[Point]:
    """Some points of a front, its ends among them, none close to another."""
    if len(best) < 2:
        return list(best)
    places = np.log([[point.cost, point.error] for point in best])
    places = (places - places.min(axis=0)) / np.maximum(np.ptp(places, axis=0), 1e-9)
    chosen = [0]
    for k in range(1, len(best) - 1):
        apart = min(np.hypot(*(places[k] - places[j])) for j in (chosen[-1], -1))
        if apart > APART:
            chosen.append(k)
    return [best[k] for k in [*chosen, len(best) - 1]]


def _explain(figure: Any, scene: Problem, points: Sequence[Point], best: Sequence[Point]) -> None:
    """What the numbered points are, in two columns, how the error converges, what times are."""
    numbered = _numbered(best)
    half = -(-len(numbered) // 2)
    head = "On the front at the left: error, processor time of the whole run, and what is set"
    figure.text(0.07, 0.228, head if best else SCATTER, fontsize=8.5, color="#333333")
    for k, point in enumerate(numbered):
        text = f"{k + 1}  {100 * point.error:.2g} %, {point.time:.2g} s: {_name(scene, point)}"
        figure.text(0.07 + 0.46 * (k // half), 0.2 - 0.028 * (k % half), text, fontsize=8.5)
    agents = any(point.good and needs_schedule(point.setting.controller) for point in points)
    said = [scene.note, LUCK if best else "", CLOCK, THINKING if agents else ""]
    note = textwrap.fill(" ".join(filter(None, said)), 160)
    foot = 0.02 if best else 0.14
    figure.text(0.07, foot, note, fontsize=9, style="italic", color="#333333", linespacing=1.5)


def _name(scene: Problem, point: Point) -> str:
    """A setting by what it does otherwise than the scene itself."""
    changes = point.setting.differences(nominal(scene, point.setting.across))
    return ", ".join([f"{scene.length} / {point.setting.across}", *words(changes)])


def words(changes: Mapping[str, object]) -> list[str]:
    """Settings of knobs, as short as possible."""
    return [
        SHORT[knob].format(f"{v:g}" if isinstance(v, float) else str(v).replace("_", " "))
        for knob, v in changes.items()
    ]
