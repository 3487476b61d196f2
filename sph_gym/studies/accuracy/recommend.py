"""Which settings to take: from the measured lines, for an error that is wanted or a time that is.

A line is one choice of all knobs at several resolutions. Between two of them error and time are
interpolated on logarithmic scales. What is promised is the largest error at this and all finer
resolutions, the finest counting at least as what the others lead to expect, times what the line
would have been wrong by about any of its inner points had that one been missing: a lucky run
promises nothing. Where a scene's errors don't fall with dx, no line promises less than the largest
of the scene's own errors, so that nobody pays for their scatter. In a case that nothing was fitted
to, what would be advised is run first, and is corrected or withdrawn by what came of it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym import scenes
from sph_gym.solver.checks import known, positive
from sph_gym.studies.accuracy.asking import share_of_one
from sph_gym.studies.accuracy.benchmark import CAREFUL, rate
from sph_gym.studies.accuracy.lines import Choice, Line, fit, scatter
from sph_gym.studies.accuracy.problems import Problem, problem
from sph_gym.studies.accuracy.running import execute
from sph_gym.studies.accuracy.samples import FEWEST, read
from sph_gym.studies.accuracy.settings import Setting

# Of an error that is asked for.
ROUNDING = 1e-9
# Runs of which a probe takes the median time, and seconds after which it makes no more.
PROBES, ENOUGH = 3, 0.5
# How many choices are tried out in a case, and seconds that a run of one may take.
MOST_TRIALS, AFFORDABLE = 12, 10.0
# Of what is promised in a case of which only some runs are known, for all other settings.
MARGIN = 1.25
# Of how many lines the finest setting is run, where none promises enough.
MOST_FINEST = 2


# --- Choosing -------------------------------------------------------------------------------


def for_error(lines: Sequence[Line], error: float) -> Choice | None:
    """The cheapest choice that promises at most this error; None if there is none."""
    most = error * (1 + ROUNDING)
    within = [choice for line in lines for choice in line.choices() if choice.promised <= most]
    return min(within, key=lambda choice: choice.effort, default=None)


def for_effort(lines: Sequence[Line], effort: float) -> Choice | None:
    """The choice that promises least with at most this effort; None if there is none."""
    within = [choice for line in lines for choice in line.choices() if choice.effort <= effort]
    return min(within, key=lambda choice: (choice.promised, choice.effort), default=None)


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
    left = {line.setting: line for line in lines}
    ran: dict[Setting, Runs] = {line.setting: {} for line in lines}
    trials: list[tuple[Choice, float]] = []
    while True:
        known_now = [corrected(line, ran[name]) for name, line in left.items()]
        choice = choose(known_now)
        wanted = choice or _finest(known_now, ran, affordable)
        if wanted is None:
            return Settled(None, known_now, math.nan, trials)
        line, across = wanted.setting.line, wanted.setting.across
        first, runs = not ran[line], ran[line]
        dear = not first and (wanted.effort > affordable or len(trials) >= MOST_TRIALS)
        if across in runs or dear:
            return Settled(wanted, known_now, runs.get(across, (math.nan,))[0], trials)
        across = int(left[line].across[0]) if first else across
        error, effort = probe(line._replace(across=across))
        if not first and choice is not None:
            trials.append((choice, error))
        if not error > 0:
            del left[line]
            continue
        runs[across] = error, effort
        kept = error <= wanted.promised and effort <= MARGIN * wanted.effort
        if kept and not first and choice is not None:
            known_now = [corrected(left[name], ran[name]) for name in left]
            told = corrected(left[line], runs).at(across)
            return Settled(told, known_now, error, trials)


def _finest(lines: Sequence[Line], ran: dict[Setting, Runs], affordable: float) -> Choice | None:
    """The finest setting of the line that promises least there, unless enough of them were run."""
    ends = [line.at(int(line.across[-1])) for line in lines]
    tried = sum(end.setting.across in ran[end.setting.line] for end in ends)
    left = [
        end
        for end in ends
        if end.effort <= affordable and end.setting.across not in ran[end.setting.line]
    ]
    return None if tried >= MOST_FINEST else min(left, key=lambda e: e.promised, default=None)


def _probe(case: Problem) -> Probe:
    """Runs of a user's case; the time is the median of a few, each beside the benchmark.

    What takes long by itself is run once.
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


class Advice(NamedTuple):
    """What `recommend` answers.

    seconds: expected processor time of the run, on one thread; caution: what chance has to do with
    it, nothing where errors fall steadily with dx; tried: the error of its own run in a case that
    nothing was fitted to, NaN if it would have been too dear, None in the case of the tables;
    budget: seconds that were asked for; best: whether nothing that was measured promises less.
    """

    problem: Problem
    choice: Choice
    seconds: float
    caution: str = ""
    tried: float | None = None
    budget: float | None = None
    best: bool = False


def advise(
    scene: str,
    error: float | None = None,
    budget: float | None = None,
    arguments: dict[str, Any] | None = None,
    table: Path | None = None,
    speed: float | None = None,
) -> Advice:
    """Settings for a scene, for an error (a share) or a budget [s], whichever is given.

    arguments: of the scene, in which what would be advised is run first, its coarsest setting
    before it, to correct or withdraw it; table: of samples, by default the one that comes with the
    package; speed: of this machine [benchmark particle-steps/s], measured if it isn't given. Raises
    ValueError for an unknown scene or argument or a scene that is erratic, if not exactly one of
    error and budget is given, and for an error or a budget below what was measured, with the range.
    """
    found = problem(scene)
    if found.erratic:
        raise ValueError(f"scene: expected one whose errors fall with dx, got {scene!r}")
    found = replace(found, arguments=found.arguments | _checked(scene, arguments or {}))
    if (error is None) == (budget is None):
        raise ValueError("error, budget: expected one of the two, got both or none")
    wanted = {"error": error, "budget": budget}
    for name, value in wanted.items():
        if value is not None:
            positive(name, value)
    if error is not None:
        share_of_one(error)
    samples = read(scene, table)
    lines, floor = fit(samples), scatter(samples)
    if not lines:
        raise ValueError(f"table: expected a line of {FEWEST} resolutions of {scene}, got none")
    if error is not None and for_error(lines, error) is None:
        raise _too_small(scene, lines, "error", error, 1.0, floor)
    speed = rate(CAREFUL) if speed is None else speed

    def choose(lines: Sequence[Line]) -> Choice | None:
        if error is not None:
            return for_error(lines, error)
        assert budget is not None
        return for_effort(lines, budget * speed)

    settled = Settled(choose(lines), lines, math.nan, [])
    if arguments:
        settled = settle(lines, choose, _probe(found), AFFORDABLE * speed)
    if settled.choice is None:
        asked = ("error", error, 1.0) if error is not None else ("budget", budget, speed)
        raise _too_small(scene, settled.lines, *asked, floor)
    best = for_effort(settled.lines, math.inf) == settled.choice
    return Advice(
        found, settled.choice, settled.choice.effort / speed, _caution(floor),
        settled.error if arguments else None, budget, best,
    )  # fmt: skip


def _caution(floor: float) -> str:
    """What chance has to do with the errors of a scene."""
    if not floor:
        return ""
    return (
        f"errors are within their scatter, up to {100 * floor:.3g} % at any resolution: "
        "more time buys nothing"
    )


def _checked(scene: str, arguments: dict[str, Any]) -> dict[str, Any]:
    """The arguments, if they are such and the scene can be built with them."""
    given = scenes.parameters(scene)
    for name, value in arguments.items():
        known(f"argument of {scene}", name, [n for n in given if n != "dx"])
        expected = float if isinstance(given[name], int | float) else type(given[name])
        if expected is float and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise ValueError(f"{name}: expected a number, got {value!r}")
        if expected is str and not isinstance(value, str):
            raise ValueError(f"{name}: expected a name, got {value!r}")
    length = problem(scene).length
    if length in arguments:
        positive(length, arguments[length])
    return arguments


def _too_small(
    scene: str,
    lines: Sequence[Line],
    name: str,
    value: float | None,
    speed: float,
    floor: float,
) -> ValueError:
    if not lines:
        return ValueError(f"{scene}: expected a case that holds out, but all settings blow up")
    ends = [choice for line in lines for choice in (line.at(int(line.across[k])) for k in (0, -1))]
    known_values = [c.promised if name == "error" else c.effort / speed for c in ends]
    unit = "" if name == "error" else " s"
    chance = " (errors below are within their scatter)" if floor and name == "error" else ""
    what = "can be promised" if name == "error" else "was measured"
    return ValueError(
        f"{name}: expected at least {min(known_values):.3g}{unit}, since for {scene} "
        f"{min(known_values):.3g} to {max(known_values):.3g}{unit} {what}{chance}, "
        f"got {value:g}"
    )
