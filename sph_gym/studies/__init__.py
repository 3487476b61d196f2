"""Studies: commands that measure something, print a table and write it as CSV."""

import inspect
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from sph_gym.solver.checks import known
from sph_gym.studies import (
    accuracy,
    doctor,
    effects,
    exploits,
    headroom,
    machine,
    overhead,
    soak,
    stability,
    startup,
    throughput,
    validation,
)
from sph_gym.studies.backends import Backend
from sph_gym.studies.peers import Peers
from sph_gym.studies.table import Row, show, write

_STUDIES: dict[str, Callable[..., Iterable[Row]]] = {
    "startup": startup.measure,
    "validation": validation.measure,
    "throughput": throughput.measure,
    "effects": effects.measure,
    "headroom": headroom.measure,
    "exploits": exploits.measure,
    "soak": soak.measure,
    "stability": stability.measure,
    "accuracy": accuracy.measure,
    "doctor": doctor.measure,
    "overhead": overhead.measure,
}
# Studies that can be limited to some scenes, and the scenes that they know.
_BY_SCENE: dict[str, Callable[[], list[str]]] = {
    "validation": validation.with_reference,
    "accuracy": accuracy.names,
}
# Studies that draw or print something after their table.
_FINISH: dict[str, Callable[[list[Row], Path], None]] = {
    "throughput": throughput.finish,
    "headroom": headroom.finish,
    "exploits": headroom.explain,
    "doctor": doctor.finish,
}


def names() -> list[str]:
    """Return the studies that `run_study` knows."""
    return list(_STUDIES)


def run_study(
    name: str,
    quick: bool = False,
    folder: str | Path = "runs/studies",
    peers: Peers | None = None,
    chosen: Sequence[str] | None = None,
    again: bool = False,
    backend: Backend | None = None,
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
    study = _STUDIES[known("study", name, _STUDIES)]
    place = Path(folder)
    options: dict[str, Any] = {"folder": place} if _takes(name, "folder") else {}
    asked = None if backend is None else backend.checked()
    for option, value in (
        ("peers", peers), ("chosen", chosen), ("again", again), ("backend", asked),
    ):  # fmt: skip
        if value and not _takes(name, option):
            *owners, last = (other for other in _STUDIES if _takes(other, option))
            word, listed = "scenes" if option == "chosen" else option, ", ".join(owners)
            raise ValueError(f"--{word}: only the studies {listed} and {last} have it, not {name}")
        options |= {option: value} if value else {}
    rows: list[Row] = []
    stem = _stem(name, quick, chosen)
    machine.write(place / f"{stem}.json")
    try:
        for row in study(quick, **options):
            rows.append(row)
            write(rows, place / f"{stem}.csv")
    finally:
        if rows:
            show(name, rows, place / f"{stem}.csv")
            _FINISH.get(name, lambda rows, path: None)(rows, place / f"{stem}.png")
    return int(any(not row.holds for row in rows))


def _takes(name: str, option: str) -> bool:
    return option in inspect.signature(_STUDIES[name]).parameters


def _stem(name: str, quick: bool, chosen: Sequence[str] | None) -> str:
    """Return the name of a study's files, so that no part of it overwrites the whole."""
    for scene in chosen or ():
        known("scenes", scene, _BY_SCENE[name]())
    several = [f"{len(chosen)}_scenes"] if chosen and len(chosen) > 4 else [*(chosen or ())]
    return "_".join([name, *several, *(["quick"] if quick else [])])
