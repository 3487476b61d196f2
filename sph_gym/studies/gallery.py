"""One picture per validated scene: the runs at all resolutions, with the reference drawn in."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sph_gym.scenes.reference import Reference

# Of M. Okabe and K. Ito, for colour-blind eyes; line styles tell the same in grey.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
LINES = ("-", "--", "-.", ":")
MANY = 40


def draw(name: str, reference: Reference, results: Sequence[Any], path: Path) -> Path:
    """Draw the charts of some `validation.Result` into one PNG file; its path.

    Colours tell the curves of a chart apart, line styles the resolutions; a reference is black,
    with markers where it consists of few points. Raises ImportError that names the extra.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ImportError('plots need more: pip install "sph_gym[studies]"') from None
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.add_subplot()
    for k, result in enumerate(results):
        colour = 0
        for curve in result.chart.curves:
            if curve.reference:
                continue
            axes.plot(
                curve.x, curve.y, LINES[k % len(LINES)],
                color=COLOURS[(colour + k) % len(COLOURS)],
                label=f"{curve.label}, {_size(result)}", linewidth=1.4,
            )  # fmt: skip
            colour += len(results)
    _draw_references(axes, results[-1])
    axes.set_xlabel(results[-1].chart.x_label)
    axes.set_ylabel(results[-1].chart.y_label)
    axes.set_title(f"{name.replace('_', ' ')} (reference: {reference.source})", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    return path


def _size(result: Any) -> str:
    others = [f"{k} = {v}" for k, v in result.arguments.items() if isinstance(v, str)]
    return ", ".join([f"dx = {result.dx:.3g} m", *others])


def _draw_references(axes: Any, result: Any) -> None:
    seen = set()
    for curve in result.chart.curves:
        if not curve.reference:
            continue
        few = len(curve.x) <= MANY
        axes.plot(
            curve.x, curve.y, "o" if few else "-", color="black", markersize=4, linewidth=0.9,
            markerfacecolor="white", zorder=3 if few else 1,
            label=curve.label if curve.label not in seen else None,
        )  # fmt: skip
        seen.add(curve.label)
