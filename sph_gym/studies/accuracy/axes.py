"""What the pictures share: empty figures, and log axes with numbers that people read."""

import math
from pathlib import Path
from typing import Any

# Largest over smallest error of an axis, at least.
LEAST_RANGE = 8.0
# Digits of the numbers on an axis, the fewest first.
TICKS: tuple[tuple[float, ...], ...] = (
    (1,), (1, 3), (1, 2, 5), (1, 1.5, 2, 3, 5, 7), (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8),
    tuple(k / 10 for k in range(10, 100)),
)  # fmt: skip


def figure_of(width: float, height: float) -> Any:
    """An empty figure. Raises ImportError that names the extra to install."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ImportError('plots need more: pip install "sph_gym[studies]"') from None
    return Figure(figsize=(width, height))


def save(figure: Any, path: Path) -> Path:
    """Write a figure as PNG; its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    return path


def widen(axes: Any) -> None:
    """Leave room around errors that hardly differ, so that they look as if they hardly did."""
    low, high = axes.get_ylim()
    room = math.sqrt(max(LEAST_RANGE / (high / low), 1.0))
    axes.set_ylim(low / room, high * room)


def readable(axes: Any) -> None:
    """Plain numbers on the error axis, a light grid, and the errors that people ask for."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    for axis, ends in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        axis.set_ticks(ticks(*ends))
        axis.set_minor_formatter(NullFormatter())
        axis.set_major_formatter(FuncFormatter(lambda number, _: _plain(number)))
    axes.grid(alpha=0.25)


def ticks(low: float, high: float) -> list[float]:
    """Round numbers between two others on a log scale, neither too many nor too few."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    found: list[float] = []
    for digits in TICKS:
        found = [d * 10.0**k for k in decades for d in digits]
        found = [number for number in found if low <= number <= high]
        if len(found) >= 3:
            break
    return found


def _plain(number: float) -> str:
    """As a person writes it: powers of ten only where there would be many zeros."""
    if 1e-3 <= number < 1e4:
        return f"{number:g}"
    exponent = math.floor(math.log10(number) + 1e-9)
    digits = number / 10.0**exponent
    head = "" if abs(digits - 1) < 1e-6 else rf"{digits:g} \cdot "
    return f"${head}10^{{{exponent}}}$"
