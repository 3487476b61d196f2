"""One picture per validated scene: the runs at all resolutions, with the reference drawn in."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.scenes.shared.reference import Reference

# Of M. Okabe and K. Ito, for colour-blind eyes; line styles tell resolutions in grey too.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
LINES = ("-", "--", "-.", ":")
# Markers that a reference has at most, so that the curves below it can be seen.
MARKERS = 30


def draw(name: str, reference: Reference, results: Sequence[Any], path: Path) -> Path:
    """Draw the charts of some `validation.Result` into one PNG file; its path.

    Charts of the same axes go into one frame. Colours tell their curves apart, line styles the
    resolutions, the finest one solid; a reference is open black circles.
    Raises ImportError that names the extra.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ImportError('plots need more: pip install "sph_gym[studies]"') from None
    charts: dict[tuple[str, str], list[Any]] = {}
    for result in results:
        charts.setdefault((result.chart.x_label, result.chart.y_label), []).append(result)
    figure = Figure(figsize=(7 * len(charts), 6), layout="constrained")
    every = figure.subplots(1, len(charts), squeeze=False)[0]
    for axes, (labels, alike) in zip(every, charts.items(), strict=True):
        _draw_runs(axes, alike)
        _draw_references(axes, _references(alike))
        axes.set_xlabel(labels[0])
        axes.set_ylabel(labels[1])
        axes.grid(alpha=0.3)
        axes.legend(
            frameon=False, fontsize=8, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.1)
        )
    title = textwrap.fill(f"{name.replace('_', ' ')}; reference: {reference.source}", 90)
    figure.suptitle(title, fontsize=10)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    return path


def _draw_runs(axes: Any, results: Sequence[Any]) -> None:
    """Curves by colour; grey lines in the legend tell the styles of the resolutions."""
    labels: dict[str, str] = {}
    for k, result in enumerate(reversed(results)):
        for curve in (curve for curve in result.chart.curves if not curve.reference):
            new = curve.label not in labels
            colour = labels.setdefault(curve.label, COLOURS[len(labels) % len(COLOURS)])
            axes.plot(
                curve.x, curve.y, LINES[k % len(LINES)], color=colour, linewidth=1.4,
                label=curve.label if new else None,
            )  # fmt: skip
    for k, result in enumerate(reversed(results)):
        axes.plot([], [], LINES[k % len(LINES)], color="grey", label=_size(result))


def _size(result: Any) -> str:
    others = [f"{k} = {v}" for k, v in result.arguments.items() if k != "dx"]
    return ", ".join([f"dx = {result.dx:.3g} m", *others])


def _references(results: Sequence[Any]) -> list[Any]:
    """The reference curves of all results, once each; of those that differ in dx, the finest's."""
    finest = {_others(result): result for result in results}
    distinct: list[Any] = []
    for curve in (curve for result in finest.values() for curve in result.chart.curves):
        if curve.reference and not any(_same(curve, other) for other in distinct):
            distinct.append(curve)
    return distinct


def _others(result: Any) -> tuple[tuple[str, str], ...]:
    """The arguments of a result but for dx."""
    return tuple(sorted((k, repr(v)) for k, v in result.arguments.items() if k != "dx"))


def _same(curve: Any, other: Any) -> bool:
    return (
        curve.label == other.label
        and np.array_equal(curve.x, other.x)
        and np.array_equal(curve.y, other.y)
    )


def _draw_references(axes: Any, references: Sequence[Any]) -> None:
    """All in black, with one line in the legend where there are many."""
    for k, curve in enumerate(references):
        label = curve.label if len(references) <= 3 else "reference"
        axes.plot(
            curve.x, curve.y, "o", color="black", markersize=4, markerfacecolor="none",
            markevery=max(len(curve.x) // MARKERS, 1), zorder=3,
            label=label if len(references) <= 3 or k == 0 else None,
        )  # fmt: skip
