"""Figures of the studies, and the plot of the throughput study."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from sph_gym.extras import needs_extra
from sph_gym.files import atomic_write
from sph_gym.studies.peers import NAME
from sph_gym.studies.table import Row

# Colours of M. Okabe and K. Ito, which colour-blind eyes tell apart; markers, filled or not, and
# line styles do the same in grey. Precision is colour and marker, threads are the line.
STYLES = {
    "float64": {"color": "#0072B2", "marker": "o"},
    "float32": {"color": "#D55E00", "marker": "s"},
}
# Line style and label by quantity and threads.
KINDS = {
    ("throughput", "1 thread"): ("-", "1 thread"),
    ("throughput", "2 threads"): ("--", "2 threads"),
    (f"throughput of {NAME}", "1 thread"): (":", f"{NAME}, 1 thread"),
}


def new_figure(width: float, height: float) -> Any:
    """Return an empty figure [inches]. Raises ImportError that names the extra to install."""
    with needs_extra("studies"):
        from matplotlib.figure import Figure
    return Figure(figsize=(width, height), layout="constrained")


def save(figure: Any, path: Path, dpi: int = 150) -> Path:
    """Write a figure as PNG and return its path."""
    with atomic_write(path) as draft:
        figure.savefig(draft, dpi=dpi)
    return path


class ThroughputCurve(NamedTuple):
    """A curve that was measured: points are (particles, speed)."""

    label: str
    dtype: str
    line: str
    points: list[tuple[int, float]]


def curves(rows: Sequence[Row]) -> Iterator[ThroughputCurve]:
    """Yield every curve that the rows hold."""
    for (quantity, threads), (line, label) in KINDS.items():
        for dtype in STYLES:
            ending = f", {dtype}, {threads}"
            points = [
                (int(row.case.removesuffix(ending)), row.value)
                for row in rows
                if row.quantity == quantity and row.case.endswith(ending)
            ]
            if points:
                yield ThroughputCurve(f"{dtype}, {label}", dtype, line, points)


def draw(rows: Sequence[Row], path: Path) -> Path:
    """Draw the throughput over the number of particles; return the path of the PNG file.

    Raises ImportError that names the extra to install.
    """
    figure = new_figure(8, 5)
    from matplotlib.ticker import NullLocator, StrMethodFormatter

    axes: Any = figure.add_subplot()
    found = list(curves(rows))
    for label, dtype, line, points in found:
        face = STYLES[dtype]["color"] if line == "-" else "white"
        axes.plot(*zip(*points, strict=True), line, label=label, mfc=face, **STYLES[dtype])
    axes.set_xscale("log")
    axes.set_xticks(sorted({n for curve in found for n, _ in curve.points}))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_ylim(bottom=0)
    axes.set(xlabel="fluid particles", ylabel="throughput [million particle-steps/s]")
    axes.set_title("Dam break with about 20 neighbours, fluid and wall particles counted")
    axes.grid(alpha=0.3)
    if found:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return save(figure, path)
