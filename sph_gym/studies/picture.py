"""The plot of the throughput study."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from sph_gym.studies.peers import NAME
from sph_gym.studies.table import Row

# Colours of M. Okabe and K. Ito, which colour-blind eyes tell apart; markers, filled or not, and
# line styles do the same in grey. Precision is colour and marker, threads are the line.
COLOURS = {"float64": "#0072B2", "float32": "#D55E00"}
MARKERS = {"float64": "o", "float32": "s"}
LINES = {"throughput, 1": "-", "throughput, 2": "--", "peer": ":"}

Curve = tuple[str, str, str, list[tuple[int, float]]]


def curves(rows: Sequence[Row]) -> Iterator[Curve]:
    """Label, precision, kind of line and (particles, speed) of every curve that was measured."""
    kinds = {
        "throughput, 1": ("throughput", "1 thread", "1 thread"),
        "throughput, 2": ("throughput", "2 threads", "2 threads"),
        "peer": (f"throughput of {NAME}", "1 thread", f"{NAME}, 1 thread"),
    }
    for kind, (quantity, threads, label) in kinds.items():
        for dtype in COLOURS:
            ending = f", {dtype}, {threads}"
            points = [
                (int(row.case.removesuffix(ending)), row.value)
                for row in rows
                if row.quantity == quantity and row.case.endswith(ending)
            ]
            if points:
                yield f"{dtype}, {label}", dtype, kind, points


def draw(rows: Sequence[Row], path: Path) -> Path:
    """Draw the throughput over the number of particles; the path of the PNG file.

    Raises ImportError that names the extra to install.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ImportError('plots need more: pip install "sph_gym[studies]"') from None
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.add_subplot()
    sizes: set[int] = set()
    for label, dtype, kind, points in curves(rows):
        n, speed = zip(*points, strict=True)
        sizes |= set(n)
        axes.plot(
            n, speed, LINES[kind], color=COLOURS[dtype], marker=MARKERS[dtype], label=label,
            markerfacecolor=COLOURS[dtype] if kind == "throughput, 1" else "white",
        )  # fmt: skip
    _label(axes, sorted(sizes))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    return path


def _label(axes: Any, sizes: list[int]) -> None:
    axes.set_xscale("log")
    axes.set_xticks(sizes, [f"{n:,}" for n in sizes])
    axes.minorticks_off()
    axes.set_ylim(bottom=0)
    axes.set_xlabel("fluid particles")
    axes.set_ylabel("throughput [million particle-steps/s]")
    axes.set_title("Dam break with about 20 neighbours, fluid and wall particles counted")
    axes.grid(alpha=0.3)
    if sizes:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
