"""Read a table of particles: CSV with a heading, as PartVTK of DualSPHysics or ParaView write."""

import csv
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.doctor.reading.names import POSITIONS, TIME, named, tidy

# So many lines may stand before the heading.
PREAMBLE = 20


def read_table(path: Path) -> dict[str, Any]:
    """Return the columns of a table by their headings, and the time if a line before tells it.

    Columns may be separated by commas, semicolons or tabs. Raises ValueError if no heading names
    positions, or a row has other columns than it.
    """
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        lines = file.read().splitlines()
    rows = [_cells(line) for line in lines[:PREAMBLE]]
    start = next((k for k, row in enumerate(rows) if _is_heading(row)), None)
    if start is None:
        raise ValueError(
            f"{path}: expected a heading with positions, such as Pos.x [m] and Pos.y [m], or x and "
            f"y, in the first {PREAMBLE} lines; the first is {lines[0][:80] if lines else ''!r}"
        )
    heading = rows[start]
    values = [_cells(line)[: len(heading)] for line in lines[start + 1 :] if line.strip()]
    try:
        table = np.array(values, dtype=np.float64).reshape(-1, len(heading))
    except ValueError as error:
        raise ValueError(f"{path}: expected numbers in {len(heading)} columns: {error}") from None
    found: dict[str, Any] = dict(zip(heading, table.T, strict=True))
    for names, numbers in pairwise(rows[:start]):
        told = dict(zip(map(tidy, names), numbers, strict=False))
        for name in TIME:
            if name in told:
                found["time"] = np.float64(told[name])
    return found


def _cells(line: str) -> list[str]:
    """Return the cells of a line; DualSPHysics ends lines with a separator."""
    separator = max(";,\t", key=line.count)
    cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _is_heading(row: list[str]) -> bool:
    names = named(dict.fromkeys(row))
    pairs = [(stem + a, stem + b) for stem in POSITIONS for a, b in ("xy", "xz", "01")]
    return any(a in names and b in names for a, b in pairs)
