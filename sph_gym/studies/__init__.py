"""Studies: commands that measure something, print a table and write it as CSV."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sph_gym.solver.checks import known
from sph_gym.studies.table import Row, show, write

if TYPE_CHECKING:
    from sph_gym.studies.backends import Backend
    from sph_gym.studies.peers import Peers

# Studies, each a module of this package, and what their `measure` takes besides `quick`. Those that
# take scenes ("chosen") have `names`; those that print or draw something in the end have `finish`.
STUDIES: dict[str, tuple[str, ...]] = {
    "startup": (),
    "validation": ("folder", "chosen", "again"),
    "throughput": ("peers",),
    "effects": (),
    "headroom": ("folder", "backend"),
    "exploits": ("folder", "backend"),
    "soak": ("folder",),
    "stability": ("folder", "backend"),
    "accuracy": ("folder", "chosen", "again", "peers", "backend"),
    "doctor": (),
    "overhead": ("backend",),
}
# Where runs may go: see `backends`.
BACKENDS = ("local", "ray", "dask")


def that_take(option: str) -> list[str]:
    """Return the names of the studies that take an option."""
    return [name for name, options in STUDIES.items() if option in options]


def run_study(
    name: str,
    quick: bool = False,
    folder: str | Path = "runs/studies",
    peers: "Peers | None" = None,
    chosen: Sequence[str] | None = None,
    again: bool = False,
    backend: "Backend | None" = None,
) -> int:
    """Run a study, print its table, write `folder`/NAME.csv and, on the machine, NAME.json.

    A part of a study is called after the part: stability_quick, accuracy_SCENE.
    The file grows with every row, so that an interrupted study leaves what it has measured.
    chosen: scenes of the studies that go by scenes; again: validate anew what was validated
    before, or take the times of `accuracy` anew; backend: where runs go, None for the place that
    the study chooses.
    Returns 1 if a row misses its bound, else 0. Raises ValueError that lists the known studies,
    and for options of another study.
    """
    takes = STUDIES[known("study", name, STUDIES)]
    asked = None if backend is None else backend.checked()
    given = {"peers": peers, "chosen": chosen, "again": again, "backend": asked}
    options: dict[str, Any] = {option: value for option, value in given.items() if value}
    for option in options:
        if option not in takes:
            *owners, last = that_take(option)
            word, listed = "scenes" if option == "chosen" else option, ", ".join(owners)
            raise ValueError(f"--{word}: only the studies {listed} and {last} have it, not {name}")
    # each only where it is wanted: some take long to import
    study, machine = (import_module(f"{__name__}.{module}") for module in (name, "machine"))
    for scene in chosen or ():
        known("scenes", scene, study.names())
    place, stem = Path(folder), _stem(name, quick, chosen or ())
    if "folder" in takes:
        options["folder"] = place
    rows: list[Row] = []
    machine.write(place / f"{stem}.json")
    try:
        for row in study.measure(quick, **options):
            rows.append(row)
            write(rows, place / f"{stem}.csv")
    finally:
        if rows:
            show(name, rows, place / f"{stem}.csv")
            if hasattr(study, "finish"):
                study.finish(rows, place / f"{stem}.png")
    return int(any(not row.holds for row in rows))


def _stem(name: str, quick: bool, chosen: Sequence[str]) -> str:
    """Return the name of a study's files, so that no part of it overwrites the whole."""
    part = [f"{len(chosen)}_scenes"] if len(chosen) > 4 else chosen
    return "_".join([name, *part, *(["quick"] if quick else [])])
