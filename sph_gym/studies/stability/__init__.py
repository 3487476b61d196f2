"""Hard cases that must stay stable, and maps of where tunable scenes are.

Every case is run in variants that differ in kernels, precision or resolution, and checked after
every frame: nothing may fail in silence, gain energy, pass a wall, lose momentum, depend on the
number of threads or on the neighbour search. Up to the stable step nothing may blow up; above it,
a blow-up must be reported by the call in which it happens. A case is one entry of `bodies`,
`jets` or `tanks`, a check one of `checks`, a bound that is known to be missed one of `limits`.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path

from sph_gym.env import SCENES
from sph_gym.extras import progress_bar
from sph_gym.studies.backends import Backend
from sph_gym.studies.jobs import run_jobs
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


def measure(quick: bool, folder: Path, backend: Backend | None = None) -> Iterator[Row]:
    """Yield rows of all cases, of the memory, of boundary particles and of all maps.

    quick: fewer frames, three variants, one small map; backend: where most runs go, None for this
    process. Finished runs are kept in the folder, and so are pictures of the maps. Raises
    ImportError that names the extra to install.
    """
    place = folder / "stability"
    _results(place).check_writable()
    if backend is not None:
        run_ahead(quick, place, backend)
    yield from catalogue(quick, place)
    yield from memory.rows(quick, _results(place, "case", "memory", "tanks"))
    yield from jets.rows(_results(place, "bodies", "case", "checks", "jets"))
    for name in QUICK_SCENES if quick else SCENES:
        yield from chart(name, quick, place)


def run_ahead(quick: bool, folder: Path, backend: Backend) -> None:
    """Run all cases and the grids of all maps side by side on a backend.

    The steps between those of a grid depend on its runs; they are left to `chart`.
    """
    variants = QUICK_VARIANTS if quick else VARIANTS
    named = [(case.name, variant.name, quick) for case in cases() for variant in variants]
    run_jobs(run_case, named, named, _results(folder, *_CATALOGUE), "cases", backend)
    names, grid = (QUICK_SCENES, maps.QUICK) if quick else (tuple(SCENES), maps.FULL)
    points = list(product(names, grid.dt, grid.sound, grid.xsph, [grid.share]))
    run_jobs(run_point, points, points, _results(folder, "maps"), "maps", backend)


def run_case(case: str, variant: str, quick: bool) -> runs.CaseOutcome:
    """Run a case of the catalogue in a variant; both go by name, since cases can't be pickled."""
    by_name = {each.name: each for each in cases()}
    changes = {each.name: each for each in VARIANTS}
    return runs.run(by_name[case], changes[variant], quick)


def run_point(name: str, dt: float, sound: float, xsph: float, share: float) -> maps.MapPoint:
    """Run a point of a scene's map: dt in multiples of 0.4 h / c0, sound speed of c0."""
    scene = maps.nominal(name)
    return maps.run(scene, dt * maps.unit(scene), sound, xsph, share)


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
                key = [case.name, variant.name, quick]
                outcomes.append((variant, results.get(key, compute, runs.outcome)))
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
