"""The confusion matrix: which link the doctor finds for each of the faults that it knows."""

import multiprocessing
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import NamedTuple

from sph_gym.doctor.checkup import check_solver
from sph_gym.doctor.diagnosis import LINKS
from sph_gym.doctor.faults import FAULTS, make
from sph_gym.doctor.faults.protocol import Wrapped
from sph_gym.doctor.subject import Factory
from sph_gym.solver.teams import most_threads

# How much a solver shows: all that it has, or positions and velocities alone.
ALL, BARE = "all", "x and v"
NOTHING = "nothing"


class DiagnosisOutcome(NamedTuple):
    """Outcome of a diagnosis: the solver, its broken link, the one found, and by which check.

    link, found: "" for a healthy solver, and where nothing was found.
    """

    name: str
    link: str
    found: str
    check: str

    @property
    def is_right(self) -> bool:
        """Return whether the link that was found is the broken one."""
        return self.found == self.link


def measure(names: Sequence[str] = tuple(FAULTS), shows: str = ALL) -> Iterator[DiagnosisOutcome]:
    """Yield the outcome for each fault, examined on all processors; shows: ALL or BARE."""
    chosen = [(name, FAULTS[name].link, partial(make, name)) for name in names]
    return examine_all(chosen, shows)


def examine_all(
    solvers: Iterable[tuple[str, str, Callable[[], Factory]]], shows: str = ALL
) -> Iterator[DiagnosisOutcome]:
    """Yield the outcomes for solvers, each a name, its broken link, and what makes its factory."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(most_threads(), mp_context=context) as pool:
        yield from pool.map(partial(examine, shows=shows), *zip(*solvers, strict=True))


def examine(
    name: str, link: str, factory: Callable[[], Factory], shows: str = ALL
) -> DiagnosisOutcome:
    """Return the outcome for one solver."""
    made = factory()
    first = check_solver(partial(Wrapped, make=made) if shows == BARE else made).first
    return DiagnosisOutcome(name, link, *((first.link, first.check) if first else ("", "")))


def show(outcomes: Iterable[DiagnosisOutcome]) -> int:
    """Print outcomes as they come, and how often which link was found; return 1 if one is wrong."""
    seen = []
    for one in outcomes:
        seen.append(one)
        verdict = "" if one.is_right else "  WRONG"
        print(
            f"{one.link:<12}{one.name:<30}{one.found or NOTHING:<12}{one.check}{verdict}".rstrip(),
            flush=True,
        )
    print("", *table(seen), "", summary(seen), sep="\n")
    return int(not all(one.is_right for one in seen))


def table(outcomes: Sequence[DiagnosisOutcome]) -> list[str]:
    """Return lines of text: broken links downwards, links found across."""
    counts = Counter((one.link, one.found) for one in outcomes)
    across = [*LINKS, ""]
    lines = ["broken".ljust(12) + "".join(f"{link or NOTHING:>12}" for link in across)]
    for link in LINKS:
        cells = "".join(f"{counts[link, found] or '.':>12}" for found in across)
        lines.append(f"{link:<12}{cells}")
    return lines


def summary(outcomes: Sequence[DiagnosisOutcome]) -> str:
    """Return how many faults were found, and how many at the right link."""
    found, right = sum(bool(one.found) for one in outcomes), sum(one.is_right for one in outcomes)
    return f"{found} of {len(outcomes)} faults found, {right} at the right link"
