"""Figures of the studies."""

from pathlib import Path
from typing import Any

from sph_gym.extras import needs_extra
from sph_gym.files import atomic_write


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
