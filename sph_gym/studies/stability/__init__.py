"""Hard cases that must stay stable, and maps of where tunable scenes are.

Every case is run in variants that differ in kernels, precision or resolution, and looked at in
every frame: nothing may fail in silence, gain energy, pass a wall, lose momentum, depend on the
number of threads or on the neighbour search. Up to the stable step nothing may blow up; above it,
a blow-up must be reported by the call in which it happens.
"""

import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from sph_gym.env import SCENES
from sph_gym.studies import store
from sph_gym.studies.stability import (
    bodies,
    figures,
    maps,
    memory,
    report,
    schemes,
    streams,
    tanks,
    walls,
)
from sph_gym.studies.stability.case import VARIANTS, Case
from sph_gym.studies.stability.runs import Outcome, run
from sph_gym.studies.table import Row

FOLDER = Path("runs/studies")
# What the run of a case depends on, of this package.
OWN = tuple(
    Path(__file__).with_name(f"{name}.py")
    for name in ("case", "events", "bodies", "tanks", "streams", "schemes", "checks", "runs")
)
# Variants of the quick version, and the one scene that it maps.
QUICK_VARIANTS, QUICK_SCENES = VARIANTS[:3], ("relaxation",)


def cases() -> list[Case]:
    """The catalogue."""
    return [*bodies.cases(), *tanks.cases(), *streams.cases(), *schemes.cases()]


def measure(quick: bool, folder: Path = FOLDER) -> Iterator[Row]:
    """Rows of all cases, of the memory and of all maps, with progress bars.

    quick: fewer frames, three variants, one small map. Finished runs are kept in the folder, and
    so are pictures of the maps. Raises ImportError that names the extra to install.
    """
    place = folder / "stability"
    store.probe(place)
    yield from catalogue(quick, place)
    with _bar(memory.N_LOOKS, "memory", "look") as bar:
        yield from memory.rows(quick, place, bar.update)
    with _bar(walls.N_RUNS, "boundary particles", "run") as bar:
        yield from walls.rows(place, bar.update)
    for name in QUICK_SCENES if quick else SCENES:
        yield from chart(name, quick, place)


def catalogue(quick: bool, folder: Path, chosen: Sequence[Case] | None = None) -> Iterator[Row]:
    """Rows of the cases, by default of all, and what they promise together."""
    several, variants = chosen or cases(), QUICK_VARIANTS if quick else VARIANTS
    found: report.Catalogue = {}
    with _bar(len(several) * len(variants), "cases", "run") as bar:
        for case in several:
            bar.set_description(case.name)
            outcomes = []
            for variant in variants:
                outcomes.append((variant, _kept(case, variant, quick, folder)))
                bar.update()
            found[case.name] = case, outcomes
            yield from report.rows(case, outcomes, quick)
    yield from report.summary(found)


def _kept(case: Case, variant: Any, quick: bool, folder: Path) -> Outcome:
    key = [case.name, variant.name, quick]
    path = folder / store.name(key, *OWN)
    compute = partial(run, case, variant, quick)
    return Outcome(*store.kept(path, key, compute, store.is_record(Outcome)))


def chart(name: str, quick: bool, folder: Path) -> Iterator[Row]:
    """Rows and picture of a scene's map; that of the quick version has a name of its own."""
    grid = maps.QUICK if quick else maps.FULL
    with _bar(maps.n_runs(grid), f"map of {name}", "run") as bar:
        found = maps.survey(name, grid, folder, bar.update)
    figures.draw(name, found, folder / f"{name}{'_quick' if quick else ''}.png")
    yield from maps.rows(name, found)


def _bar(total: int, title: str, unit: str) -> Any:
    try:
        from tqdm import tqdm
    except ImportError:
        raise ImportError('studies need more: pip install "sph_gym[studies]"') from None
    return tqdm(total=total, desc=title, unit=unit, file=sys.stderr)
