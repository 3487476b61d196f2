"""Cases that no line was fitted to: what is chosen there is run first, and corrected by it."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from sph_gym.studies.accuracy.lines import Choice, Line
from sph_gym.studies.accuracy.settings import Setting

# Of what is promised in a case of which only some runs are known, for all other settings.
MARGIN = 1.25
# How many choices are tried out in a case, and of how many lines the finest setting is run, where
# none promises enough.
MOST_TRIALS, MOST_FINEST = 12, 2

# Runs a setting of a case: its error, NaN after a blow-up, and its effort.
Probe = Callable[[Setting], tuple[float, float]]


# By particles across, what a line gave in a case: error and effort.
Runs = dict[int, tuple[float, float]]


def corrected(line: Line, runs: Runs) -> Line:
    """A line in a case that it wasn't fitted to, by runs of some of its settings there.

    Errors and promises grow by measured / expected error, and never shrink, since a small error
    may be luck; efforts change by measured / expected effort; between the runs, on logarithmic
    scales. What was run itself has no doubt, and all else a margin.
    """
    if not runs:
        return line
    ran = sorted(runs)
    there = [line.at(n) for n in ran]
    larger = [max(runs[n][0] / expected.error, 1.0) for n, expected in zip(ran, there, strict=True)]
    slower = [runs[n][1] / expected.effort for n, expected in zip(ran, there, strict=True)]
    nodes = sorted({*map(int, line.across), *ran})
    known_at = [line.at(n) for n in nodes]
    factor, pace = (
        np.exp(np.interp(np.log(nodes), np.log(ran), np.log(ratio))) for ratio in (larger, slower)
    )
    error, promised, effort, compression, mach = (
        np.array([getattr(choice, name) for choice in known_at])
        for name in ("error", "promised", "effort", "compression", "mach")
    )
    error = factor * error
    exact = tuple((n, float(error[nodes.index(n)])) for n in ran)
    return Line(
        line.setting, np.array(nodes, float), error, MARGIN * factor * promised, pace * effort,
        compression, mach, exact,
    )  # fmt: skip


class _Case:
    """What is known of lines in a case: those that are left, and what was run of them."""

    def __init__(self, lines: Sequence[Line], probe: Probe) -> None:
        self.left = {line.setting: line for line in lines}
        self.ran: dict[Setting, Runs] = {line.setting: {} for line in lines}
        self.probe = probe

    def lines(self) -> list[Line]:
        """As corrected so far."""
        return [corrected(line, self.ran[name]) for name, line in self.left.items()]

    def run(self, line: Setting, across: int) -> tuple[float, float]:
        """Error and effort of a setting; a line that blows up is withdrawn."""
        error, effort = self.probe(line._replace(across=across))
        if error > 0:
            self.ran[line][across] = error, effort
        else:
            del self.left[line]
        return error, effort

    def finest(self, affordable: float) -> Choice | None:
        """That of the line which promises least there; none if enough of them were run."""
        ends = [line.at(int(line.across[-1])) for line in self.lines()]
        new = [end for end in ends if end.setting.across not in self.ran[end.setting.line]]
        if len(ends) - len(new) >= MOST_FINEST:
            return None
        cheap = [end for end in new if end.effort <= affordable]
        return min(cheap, key=lambda end: end.promised, default=None)


class Settled(NamedTuple):
    """What is chosen in a case that nothing was fitted to, among which lines, and what was run.

    choice: None if there is none; error: of its own run there, NaN if it wasn't run; trials: what
    was about to be chosen and the error of its run, NaN after a blow-up.
    """

    choice: Choice | None
    lines: list[Line]
    error: float
    trials: list[tuple[Choice, float]]


def settle(
    lines: Sequence[Line],
    choose: Callable[[Sequence[Line]], Choice | None],
    probe: Probe,
    affordable: float = math.inf,
) -> Settled:
    """The choice among lines that are corrected for the case until the choice itself was run.

    First by their coarsest setting, then by what would be chosen, if that takes at most an
    `affordable` effort, until one keeps what it promises. Where nothing can be chosen, the finest
    setting of the most promising lines is run too. What blows up is withdrawn with its line.
    """
    case, trials = _Case(lines, probe), list[tuple[Choice, float]]()
    while True:
        known_now, over = case.lines(), len(trials) >= MOST_TRIALS
        choice = choose(known_now)
        wanted = choice or (None if over else case.finest(affordable))
        if wanted is None:
            return Settled(None, known_now, math.nan, trials)
        line, across = wanted.setting.line, wanted.setting.across
        runs = case.ran[line]
        if across in runs or (runs and (over or wanted.effort > affordable)):
            return Settled(wanted, known_now, runs.get(across, (math.nan,))[0], trials)
        if not runs:
            case.run(line, int(case.left[line].across[0]))
            continue
        error, effort = case.run(line, across)
        if choice is None:
            continue
        trials.append((choice, error))
        if error <= choice.promised and effort <= MARGIN * choice.effort:
            told = corrected(case.left[line], runs).at(across)
            return Settled(told, case.lines(), error, trials)
