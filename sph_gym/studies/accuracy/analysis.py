"""Conclusions from points: Pareto fronts, elasticities, orders, and gains at equal error."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sph_gym.recommend import series
from sph_gym.recommend.settings import LONGEST
from sph_gym.scenes.shared.refinement import refinement
from sph_gym.studies.accuracy.points import Point

# Errors for which the cheapest settings are listed, and the cost by which they are the cheapest.
TARGETS = (0.05, 0.02, 0.01, 0.005)
TIME = "cost"
# Name of the knob of runs in which several were turned.
COMBINED = "combined"
# Knobs whose values are numbers, for which an elasticity makes sense.
NUMBERS = ("resolution", "width", "step", "sound", "xsph")
# A knob that changes the cost by less than this factor has no elasticity: a slope over so short a
# way changes its sign with the noise.
NOTICED = 1.5
# Relative difference of errors that are equal.
ROUNDING = 1e-9
# Resolutions at which a value must have been tried: at one, its error may just cross zero.
FEWEST = 2


class Gain(NamedTuple):
    """Gain in speed at equal error: how many times faster.

    bound: ">" or "<" where it is at least or at most so, "" where it was interpolated.
    """

    gain: float
    bound: str = ""


class ValueGain(NamedTuple):
    """A value of a knob against the nominal one: factors are medians over all resolutions.

    gain: how many times faster at equal error; NaN at a single resolution or after a blow-up.
    bound: as of a `Gain`.
    """

    knob: str
    value: str
    error_factor: float
    time_factor: float
    work_factor: float
    gain: float
    sizes: int
    cause: str
    bound: str = ""


# --- Choosing points ------------------------------------------------------------------------


def nominal_series(points: Iterable[Point]) -> list[Point]:
    """Return the nominal settings at all resolutions, the nominal one first."""
    return [found for found in points if found.knob in ("nominal", "resolution")]


def knobs(points: Iterable[Point]) -> list[str]:
    """Return those that were turned alone, in the order of the points."""
    alone = dict.fromkeys(found.knob for found in points)
    return [knob for knob in alone if knob not in ("nominal", COMBINED)]


def value_of(point: Point, knob: str) -> str:
    """Return the value of a knob as text."""
    return str(getattr(point.setting, knob))


def count(points: Sequence[Point]) -> list[Point]:
    """Return the points of a scene in series that count, each with the error that counts.

    See `sph_gym.recommend.series`.
    """
    kept = series.fit(points, series.noise_floor(nominal_series(points)))
    errors = {
        own._replace(across=int(n)): float(error)
        for own, found in kept.items()
        for n, error in zip(found.across, found.error, strict=True)
    }
    return [replace(p, error=errors[p.setting]) for p in points if p.setting in errors]


def at_usual_speed(points: Sequence[Point]) -> list[Point]:
    """Return points with times as if the machine had always had its median speed.

    Its speed is that of the benchmark beside each run; a machine that is shared changes it.
    """
    rates = [found.rate for found in points if math.isfinite(found.rate)]
    speed = float(np.median(rates)) if rates else math.nan
    return [replace(found, speed=speed) for found in points]


# --- Fronts ---------------------------------------------------------------------------------


def pareto_front(runs: Iterable[Point], cost: str) -> list[Point]:
    """Return the runs that no other beats in both error and cost, the cheapest first."""
    best: list[Point] = []
    for run in sorted(runs, key=lambda run: (getattr(run, cost), run.error)):
        if run.good and (not best or run.error < best[-1].error):
            best.append(run)
    return best


def front(points: Sequence[Point], cost: str) -> list[Point]:
    """Return the Pareto front of the points that count; none where errors differ by chance."""
    return [] if chance(points) else pareto_front(count(points), cost)


def cheapest(runs: Iterable[Point], target: float, cost: str = TIME) -> Point | None:
    """Return the run with the least cost whose error is at most `target`; None if there is none."""
    within = [run for run in runs if run.good and run.error <= target]
    return min(within, key=lambda run: float(getattr(run, cost)), default=None)


def chance(points: Sequence[Point]) -> str:
    """Return what chance has to do with a scene's errors; "" where they fall steadily with dx."""
    case = refinement(points[0].scene)
    if is_flat(nominal_series(points), TIME):
        return "errors within scatter"
    return "errors partly chance" if case.erratic or case.order is None else ""


# --- Cost of an error -----------------------------------------------------------------------


def is_flat(runs: Iterable[Point], cost: str) -> bool:
    """Return whether errors hardly fall along a refinement series."""
    good = [run for run in runs if run.good]
    return series.is_flat([getattr(run, cost) for run in good], [run.error for run in good])


def cost_at(costs: Sequence[float], errors: Sequence[float], error: float) -> Gain:
    """Return what a refinement series costs at an error, on log scales; bound as of the cost.

    costs, errors: coarse first. An error counts as much as those of finer runs.
    """
    worst = series.envelope(errors)
    if error >= worst[0] * (1 - ROUNDING):
        return Gain(costs[0], "<" if error > worst[0] * (1 + ROUNDING) else "")
    reached = np.flatnonzero(worst <= error * (1 + ROUNDING))
    if not len(reached):
        return Gain(costs[-1], ">")
    k = int(reached[0])
    share = math.log(worst[k - 1] / error) / math.log(worst[k - 1] / worst[k])
    return Gain(costs[k - 1] * (costs[k] / costs[k - 1]) ** min(share, 1.0))


def gain_of_run(
    errors: tuple[float, float], costs: tuple[float, float], own: Sequence[Point], cost: str
) -> Gain:
    """Return how many times faster a run is than the nominal settings would be at its error.

    errors, costs: of the nominal settings and of the run, at one resolution; own: the nominal runs
    at all resolutions, between which it is interpolated; beyond their errors there is only a bound.
    Where they don't fall, errors within their scatter are equal.
    """
    good = sorted((run for run in own if run.good), key=lambda run: float(getattr(run, cost)))
    prices = [float(getattr(run, cost)) for run in good]
    if is_flat(good, cost):
        within = errors[1] <= max(run.error for run in good)
        return Gain(costs[0] / costs[1]) if within else Gain(prices[0] / costs[1], "<")
    found = cost_at(prices, [run.error for run in good], errors[1])
    return Gain(found.gain / costs[1], found.bound)


def gain_of_series(own: Sequence[Point], tried: Sequence[Point], cost: str) -> Gain:
    """Return how many times faster one setting is than the nominal one at equal error.

    own: the nominal runs at all resolutions; tried: those of the setting. An error counts as much
    as those of finer runs of its kind, as far as both have them, and of all resolutions the (lower)
    median counts: of those whose errors the nominal runs reach, if there are two, else of all. NaN
    unless it went well at two of them.
    """
    if not all(run.good for run in tried):
        return Gain(math.nan)
    theirs = {run.setting.across: run for run in tried}
    known = {run.setting.across: run for run in own if run.good and run.setting.across in theirs}
    if len(known) < FEWEST:
        return Gain(math.nan)
    # without finer nominal runs that are worse than all that both have
    finest = max(known)
    comparable = [
        run
        for run in own
        if run.good and (run.setting.across <= finest or run.error <= known[finest].error)
    ]
    found = []
    for across, start in known.items():
        errors = [max(runs[n].error for n in known if n >= across) for runs in (known, theirs)]
        costs = getattr(start, cost), getattr(theirs[across], cost)
        found.append(gain_of_run((errors[0], errors[1]), costs, comparable, cost))
    inside = [gain for gain in found if not gain.bound]
    counted = inside if len(inside) >= FEWEST else found
    return sorted(counted)[(len(counted) - 1) // 2]


# --- Gains of knobs -------------------------------------------------------------------------


def value_gains(points: Sequence[Point], knob: str, cost: str) -> list[ValueGain]:
    """Return the gain of every value of a knob that was turned alone."""
    groups: dict[str, list[Point]] = {}
    for found in points:
        if found.knob == knob:
            groups.setdefault(value_of(found, knob), []).append(found)
    return [_value(knob, nominal_series(points), runs, cost) for runs in groups.values()]


def _value(knob: str, own: Sequence[Point], runs: Sequence[Point], cost: str) -> ValueGain:
    known = {run.setting.across: run for run in own if run.good}
    pairs = [(known[r.setting.across], r) for r in runs if r.good and r.setting.across in known]
    error, time, work = (
        float(np.median([getattr(run, name) / getattr(start, name) for start, run in pairs]))
        if pairs
        else math.nan
        for name in ("error", cost, "interactions")
    )
    gain, bound = gain_of_series(own, runs, cost)
    cause = next((run.cause for run in runs if not run.good), "")
    value = value_of(runs[0], knob)
    return ValueGain(knob, value, error, time, work, gain, len(pairs), cause, bound)


def best_value(
    points: Sequence[Point],
    knob: str,
    cost: str,
    among: Callable[[str], bool] = lambda value: True,
) -> ValueGain | None:
    """Return the value with the largest gain; None where none went well.

    among: which values are looked at. The gain is then that over all resolutions at which the value
    was run, the finer ones too. A value that makes the fluid too soft has no gain, nor does one
    whose errors stop falling there, nor a step beyond the longest that is recommended.
    """
    own, found = nominal_series(points), []
    for value in value_gains(points, knob, cost):
        turned = next(p for p in points if p.knob == knob and value_of(p, knob) == value.value)
        runs = [p for p in points if p.setting.series == turned.setting.series]
        allowed = among(value.value) and (knob != "step" or turned.setting.step <= LONGEST)
        if math.isnan(value.gain) or not allowed or series.too_soft(runs):
            continue
        if not _stops_falling(own, runs):
            found.append(_value(knob, own, runs, cost))
    found = [value for value in found if math.isfinite(value.gain)]
    # a gain that is only known to be at most so comes last
    return max(found, key=lambda value: (value.bound != "<", value.gain), default=None)


def _stops_falling(own: Sequence[Point], runs: Sequence[Point]) -> bool:
    """Return whether errors come to rest or grow at the fine end, where the nominal ones fall."""
    if not all(run.good for run in runs) or len(runs) < len(own):
        return False
    return series.falls(*series.errors_of(own)) and not series.falls(*series.errors_of(runs))


def best_gain(points: Sequence[Point], cost: str) -> Gain:
    """Return how many times faster the best setting is at equal error; NaN where chance decides.

    Of all series and of single knobs, by the same measure; what is at most so doesn't count.
    """
    if chance(points):
        return Gain(math.nan)
    own = nominal_series(points)
    every = [gain_of_series(own, runs, cost) for runs in series.group(count(points)).values()]
    for knob in (name for name in knobs(points) if name != "resolution"):
        best = best_value(points, knob, cost)
        every += [Gain(best.gain, best.bound)] if best else []
    known = [gain for gain in every if math.isfinite(gain.gain) and gain.bound != "<"]
    return max(known, default=Gain(math.nan))


def elasticity(runs: Iterable[Point], cost: str) -> float:
    """Return d log error / d log cost over some runs; NaN where the cost hardly changes."""
    good = [run for run in runs if run.good]
    costs = [float(getattr(run, cost)) for run in good]
    if len(good) < 2 or max(costs) < NOTICED * min(costs):
        return math.nan
    return series.slope(costs, [run.error for run in good])


def knob_elasticity(points: Sequence[Point], knob: str, cost: str) -> float:
    """Return d log error / d log cost over the values of a knob; the median over resolutions."""
    own = nominal_series(points)
    if knob not in NUMBERS:
        return math.nan
    if knob == "resolution":
        return elasticity(own, cost)
    found = []
    for start in own:
        across = start.setting.across
        turned = [p for p in points if p.knob == knob and p.setting.across == across]
        found.append(elasticity([start, *turned], cost))
    found = [slope for slope in found if math.isfinite(slope)]
    return float(np.median(found)) if found else math.nan
