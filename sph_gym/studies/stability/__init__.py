"""Hard cases that must stay stable, and maps of where tunable scenes are.

Every case is run in variants that differ in kernels, precision or resolution, and checked after
every frame: nothing may fail in silence, gain energy, pass a wall, lose momentum, depend on the
number of threads or on the neighbour search. Up to the stable step nothing may blow up; above it,
a blow-up must be reported by the call in which it happens. A case is one entry of `bodies`,
`jets` or `tanks`, a check one of `checks`, a bound that is known to be missed one of `limits`.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from sph_gym.env import SCENES
from sph_gym.extras import progress_bar
from sph_gym.studies.results import Results
from sph_gym.studies.stability import bodies, figures, jets, maps, memory, runs, tanks
from sph_gym.studies.stability.case import VARIANTS, HardCase
from sph_gym.studies.table import Row

_CATALOGUE = ("bodies", "case", "checks", "comparisons", "events", "jets", "runs", "tanks")
# Variants of the quick version, and the one scene that it maps.
QUICK_VARIANTS, QUICK_SCENES = VARIANTS[:3], ("relaxation",)


def cases() -> list[HardCase]:
    """Return the catalogue."""
    return [*bodies.cases(), *tanks.cases(), *jets.cases(), *tanks.schemes()]


def measure(quick: bool, folder: Path) -> Iterator[Row]:
    """Yield rows of all cases, of the memory, of boundary particles and of all maps.

    quick: fewer frames, three variants, one small map. Finished runs are kept in the folder, and
    so are pictures of the maps. Raises ImportError that names the extra to install.
    """
    place = folder / "stability"
    _results(place).check_writable()
    yield from catalogue(quick, place)
    yield from memory.rows(quick, _results(place, "case", "memory", "tanks"))
    yield from jets.rows(_results(place, "bodies", "case", "checks", "jets"))
    for name in QUICK_SCENES if quick else SCENES:
        yield from chart(name, quick, place)


def catalogue(quick: bool, folder: Path, chosen: Sequence[HardCase] | None = None) -> Iterator[Row]:
    """Yield rows of the cases, by default of all, and what must hold over all of them."""
    several, variants = chosen or cases(), QUICK_VARIANTS if quick else VARIANTS
    results, found = _results(folder, *_CATALOGUE), dict[str, tuple[HardCase, runs.Runs]]()
    with progress_bar(len(several) * len(variants), "cases") as bar:
        for case in several:
            bar.set_description(case.name)
            outcomes = []
            for variant in variants:
                compute = partial(runs.run, case, variant, quick)
                kept = results.get([case.name, variant.name, quick], compute, runs.is_outcome)
                outcomes.append((variant, runs.CaseOutcome(*kept)))
                bar.update()
            found[case.name] = case, outcomes
            yield from runs.rows(case, outcomes, quick)
    yield from runs.summary(found)


def chart(name: str, quick: bool, folder: Path) -> Iterator[Row]:
    """Yield rows of a scene's map and draw it; that of the quick version has a name of its own."""
    grid = maps.QUICK if quick else maps.FULL
    with progress_bar(maps.n_runs(grid), f"map of {name}") as bar:
        found = maps.survey(name, grid, _results(folder, "maps"), bar.update)
    figures.draw(name, found, folder / f"{name}{'_quick' if quick else ''}.png")
    yield from maps.rows(name, found)


def _results(folder: Path, *own: str) -> Results:
    return Results(folder, *(f"studies/stability/{name}.py" for name in own))
