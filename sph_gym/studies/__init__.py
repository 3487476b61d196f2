"""Studies: commands that measure something, print a table and write it as CSV."""

from collections.abc import Callable
from pathlib import Path

from sph_gym.solver.checks import known
from sph_gym.studies import startup, validation
from sph_gym.studies.table import Row, show

_STUDIES: dict[str, Callable[[bool], list[Row]]] = {
    "startup": startup.measure,
    "validation": validation.measure,
}


def run_study(name: str, quick: bool = False, folder: str | Path = "runs/studies") -> int:
    """Run a study, print its table and write `folder`/NAME.csv.

    Returns 1 if a row misses its bound, else 0. Raises ValueError that lists the known studies.
    """
    rows = _STUDIES[known("study", name, _STUDIES)](quick)
    show(name, rows, Path(folder) / f"{name}.csv")
    return int(any(not row.holds for row in rows))
