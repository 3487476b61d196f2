"""One picture per validated scene: the runs at all resolutions, with the reference drawn in."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.scenes.shared.reference import Reference
from sph_gym.studies.picture import new_figure, save

# Colours by M. Okabe and K. Ito, for colour-blind eyes; line styles tell resolutions in grey too.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
LINES = ("-", "--", "-.", ":")
# Markers that a reference has at most, so that the curves below it can be seen.
MARKERS = 30


def draw(name: str, reference: Reference, results: Sequence[Any], path: Path) -> Path:
    """Draw the charts of some `validation.Validated` into one PNG file; return its path.

    Charts of the same axes go into one frame. Colours tell their curves apart, line styles the
    resolutions, the finest one solid; a reference is open black circles.
    Raises ImportError that names the extra.
    """
    charts: dict[tuple[str, str], list[Any]] = {}
    for result in results:
        charts.setdefault((result.chart.x_label, result.chart.y_label), []).append(result)
    figure = new_figure(7 * len(charts), 6)
    every = figure.subplots(1, len(charts), squeeze=False)[0]
    for axes, ((x_label, y_label), alike) in zip(every, charts.items(), strict=True):
        _draw_runs(axes, alike)
        _draw_references(axes, _references(alike))
        axes.set(xlabel=x_label, ylabel=y_label)
        axes.grid(alpha=0.3)
        place = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.1)}
        axes.legend(frameon=False, fontsize=8, ncols=2, **place)
    title = textwrap.fill(f"{name.replace('_', ' ')}; reference: {reference.source}", 90)
    figure.suptitle(title, fontsize=10)
    return save(figure, path)


def _draw_runs(axes: Any, results: Sequence[Any]) -> None:
    """Draw curves by colour; grey lines in the legend tell the styles of the resolutions."""
    colours: dict[str, str] = {}
    for k, result in enumerate(reversed(results)):
        style = LINES[k % len(LINES)]
        for curve in (curve for curve in result.chart.curves if not curve.reference):
            label = None if curve.label in colours else curve.label
            colour = colours.setdefault(curve.label, COLOURS[len(colours) % len(COLOURS)])
            axes.plot(curve.x, curve.y, style, color=colour, linewidth=1.4, label=label)
    for k, result in enumerate(reversed(results)):
        others = [f"{name} = {value}" for name, value in _others(result)]
        size = ", ".join([f"dx = {result.dx:.3g} m", *others])
        axes.plot([], [], LINES[k % len(LINES)], color="grey", label=size)


def _draw_references(axes: Any, references: Sequence[Any]) -> None:
    """Draw all references in black, with one line in the legend where there are many."""
    many = len(references) > 3
    style = {"color": "black", "markersize": 4, "markerfacecolor": "none", "zorder": 3}
    for k, curve in enumerate(references):
        label = curve.label if not many else "reference" if k == 0 else None
        every = max(len(curve.x) // MARKERS, 1)
        axes.plot(curve.x, curve.y, "o", label=label, markevery=every, **style)


def _references(results: Sequence[Any]) -> list[Any]:
    """Return all reference curves once; of results that differ in dx alone, the finest's."""
    finest = {repr(_others(result)): result for result in results}
    distinct: list[Any] = []
    for curve in (curve for result in finest.values() for curve in result.chart.curves):
        like = [other for other in distinct if curve.label == other.label]
        same = (
            np.array_equal(curve.x, other.x) and np.array_equal(curve.y, other.y) for other in like
        )
        if curve.reference and not any(same):
            distinct.append(curve)
    return distinct


def _others(result: Any) -> list[tuple[str, Any]]:
    """Return the arguments of a result except dx."""
    return sorted((name, value) for name, value in result.arguments.items() if name != "dx")
