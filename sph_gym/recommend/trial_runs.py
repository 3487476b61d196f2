"""Cases that no series was measured in: what is chosen is run there first, and corrected by it."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from sph_gym.recommend.series import Choice, Series
from sph_gym.recommend.settings import Setting

# Factor on what is promised for settings that weren't run in the case themselves.
MARGIN = 1.25
# How many choices are tried out in a case, and of how many series the finest setting is run, where
# none promises enough.
MOST_TRIALS, MOST_FINEST = 12, 2

# Runs a setting in a case: its error, NaN after a blow-up, and its effort.
Probe = Callable[[Setting], tuple[float, float]]
# Error and effort of the runs of a series in a case, by particles across.
TrialRuns = dict[int, tuple[float, float]]


def corrected(series: Series, runs: TrialRuns) -> Series:
    """Return a series as it is in a case that it wasn't measured in, by some runs there.

    Errors and promises grow by measured / expected error, and never shrink, since a small error
    may be luck; efforts change by measured / expected effort; between the runs, on logarithmic
    scales. What was run itself has no doubt, and everything else a margin.
    """
    if not runs:
        return series
    ran = sorted(runs)
    there = [series.at(n) for n in ran]
    larger = [max(runs[n][0] / expected.error, 1.0) for n, expected in zip(ran, there, strict=True)]
    slower = [runs[n][1] / expected.effort for n, expected in zip(ran, there, strict=True)]
    nodes = sorted({*map(int, series.across), *ran})
    known_at = [series.at(n) for n in nodes]
    factor, pace = (
        np.exp(np.interp(np.log(nodes), np.log(ran), np.log(ratio))) for ratio in (larger, slower)
    )
    error, promised, effort, compression, mach = np.array([choice[1:] for choice in known_at]).T
    error = factor * error
    exact = tuple((n, float(error[nodes.index(n)])) for n in ran)
    return Series(
        series.setting, np.array(nodes, float), error, MARGIN * factor * promised, pace * effort,
        compression, mach, exact,
    )  # fmt: skip


class _Case:
    """Series that are left in a case, and what was run of them there."""

    def __init__(self, series: Sequence[Series], probe: Probe) -> None:
        self.left = {each.setting: each for each in series}
        self.ran: dict[Setting, TrialRuns] = {each.setting: {} for each in series}
        self.probe = probe

    def series(self) -> list[Series]:
        """Return what is left, as corrected so far."""
        return [corrected(each, self.ran[own]) for own, each in self.left.items()]

    def run(self, own: Setting, across: int) -> tuple[float, float]:
        """Return error and effort of a setting; a series that blows up is withdrawn."""
        error, effort = self.probe(own._replace(across=across))
        if error > 0:
            self.ran[own][across] = error, effort
        else:
            del self.left[own]
        return error, effort

    def finest(self, affordable: float) -> Choice | None:
        """Return the finest choice that promises least; None if enough of them were run."""
        ends = [each.at(int(each.across[-1])) for each in self.series()]
        new = [end for end in ends if end.setting.across not in self.ran[end.setting.series]]
        if len(ends) - len(new) >= MOST_FINEST:
            return None
        cheap = [end for end in new if end.effort <= affordable]
        return min(cheap, key=lambda end: end.promised, default=None)


class Settled(NamedTuple):
    """The choice in a case that nothing was measured in, the series left there, and what was run.

    choice: None if there is none; error: of its own run there, NaN if it wasn't run; trials: what
    was about to be chosen and the error of its run, NaN after a blow-up.
    """

    choice: Choice | None
    series: list[Series]
    error: float
    trials: list[tuple[Choice, float]]


def settle(
    series: Sequence[Series],
    choose: Callable[[Sequence[Series]], Choice | None],
    probe: Probe,
    affordable: float = math.inf,
) -> Settled:
    """Correct the series for a case until what is chosen among them was run there itself.

    First runs the coarsest setting of the series that is chosen, then the choice, if it takes at
    most an `affordable` effort, until one keeps what it promises. Where nothing can be chosen, the
    finest setting of the most promising series is run too. What blows up is withdrawn with its
    series.
    """
    case, trials = _Case(series, probe), list[tuple[Choice, float]]()
    while True:
        present, over = case.series(), len(trials) >= MOST_TRIALS
        choice = choose(present)
        wanted = choice or (None if over else case.finest(affordable))
        if wanted is None:
            return Settled(None, present, math.nan, trials)
        own, across = wanted.setting.series, wanted.setting.across
        runs = case.ran[own]
        if across in runs or (runs and (over or wanted.effort > affordable)):
            return Settled(wanted, present, runs.get(across, (math.nan,))[0], trials)
        if not runs:
            case.run(own, int(case.left[own].across[0]))
            continue
        error, effort = case.run(own, across)
        if choice is None:
            continue
        trials.append((choice, error))
        if error <= choice.promised and effort <= MARGIN * choice.effort:
            kept = corrected(case.left[own], runs).at(across)
            return Settled(kept, case.series(), error, trials)
