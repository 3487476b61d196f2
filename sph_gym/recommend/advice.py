"""Which settings to take for an error that is wanted or a time that is given."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym import scenes
from sph_gym.recommend.runs import CAREFUL, execute, rate
from sph_gym.recommend.series import FEWEST, Choice, MeasuredRun, Series, fit, noise_floor
from sph_gym.recommend.settings import Setting, nominal
from sph_gym.recommend.tables import read
from sph_gym.recommend.trial_runs import Probe, Settled, settle
from sph_gym.scenes.shared.refinement import Refinement, refinement
from sph_gym.solver.checks import known, positive

# Relative rounding error of an error that is asked for.
ROUNDING = 1e-9
# Runs of which a probe takes the median time, and seconds after which it makes no more.
PROBES, ENOUGH = 3, 0.5
# Seconds that a run of what would be recommended in another case may take.
AFFORDABLE = 10.0


class Advice(NamedTuple):
    """A recommendation.

    seconds: expected processor time of the run, on one thread; floor: the scene's noise floor;
    tried: the error of its own run in a case that nothing was measured in, NaN if that would have
    taken too long, None in the case of the tables; budget: seconds that were asked for; best:
    whether nothing that was measured promises less.
    """

    case: Refinement
    choice: Choice
    seconds: float
    floor: float = 0.0
    tried: float | None = None
    budget: float | None = None
    best: bool = False


class _Wish(NamedTuple):
    """An error or a budget [s], the other is None; speed: of this machine."""

    error: float | None
    budget: float | None
    speed: float = math.nan

    def choose(self, series: Sequence[Series]) -> Choice | None:
        if self.error is not None:
            return for_error(series, self.error)
        assert self.budget is not None
        return for_effort(series, self.budget * self.speed)


def for_error(series: Sequence[Series], error: float) -> Choice | None:
    """Return the cheapest choice that promises at most this error; None if there is none."""
    most = error * (1 + ROUNDING)
    within = [choice for each in series for choice in each.choices() if choice.promised <= most]
    return min(within, key=lambda choice: choice.effort, default=None)


def for_effort(series: Sequence[Series], effort: float) -> Choice | None:
    """Return the choice that promises least with at most this effort; None if there is none."""
    within = [choice for each in series for choice in each.choices() if choice.effort <= effort]
    return min(within, key=lambda choice: (choice.promised, choice.effort), default=None)


def advise(
    scene: str,
    error: float | None = None,
    budget: float | None = None,
    arguments: dict[str, Any] | None = None,
    table: Path | None = None,
    speed: float | None = None,
) -> Advice:
    """Return settings for a scene, for an error (a share) or a budget [s], whichever is given.

    arguments: of the scene, in which what would be recommended is run first, its coarsest setting
    before it, to correct or withdraw it; table: of runs, by default the one that comes with the
    package; speed: of this machine [benchmark particle-steps/s], measured if it isn't given. Raises
    ValueError for an unknown scene or argument or a scene that is erratic, if not exactly one of
    error and budget is given, and for an error or a budget below what was measured, with the range.
    """
    case = refinement(scene)
    if case.erratic:
        raise ValueError(f"scene: expected one whose errors fall with dx, got {scene!r}")
    case = replace(case, arguments=case.arguments | _checked(case, arguments or {}))
    wish = _checked_wish(error, budget)
    rows = read(scene, table)
    floor = floor_of(rows)
    series = offered(rows, floor)
    if not series:
        raise ValueError(f"table: expected a line of {FEWEST} resolutions of {scene}, got none")
    # before anything is timed
    if error is not None and wish.choose(series) is None:
        raise _out_of_reach(scene, series, wish, floor)
    wish = wish._replace(speed=rate(CAREFUL) if speed is None else speed)
    settled = Settled(wish.choose(series), series, math.nan, [])
    if arguments:
        settled = settle(series, wish.choose, _probe(case), AFFORDABLE * wish.speed)
    if settled.choice is None:
        raise _out_of_reach(scene, settled.series, wish, floor)
    best = for_effort(settled.series, math.inf) == settled.choice
    seconds, tried = settled.choice.effort / wish.speed, settled.error if arguments else None
    return Advice(case, settled.choice, seconds, floor, tried, budget, best)


def offered(rows: Iterable[MeasuredRun], floor: float) -> list[Series]:
    """Return the series of a scene that may be recommended."""
    return [series for series in fit(rows, floor).values() if series.safe]


def floor_of(rows: Sequence[MeasuredRun]) -> float:
    """Return the noise floor of a scene, by its own settings in a table; 0 without them."""
    if not rows:
        return 0.0
    own = nominal(refinement(rows[0].scene)).series
    return noise_floor(row for row in rows if row.setting.series == own)


def _probe(case: Refinement) -> Probe:
    """Return what runs a setting in a user's case; what takes long by itself is run once.

    The effort is the median of a few runs, each beside the benchmark.
    """

    def run(setting: Setting) -> tuple[float, float]:
        before, own, efforts = rate(), 0.0, list[float]()
        while not efforts or (len(efforts) < PROBES and own < ENOUGH):
            outcome = execute(case, setting)
            before, between = rate(), before
            own += outcome.own
            efforts.append(outcome.own * (before + between) / 2)
        return outcome.error, float(np.median(efforts))

    return run


def at_most_one(error: float) -> float:
    """Return an error that is a share. Raises ValueError above 1, where percents must be meant."""
    if error > 1:
        raise ValueError(
            f"error: expected a share of at most 1, got {error:g}: did you mean {error / 100:g}?"
        )
    return error


def _checked_wish(error: float | None, budget: float | None) -> _Wish:
    if (error is None) == (budget is None):
        raise ValueError("error, budget: expected one of the two, got both or none")
    if budget is not None:
        positive("budget", budget)
    if error is not None:
        at_most_one(positive("error", error))
    return _Wish(error, budget)


def _checked(case: Refinement, arguments: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments if the scene has them and they are of its kinds, else ValueError."""
    given = scenes.parameters(case.scene)
    for name, value in arguments.items():
        known(f"argument of {case.scene}", name, [n for n in given if n != "dx"])
        expected = float if isinstance(given[name], int | float) else type(given[name])
        if expected is float and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise ValueError(f"{name}: expected a number, got {value!r}")
        if expected is str and not isinstance(value, str):
            raise ValueError(f"{name}: expected a name, got {value!r}")
    if case.length in arguments:
        positive(case.length, arguments[case.length])
    return arguments


def _out_of_reach(scene: str, series: Sequence[Series], wish: _Wish, floor: float) -> ValueError:
    """Return the error that says what can be had instead."""
    if not series:
        return ValueError(f"{scene}: expected a case that holds out, but all settings blow up")
    ends = [choice for each in series for choice in (each.at(int(each.across[k])) for k in (0, -1))]
    if wish.error is not None:
        name, value, unit, what = "error", wish.error, "", "can be promised"
        values = [choice.promised for choice in ends]
    else:
        assert wish.budget is not None
        name, value, unit, what = "budget", wish.budget, " s", "was measured"
        values = [choice.effort / wish.speed for choice in ends]
    chance = " (errors below are within their scatter)" if floor and name == "error" else ""
    return ValueError(
        f"{name}: expected at least {min(values):.3g}{unit}, since for {scene} "
        f"{min(values):.3g} to {max(values):.3g}{unit} {what}{chance}, got {value:g}"
    )
