"""Whether recommendations keep their promise on runs that they were not fitted to."""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

from sph_gym.studies.accuracy import elsewhere, recommend
from sph_gym.studies.accuracy import lines as measured
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
# Of these, how many must have an answer in another case.
LEAST_REACHED = 3.0
# The error to expect between resolutions may be so many times the measured one: else, nobody would
# expect it.
CAREFUL = 2.0


class Trial(NamedTuple):
    """A recommendation that was tried out.

    other: the case, 0 for the one that was fitted; asked: the error that was asked for; answered:
    whether there was an answer in the end; early: measured / promised error of what would have been
    advised had it not been run first, infinite after a blow-up, NaN if nothing was.
    """

    other: int
    asked: float
    choice: Choice
    found: Point
    answered: bool = True
    early: float = math.nan


def samples(points: Sequence[Point]) -> list[Sample]:
    """The runs on lines, as the table has them; one that blew up has no error."""
    return [
        Sample(
            p.scene, p.setting, p.error if p.good else math.nan, p.effort, p.compression, p.mach
        )
        for p in points
    ]  # fmt: skip


# --- Trying ---------------------------------------------------------------------------------


def tried(
    scene: Problem, points: Sequence[Point], folder: Path, again: bool = False
) -> list[Trial]:
    """Recommendations between the fitted resolutions and in other cases, with their runs.

    None without a line, nor where errors lie within their scatter, since all promises are then the
    same. In other cases, anybody who asks is told what was run there; what is tried is the setting
    next to it, of which the same line makes a promise. again: take the times anew.
    """
    every = samples(points)
    lines = measured.fit(every)
    if not lines or measured.scatter(every):
        return []

    def run(setting: Setting, other: int, repeats: int = 1) -> Point:
        return point(scene, "promise", setting, folder, repeats, again, other)

    found = [
        Trial(0, asked, choice, run(choice.setting, 0))
        for choice, asked in _between(lines).items()
    ]  # fmt: skip
    for other in range(1, len(scene.others) + 1):
        for asked, choice, answered, early in _elsewhere(lines, _probe(partial(run, other=other))):
            ran = run(choice.setting, other)
            found.append(Trial(other, asked, choice, ran, answered, early))
    return found


def _probe(run: Callable[..., Point]) -> elsewhere.Probe:
    """Runs of another case, from the folder."""

    @cache
    def probe(setting: Setting) -> tuple[float, float]:
        found = run(setting, repeats=recommend.PROBES)
        return found.error if found.good else math.nan, found.effort

    return probe


def _targets(lines: Sequence[Line]) -> list[float]:
    """Errors to ask for."""
    best = min(float(line.promised[-1]) for line in lines)
    worst = max(float(line.promised[0]) for line in lines)
    return [worst * (best / worst) ** share for share in ASKED]


def _between(lines: Sequence[Line]) -> dict[Choice, float]:
    """Recommendations for these errors, none of them at a resolution that was fitted."""
    by_setting = {line.setting: line for line in lines}
    found: dict[Choice, float] = {}
    for target in _targets(lines):
        choice = recommend.for_error(lines, target)
        if choice is not None:
            line = by_setting[choice.setting.line]
            found.setdefault(_off_grid(line, choice.setting.across), target)
    return found


def _elsewhere(
    lines: Sequence[Line], probe: elsewhere.Probe
) -> Iterator[tuple[float, Choice, bool, float]]:
    """Of these errors in another case: what is next to the answer, if any, and how it came to it.

    The last two are those of a `Trial`.
    """
    for target in _targets(lines):

        def choose(lines: Sequence[Line], target: float = target) -> Choice | None:
            return recommend.for_error(lines, target)

        settled = elsewhere.settle(lines, choose, probe)
        early = math.nan
        if settled.trials:
            advised, error = settled.trials[0]
            early = error / advised.promised if error > 0 else math.inf
        if settled.choice is not None:
            own = settled.choice.setting
            line = next(line for line in settled.lines if line.setting == own.line)
            yield target, _off_grid(line, own.across), True, early
        elif settled.trials:
            yield target, advised, False, early


def _off_grid(line: Line, across: int) -> Choice:
    """The next finer choice at a resolution that wasn't measured, or else the next coarser."""
    last = int(line.across[-1])
    finer = [n for n in range(across, last) if n not in line.across]
    coarser = [n for n in range(across, 2, -1) if n not in line.across]
    return line.at((finer or coarser)[0])


# --- What came of it ------------------------------------------------------------------------


def rows(scene: Problem, trials: Sequence[Trial]) -> Iterator[Row]:
    """Measured over promised error and time, and how many errors are within reach elsewhere.

    Without a trial, a row that says so.
    """
    if not trials:
        yield Row("promises tried out", f"{scene.scene}, none: nothing to tell apart", 0, "")
    # different wishes may have the same answer
    for trial in {(trial.other, trial.choice): trial for trial in trials}.values():
        yield from _kept(scene, trial)
    for other in range(1, len(scene.others) + 1 if trials else 1):
        here = [trial for trial in trials if trial.other == other]
        case, n = f"{scene.scene}, {_case(scene, other)}", f" of {len(ASKED)} errors"
        blown = sum(math.isinf(trial.early) for trial in here)
        yield Row(f"blew up when tried and was withdrawn,{n}", case, blown, "")
        missed = sum(FACTOR < trial.early < math.inf for trial in here)
        yield Row(f"missed its promise when tried and was corrected,{n}", case, missed, "")
        reached = sum(trial.answered for trial in here)
        yield Row(f"within reach,{n}", case, reached, "", LEAST_REACHED, at_least=True)
    if not scene.others:
        yield Row("other cases", f"{scene.scene}, none: {scene.single}", 0, "")


def _kept(scene: Problem, trial: Trial) -> Iterator[Row]:
    choice, found = trial.choice, trial.found
    case = f"{scene.scene}, {_case(scene, trial.other)}, {100 * choice.promised:.2g} % promised"
    where = f"{case}, {choice.setting.across} across"
    if not trial.answered:
        return
    error, time = found.error / choice.promised, found.effort / choice.effort
    yield Row("measured / promised error", where, error if found.good else math.inf, "", FACTOR)
    yield Row("measured / expected time", where, time if found.good else math.inf, "", FACTOR)
    if found.good:
        share, own = found.error / choice.error, not trial.other
        yield Row("measured / expected error", where, share, "", FACTOR if own else None)
        yield Row("expected / measured error", where, 1 / share, "", CAREFUL if own else None)


def _case(scene: Problem, other: int) -> str:
    if not other:
        return "between resolutions"
    changed = scene.others[other - 1]
    return "other case: " + " ".join(f"{name}={value:g}" for name, value in changed.items())


def records(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """The trials as rows of a table: what was asked and promised, and what was measured."""
    return [
        {
            "scene": t.found.scene, "other_case": t.other, "asked": t.asked,
            "expected_error": t.choice.error, "promised_error": t.choice.promised,
            "error": t.found.error, "expected_effort": t.choice.effort, "effort": t.found.effort,
            "compression": t.found.compression, "mach": t.found.mach, "cause": t.found.cause,
            "answered": t.answered, "early": t.early, "key": t.found.key,
            **t.choice.setting._asdict(),
        }
        for t in trials
    ]  # fmt: skip
