"""Whether recommendations keep their promise on runs that they were not fitted to."""

import math
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from sph_gym.studies.accuracy import lines as measured
from sph_gym.studies.accuracy import recommend
from sph_gym.studies.accuracy.lines import Choice, Line
from sph_gym.studies.accuracy.points import Point, point
from sph_gym.studies.accuracy.problems import Problem
from sph_gym.studies.accuracy.samples import Sample
from sph_gym.studies.accuracy.settings import Setting
from sph_gym.studies.table import Row

# A run may have so many times the error and the time that it was recommended for.
FACTOR = 1.5
# Where between the largest and the smallest promise errors are asked for, on a log scale.
ASKED = (0.05, 0.3, 0.5, 0.7, 0.95)


class Shelf(NamedTuple):
    """Where runs are kept, and whether their times are taken anew."""

    folder: Path
    again: bool = False


def samples(points: Sequence[Point]) -> list[Sample]:
    """The runs on lines, as the table has them; one that blew up has no error."""
    return [Sample(p.scene, p.setting, p.error if p.good else math.nan, p.effort) for p in points]


def rows(
    scene: Problem, points: Sequence[Point], folder: Path, again: bool = False
) -> Iterator[Row]:
    """Measured over promised error and time, between the fitted resolutions and in another case.

    Without a line, a row that fails. In the other case, what is tried is what anybody would be
    told who asks for it. again: take the times anew.
    """
    lines = measured.fit(samples(points))
    if not lines:
        print(f"{scene.scene}: no line without a blow-up", file=sys.stderr)
        yield Row("measured / promised error", f"{scene.scene}, no line", math.inf, "", FACTOR)
        return
    shelf = Shelf(folder, again)
    for choice in _between(lines):
        yield from _kept(scene, choice, shelf, False)
    if scene.other:
        answers = _elsewhere(lines, _probe(scene, shelf))
        yield Row("errors asked for in the other case", scene.scene, len(ASKED), "")
        yield Row("of these within reach", scene.scene, len(answers), "")
        for choice in dict.fromkeys(answers):
            yield from _kept(scene, choice, shelf, True)


def _kept(scene: Problem, choice: Choice, shelf: Shelf, other: bool) -> Iterator[Row]:
    found = point(scene, "promise", choice.setting, shelf.folder, 1, shelf.again, other)
    case = f"{scene.scene}, {_case(scene, other)}, {100 * choice.promised:.2g} % promised"
    where = f"{case}, {choice.setting.across} across"
    error, time = found.error / choice.promised, found.effort / choice.effort
    yield Row("measured / promised error", where, error if found.good else math.inf, "", FACTOR)
    yield Row("measured / expected time", where, time if found.good else math.inf, "", FACTOR)
    if found.good:
        yield Row("promised / measured error", where, 1 / error, "")
        yield Row("measured / expected error", where, found.error / choice.error, "")


def _probe(scene: Problem, shelf: Shelf) -> recommend.Probe:
    """Runs of the other case, from the folder."""

    @cache
    def run(setting: Setting) -> tuple[float, float]:
        found = point(
            scene, "promise", setting, shelf.folder, recommend.PROBES, shelf.again, other=True
        )
        return found.error if found.good else math.nan, found.effort

    return run


def _case(scene: Problem, other: bool) -> str:
    if not other:
        return "between resolutions"
    return "other case: " + " ".join(f"{name}={value:g}" for name, value in scene.other.items())


def _targets(lines: Sequence[Line]) -> list[float]:
    """Errors to ask for."""
    best = min(float(line.promised[-1]) for line in lines)
    worst = max(float(line.promised[0]) for line in lines)
    return [worst * (best / worst) ** share for share in ASKED]


def _between(lines: Sequence[Line]) -> list[Choice]:
    """Recommendations for these errors, none of them at a resolution that was fitted."""
    by_setting = {line.setting: line for line in lines}
    found = []
    for target in _targets(lines):
        choice = recommend.for_error(lines, target)
        if choice is not None:
            found.append(_off_grid(by_setting[choice.setting.line], choice.setting.across))
    return list(dict.fromkeys(found))


def _elsewhere(lines: Sequence[Line], probe: recommend.Probe) -> list[Choice]:
    """Recommendations for these errors in the other case, as far as it can have them.

    One that is the very run that corrected it gives way to the next finer.
    """
    found = []
    for target in _targets(lines):

        def choose(lines: Sequence[Line], target: float = target) -> Choice | None:
            return recommend.for_error(lines, target)

        choice, settled = recommend.settle(lines, choose, probe)
        if choice is not None:
            line = next(line for line in settled if line.setting == choice.setting.line)
            probed = choice.setting.across == line.across[0]
            found.append(_off_grid(line, choice.setting.across) if probed else choice)
    return found


def _off_grid(line: Line, across: int) -> Choice:
    """The next finer choice at a resolution that wasn't measured, or else the next coarser."""
    last = int(line.across[-1])
    finer = [n for n in range(across, last) if n not in line.across]
    coarser = [n for n in range(across, 2, -1) if n not in line.across]
    return line.at((finer or coarser)[0])
