"""Whether recommendations keep their promise on runs that they were not fitted to."""

import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from sph_gym.studies.accuracy import recommend
from sph_gym.studies.accuracy.points import Point, point
from sph_gym.studies.accuracy.problems import Problem
from sph_gym.studies.accuracy.recommend import Choice, Line, Sample
from sph_gym.studies.accuracy.settings import Setting
from sph_gym.studies.table import Row

# A run may have so many times the error and the time that it was recommended for.
FACTOR = 1.5
# Where between the largest and the smallest promise errors are asked for, on a log scale.
ASKED = (0.3, 0.7)


def samples(points: Sequence[Point]) -> list[Sample]:
    """The runs on lines, as the table has them; one that blew up has no error."""
    return [Sample(p.scene, p.setting, p.error if p.good else math.nan, p.effort) for p in points]


def rows(scene: Problem, points: Sequence[Point], folder: Path) -> Iterator[Row]:
    """Measured over promised error and time, between the fitted resolutions and in another case.

    Without a line, a row that fails. In the other case, the promise is corrected as it is for
    whoever asks for one.
    """
    lines = recommend.fit(samples(points))
    if not lines:
        print(f"{scene.scene}: no line without a blow-up", file=sys.stderr)
        yield Row("measured / promised error", f"{scene.scene}, no line", math.inf, "", FACTOR)
        return
    by_setting = {line.setting: line for line in lines}
    for choice in _asked(lines):
        yield from _kept(scene, choice, folder, False)
        if scene.other:
            line = recommend.corrected(by_setting[choice.setting.line], _probe(scene, folder))
            promise = line and line.at(choice.setting.across)
            yield from _kept(scene, promise or choice, folder, True)


def _kept(scene: Problem, choice: Choice, folder: Path, other: bool) -> Iterator[Row]:
    found = point(scene, "promise", choice.setting, folder, repeats=1, other=other)
    where = f"{scene.scene}, {_case(scene, other)}, {100 * choice.error:.2g} % promised"
    error, time = found.error / choice.error, found.effort / choice.effort
    yield Row("measured / promised error", where, error if found.good else math.inf, "", FACTOR)
    yield Row("measured / expected time", where, time if found.good else math.inf, "", FACTOR)


def _probe(scene: Problem, folder: Path) -> recommend.Probe:
    """Runs of the other case, from the folder."""

    def run(setting: Setting) -> tuple[float, float]:
        found = point(scene, "promise", setting, folder, recommend.PROBES, other=True)
        return found.error if found.good else math.nan, found.effort

    return run


def _case(scene: Problem, other: bool) -> str:
    if not other:
        return "between resolutions"
    return "other case: " + " ".join(f"{name}={value:g}" for name, value in scene.other.items())


def _asked(lines: Sequence[Line]) -> Iterator[Choice]:
    """Recommendations for some errors, none of them at a resolution that was fitted."""
    best = min(float(line.promised[-1]) for line in lines)
    worst = max(float(line.promised[0]) for line in lines)
    by_setting = {line.setting: line for line in lines}
    done = set()
    for share in ASKED:
        choice = recommend.for_error(lines, worst * (best / worst) ** share)
        if choice is None:
            continue
        line = by_setting[choice.setting.line]
        choice = _off_grid(line, choice.setting.across)
        if choice.setting not in done:
            done.add(choice.setting)
            yield choice


def _off_grid(line: Line, across: int) -> Choice:
    """The next finer choice at a resolution that wasn't measured, or else the next coarser."""
    last = int(line.across[-1])
    finer = [n for n in range(across, last) if n not in line.across]
    coarser = [n for n in range(across, 2, -1) if n not in line.across]
    return line.at((finer or coarser)[0])
