"""The table that recommendations are made of: runs on lines, with their errors and efforts."""

import csv
import math
from collections.abc import Iterable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from sph_gym.solver.checks import positive
from sph_gym.studies.accuracy.settings import Setting

COLUMNS = ("scene", *Setting._fields, "error", "effort", "compression", "mach")
# Resolutions that a line has at least.
FEWEST = 3


class Sample(NamedTuple):
    """A run as the table has it.

    effort: particle-steps of the benchmark that take as long; compression, mach: as of an
    `Outcome`.
    """

    scene: str
    setting: Setting
    error: float
    effort: float
    compression: float = 0.0
    mach: float = 0.0


def whole(line: Sequence[Setting], finest: int) -> bool:
    """Whether a line is known at several resolutions up to the finest of its scene.

    The error of its own finest run would otherwise stand for all that are finer.
    """
    sizes = {setting.across for setting in line}
    return len(sizes) >= FEWEST and max(sizes) >= finest


def read(scene: str, path: Path | None = None) -> list[Sample]:
    """Samples of a scene, by default those that come with the package.

    Raises ValueError if there are none.
    """
    place = resources.files("sph_gym.studies.accuracy") / "data" / f"{scene}.csv"
    if path is None and not place.is_file():
        raise ValueError(f"scene: expected one of {', '.join(shipped())}, got {scene!r}")
    if path is not None and not path.is_file():
        raise ValueError(f"table: expected a file of samples, got {str(path)!r}")
    source = place if path is None else path
    try:
        rows = _rows(source.read_text())
        return [_sample(row) for row in rows if row["scene"] == scene]
    except ValueError as error:
        raise ValueError(f"table: {source} is no table of samples: {error}") from None


def _rows(text: str) -> list[dict[str, str]]:
    """Rows of a table, each with all columns. Raises ValueError that tells what is wrong."""
    table = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    missing = [name for name in COLUMNS if name not in (table.fieldnames or ())]
    if missing:
        raise ValueError(f"expected columns {', '.join(missing)}, got {table.fieldnames}")
    rows = list(table)
    if not rows:
        raise ValueError("expected rows below its columns, got none")
    return rows


def shipped() -> list[str]:
    """Scenes of which samples come with the package."""
    folder = resources.files("sph_gym.studies.accuracy") / "data"
    return sorted(file.name.removesuffix(".csv") for file in folder.iterdir())


def _sample(row: dict[str, str]) -> Sample:
    kinds = {**Setting.__annotations__, **dict.fromkeys(COLUMNS[-4:], float)}
    values: dict[str, Any] = {}
    for name, kind in kinds.items():
        try:
            values[name] = kind(row[name])
        except (TypeError, ValueError):
            what = "a word" if kind is str else "a number"
            raise ValueError(f"{name}: expected {what}, got {row[name]!r}") from None
    # nan: it blew up
    timed = () if math.isnan(values["error"]) else ("effort",)
    for name in ("across", "width", "step", "sound", *timed):
        positive(name, values[name])
    for name in ("error", "compression", "mach"):
        if values[name] < 0 or math.isinf(values[name]):
            raise ValueError(f"{name}: expected a share of at least 0, got {values[name]}")
    measured = [values.pop(name) for name in COLUMNS[-4:]]
    return Sample(row["scene"], Setting(**values), *measured)


def write(samples: Iterable[Sample], path: Path, comment: str) -> None:
    """Write a table that `read` takes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        file.write(f"# {comment}\n")
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for s in samples:
            numbers = (s.error, s.effort, s.compression, s.mach)
            writer.writerow([s.scene, *s.setting, *(f"{number:.6g}" for number in numbers)])
