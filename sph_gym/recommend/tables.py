"""Tables of measured runs: errors and efforts, which recommendations are made of."""

import csv
import math
from collections.abc import Iterable
from importlib import resources
from pathlib import Path
from typing import Any

from sph_gym.files import write_csv
from sph_gym.recommend.series import MeasuredRun
from sph_gym.recommend.settings import Setting
from sph_gym.solver.checks import positive

DATA = resources.files("sph_gym.recommend") / "data" / "runs"
MEASURED = ("error", "effort", "compression", "mach")
COLUMNS = ("scene", *Setting._fields, *MEASURED)


def shipped() -> list[str]:
    """Return the scenes of which tables come with the package."""
    return sorted(file.name.removesuffix(".csv") for file in DATA.iterdir())


def read(scene: str, path: Path | None = None) -> list[MeasuredRun]:
    """Return the runs of a scene in a table, by default the one that comes with the package.

    Raises ValueError if there is none, or if it is no such table.
    """
    source = DATA / f"{scene}.csv" if path is None else path
    if not source.is_file():
        if path is None:
            raise ValueError(f"scene: expected one of {', '.join(shipped())}, got {scene!r}")
        raise ValueError(f"table: expected a file of samples, got {str(path)!r}")
    try:
        return [_row(row) for row in _rows(source.read_text()) if row["scene"] == scene]
    except ValueError as error:
        raise ValueError(f"table: {source} is no table of samples: {error}") from None


def _rows(text: str) -> list[dict[str, str]]:
    """Return rows that have all columns. Raises ValueError that says what is wrong."""
    table = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    missing = [name for name in COLUMNS if name not in (table.fieldnames or ())]
    if missing:
        raise ValueError(f"expected columns {', '.join(missing)}, got {table.fieldnames}")
    rows = list(table)
    if not rows:
        raise ValueError("expected rows below its columns, got none")
    return rows


def _row(row: dict[str, str]) -> MeasuredRun:
    kinds = {**Setting.__annotations__, **dict.fromkeys(MEASURED, float)}
    values: dict[str, Any] = {}
    for name, kind in kinds.items():
        try:
            values[name] = kind(row[name])
        except (TypeError, ValueError):
            what = "a word" if kind is str else "a number"
            raise ValueError(f"{name}: expected {what}, got {row[name]!r}") from None
    # a run that blew up has no time
    timed = () if math.isnan(values["error"]) else ("effort",)
    for name in ("across", "width", "step", "sound", *timed):
        positive(name, values[name])
    for name in ("error", "compression", "mach"):
        if values[name] < 0 or math.isinf(values[name]):
            raise ValueError(f"{name}: expected a share of at least 0, got {values[name]}")
    measured = [values.pop(name) for name in MEASURED]
    return MeasuredRun(row["scene"], Setting(**values), *measured)


def write(runs: Iterable[MeasuredRun], path: Path, comment: str) -> None:
    """Write a table of runs, which `read` takes."""

    def row(run: MeasuredRun) -> list[Any]:
        error = run.error if run.good else math.nan
        numbers = (error, run.effort, run.compression, run.mach)
        return [run.scene, *run.setting, *(f"{number:.6g}" for number in numbers)]

    write_csv(path, COLUMNS, map(row, runs), comment)
