"""What each knob buys: its values against the nominal ones, at several resolutions each."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from sph_gym.studies.accuracy import fronts, trust
from sph_gym.studies.accuracy.fronts import Known, Worth
from sph_gym.studies.accuracy.settings import Setting

# Resolutions at which a value must have been tried: at one, its error may just cross zero.
FEWEST = 2
# Of the stable step: nobody is advised to go beyond it, for the limit is near, and where it lies
# depends on all the rest.
LONGEST = 1.5


class Tried(Known, Protocol):
    """A run that knows its setting."""

    @property
    def setting(self) -> Setting:
        """Of all knobs."""

    @property
    def compression(self) -> float:
        """As of an `Outcome`."""

    @property
    def mach(self) -> float:
        """As of an `Outcome`."""


class Turned(Tried, Protocol):
    """One that knows which knob was turned."""

    @property
    def knob(self) -> str:
        """Its name."""


Run = TypeVar("Run", bound=Turned)


class Value(NamedTuple):
    """A value of a knob, against the nominal one: factors are medians over all resolutions.

    gain: how many times faster at equal error; NaN at a single resolution or after a blow-up.
    bound: ">" or "<" where the gain is only known to be at least or at most that.
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


def gain(ladder: Sequence[Tried], tried: Sequence[Tried], cost: str) -> float:
    """How many times faster one setting is than the nominal one at equal error."""
    return bounded(ladder, tried, cost).gain


def bounded(ladder: Sequence[Tried], tried: Sequence[Tried], cost: str) -> Worth:
    """The same, with what is only a bound marked.

    ladder: the nominal runs at all resolutions; tried: those of the setting. An error counts as
    much as those of finer runs of its kind, as far as both have them, and of all resolutions the
    (lower) median counts: of those whose errors the nominal runs reach, if there are two, else of
    all. NaN unless it went well at two of them.
    """
    if not all(run.good for run in tried):
        return Worth(math.nan)
    theirs = {run.setting.across: run for run in tried}
    known = {run.setting.across: run for run in ladder if run.good and run.setting.across in theirs}
    found = []
    for across, start in known.items():
        errors = _error(known, across), _error({n: theirs[n] for n in known}, across)
        costs = getattr(start, cost), getattr(theirs[across], cost)
        found.append(fronts.worth(errors, costs, _comparable(ladder, known), cost))
    inside = [worth for worth in found if not worth.bound]
    counted = inside if len(inside) >= FEWEST else found
    return sorted(counted)[(len(counted) - 1) // 2] if len(found) >= FEWEST else Worth(math.nan)


def _comparable(ladder: Sequence[Tried], known: Mapping[int, Tried]) -> list[Tried]:
    """The nominal runs, without finer ones that are worse than all that both have."""
    finest = max(known)
    most = known[finest].error
    return [r for r in ladder if r.good and (r.setting.across <= finest or r.error <= most)]


def _error(runs: Mapping[int, Tried], across: int) -> float:
    """At a resolution, or at a finer one if it is larger there."""
    return max(run.error for n, run in runs.items() if n >= across)


def values(points: Sequence[Run], knob: str, cost: str) -> list[Value]:
    """Every value of a knob that was turned alone."""
    ladder = _ladder(points)
    groups: dict[str, list[Run]] = {}
    for found in points:
        if found.knob == knob:
            groups.setdefault(str(getattr(found.setting, knob)), []).append(found)
    return [_value(knob, value, ladder, runs, cost) for value, runs in groups.items()]


def _ladder(points: Sequence[Run]) -> list[Run]:
    return [found for found in points if found.knob in ("nominal", "resolution")]


def _value(knob: str, value: str, ladder: Sequence[Run], runs: Sequence[Run], cost: str) -> Value:
    known = {run.setting.across: run for run in ladder if run.good}
    pairs = [(known[r.setting.across], r) for r in runs if r.good and r.setting.across in known]
    error, time, work = (_factor(pairs, name) for name in ("error", cost, "interactions"))
    cause = next((str(getattr(r, "cause", "")) for r in runs if not r.good), "")
    found = bounded(ladder, runs, cost)
    return Value(knob, value, error, time, work, found.gain, len(pairs), cause, found.bound)


def _factor(pairs: Sequence[tuple[Run, Run]], name: str) -> float:
    """By which a run has more of something than the nominal one: the median."""
    found = [getattr(run, name) / getattr(start, name) for start, run in pairs]
    return float(np.median(found)) if found else math.nan


def best(
    points: Sequence[Run], knob: str, cost: str, among: Callable[[str], bool] = lambda value: True
) -> Value | None:
    """The value that buys most where all were tried; None where none went well there.

    among: which values are looked at. What it buys is then told of all resolutions at which it was
    run, the finer ones too. A value that makes mush of the fluid buys nothing, nor does one whose
    errors stop falling there.
    """
    bold = {str(p.setting.step) for p in points if p.setting.step > LONGEST}
    known = [value for value in values(points, knob, cost) if math.isfinite(value.gain)]
    known = [value for value in known if among(value.value)]
    allowed = [value for value in known if knob != "step" or value.value not in bold]
    ladder, found = _ladder(points), []
    for value in allowed:
        runs = _alike(points, knob, value)
        if not trust.mush(runs) and not _stops_falling(ladder, runs):
            found.append(_value(knob, value.value, ladder, runs, cost))
    found = [value for value in found if math.isfinite(value.gain)]
    # what is only known to be at most so comes last
    return max(found, key=lambda value: (value.bound != "<", value.gain), default=None)


def _stops_falling(ladder: Sequence[Run], runs: Sequence[Run]) -> bool:
    """Whether errors come to rest or grow at the fine end, where the nominal ones fall."""
    if not all(run.good for run in runs) or len(runs) < len(ladder):
        return False
    both = (
        np.array(sorted((r.setting.across, r.error) for r in kind)).T for kind in (ladder, runs)
    )
    own, theirs = (trust.falls(across, errors) for across, errors in both)
    return own and not theirs


def _alike(points: Sequence[Run], knob: str, value: Value) -> list[Run]:
    """All runs in which only this knob has this value, also those that were made for a line."""
    turned = next(
        p for p in points if p.knob == knob and str(getattr(p.setting, knob)) == value.value
    )
    return [p for p in points if p.setting.line == turned.setting.line]


def elasticity(points: Sequence[Run], knob: str, cost: str) -> float:
    """d log error / d log cost over the values of a knob; the median over all resolutions."""
    ladder = _ladder(points)
    if knob == "resolution":
        return fronts.elasticity(ladder, cost)
    found = []
    for start in ladder:
        across = start.setting.across
        turned = [p for p in points if p.knob == knob and p.setting.across == across]
        found.append(fronts.elasticity([start, *turned], cost))
    found = [slope for slope in found if math.isfinite(slope)]
    return float(np.median(found)) if found else math.nan
