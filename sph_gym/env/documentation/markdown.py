"""Tables and text in Markdown."""

import inspect
import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np


def table(headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a Markdown table; numbers in four digits."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(map(cell, line)) + " |" for line in lines)


def cell(value: Any) -> str:
    """Return a cell of a table, in one line."""
    text = f"{value:.4g}" if isinstance(value, (float, np.floating)) else str(value)
    return " ".join(text.replace("|", r"\|").split())


def listed(docstring: str | None) -> dict[str, str]:
    """Return the entries "- `name`: meaning" of a docstring, each of any number of lines."""
    text = inspect.cleandoc(docstring or "")
    found = re.findall(r"^- `(\w+)`: (.*(?:\n  +\S.*)*)", text, re.MULTILINE)
    return {name: " ".join(meaning.split()) for name, meaning in found}


def span(values: Sequence[float]) -> str:
    """Return the range from the smallest to the largest value."""
    low, high = min(values), max(values)
    return cell(low) if low == high else f"{cell(low)} to {cell(high)}"
