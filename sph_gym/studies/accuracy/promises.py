"""Promises of recommendations, checked by runs that they were not made from."""

import math
from collections.abc import Iterator, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

from sph_gym.recommend.advice import PROBES, for_error, offered
from sph_gym.recommend.series import Choice, Series, noise_floor
from sph_gym.recommend.settings import Setting
from sph_gym.recommend.trial_runs import Probe, settle
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.studies.accuracy.analysis import nominal_series
from sph_gym.studies.accuracy.points import Point, Sampling, measure_point
from sph_gym.studies.table import Row

# A run may have so many times the error and the time that it was recommended for.
FACTOR = 1.5
# Where between the largest and the smallest promise errors are asked for, on a log scale.
ASKED = (0.05, 0.3, 0.5, 0.7, 0.95)
# How many of these must have an answer in another case.
LEAST_REACHED = 3.0
# The error to expect between resolutions may be so many times the measured one.
CAREFUL = 2.0


class TriedRecommendation(NamedTuple):
    """A recommendation that was tried out.

    other: the case, 0 for the one of the table; asked: the error that was asked for; answered:
    whether there was an answer in the end; early: measured / promised error of what would have been
    recommended had it not been run first, infinite after a blow-up, NaN if nothing was.
    """

    other: int
    asked: float
    choice: Choice
    found: Point
    answered: bool = True
    early: float = math.nan


def try_out(
    case: Refinement, points: Sequence[Point], sampling: Sampling
) -> list[TriedRecommendation]:
    """Return recommendations between the measured resolutions and in other cases, with their runs.

    None without a series to recommend, nor where errors lie within their scatter, since all
    promises are then the same. In other cases, what is recommended was run there already; what is
    tried is the setting next to it, of which the same series makes a promise.
    """
    floor = noise_floor(nominal_series(points))
    series = offered(points, floor)
    if not series or floor:
        return []

    def run(setting: Setting, other: int, repeats: int = 1) -> Point:
        once = sampling._replace(repeats=repeats)
        return measure_point(case, "promise", setting, once, other)

    found = [
        TriedRecommendation(0, asked, choice, run(choice.setting, 0))
        for choice, asked in _between(series).items()
    ]
    for other in range(1, len(case.others) + 1):

        @cache
        def probe(setting: Setting, other: int = other) -> tuple[float, float]:
            tried = run(setting, other, PROBES)
            return tried.error if tried.good else math.nan, tried.effort

        for asked, choice, answered, early in _in_other_case(series, probe):
            there = run(choice.setting, other)
            found.append(TriedRecommendation(other, asked, choice, there, answered, early))
    return found


def _targets(series: Sequence[Series]) -> list[float]:
    """Return errors to ask for."""
    best = min(float(each.promised[-1]) for each in series)
    worst = max(float(each.promised[0]) for each in series)
    return [worst * (best / worst) ** share for share in ASKED]


def _between(series: Sequence[Series]) -> dict[Choice, float]:
    """Return recommendations for these errors, none of them at a resolution that was measured."""
    by_setting = {each.setting: each for each in series}
    found: dict[Choice, float] = {}
    for target in _targets(series):
        choice = for_error(series, target)
        if choice is not None:
            own = choice.setting
            found.setdefault(_off_grid(by_setting[own.series], own.across), target)
    return found


def _in_other_case(
    series: Sequence[Series], probe: Probe
) -> Iterator[tuple[float, Choice, bool, float]]:
    """Yield for each error that has one what is next to the answer in another case.

    The last two entries are those of a `TriedRecommendation`.
    """
    for target in _targets(series):
        settled = settle(series, partial(for_error, error=target), probe)
        early = math.nan
        if settled.trials:
            advised, error = settled.trials[0]
            early = error / advised.promised if error > 0 else math.inf
        if settled.choice is not None:
            own = settled.choice.setting
            left = next(each for each in settled.series if each.setting == own.series)
            yield target, _off_grid(left, own.across), True, early
        elif settled.trials:
            yield target, advised, False, early


def _off_grid(series: Series, across: int) -> Choice:
    """Return the next finer choice that wasn't measured, or else the next coarser one."""
    finer = [n for n in range(across, int(series.across[-1])) if n not in series.across]
    coarser = [n for n in range(across, 2, -1) if n not in series.across]
    return series.at((finer or coarser)[0])


def rows(case: Refinement, trials: Sequence[TriedRecommendation]) -> Iterator[Row]:
    """Yield measured over promised error and time, and how many errors are within reach elsewhere.

    Without a trial, a row that says so.
    """
    name = case.scene
    if not trials:
        yield Row("promises tried out", f"{name}, none: nothing to tell apart", 0, "")
    # different wishes may have the same answer
    for trial in {(trial.other, trial.choice): trial for trial in trials}.values():
        if trial.answered:
            yield from _kept(f"{name}, {_title(case, trial.other)}", trial)
    for other in range(1, len(case.others) + 1 if trials else 1):
        here = [trial for trial in trials if trial.other == other]
        title, n = f"{name}, {_title(case, other)}", f" of {len(ASKED)} errors"
        blown = sum(math.isinf(trial.early) for trial in here)
        yield Row(f"blew up when tried and was withdrawn,{n}", title, blown, "")
        missed = sum(FACTOR < trial.early < math.inf for trial in here)
        yield Row(f"missed its promise when tried and was corrected,{n}", title, missed, "")
        reached = sum(trial.answered for trial in here)
        yield Row(f"within reach,{n}", title, reached, "", LEAST_REACHED, at_least=True)
    if not case.others:
        yield Row("other cases", f"{name}, none: {case.single}", 0, "")


def _kept(title: str, trial: TriedRecommendation) -> Iterator[Row]:
    choice, found = trial.choice, trial.found
    where = f"{title}, {100 * choice.promised:.2g} % promised, {choice.setting.across} across"
    error, time = found.error / choice.promised, found.effort / choice.effort
    yield Row("measured / promised error", where, error if found.good else math.inf, "", FACTOR)
    yield Row("measured / expected time", where, time if found.good else math.inf, "", FACTOR)
    if found.good:
        share, own = found.error / choice.error, not trial.other
        yield Row("measured / expected error", where, share, "", FACTOR if own else None)
        yield Row("expected / measured error", where, 1 / share, "", CAREFUL if own else None)


def _title(case: Refinement, other: int) -> str:
    if not other:
        return "between resolutions"
    changed = case.others[other - 1]
    return "other case: " + " ".join(f"{name}={value:g}" for name, value in changed.items())


def records(trials: Sequence[TriedRecommendation]) -> list[dict[str, Any]]:
    """Return the trials as rows of a table: what was asked and promised, and what was measured."""
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
