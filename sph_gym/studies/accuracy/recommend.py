"""Which settings to take: from the measured lines, for an error that is wanted or a time that is.

A line is one choice of all knobs at several resolutions. Between two of them error and time are
interpolated on logarithmic scales. What is promised is the largest error at this and all finer
resolutions, times what the line would have been wrong by about any of its own points had that
one been missing: a lucky run promises nothing.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym import scenes
from sph_gym.solver.checks import known, positive
from sph_gym.studies.accuracy.benchmark import CAREFUL, rate
from sph_gym.studies.accuracy.gains import LONGEST
from sph_gym.studies.accuracy.policies import RULES
from sph_gym.studies.accuracy.problems import Problem, problem
from sph_gym.studies.accuracy.running import execute
from sph_gym.studies.accuracy.samples import FEWEST, Sample, read, whole
from sph_gym.studies.accuracy.settings import FIXED, Setting

Array = NDArray[np.float64]
# Of an error that is asked for.
ROUNDING = 1e-9
# Runs of which a probe takes the median time.
PROBES = 3
UNITS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}


class Line(NamedTuple):
    """One choice of the knobs at several resolutions.

    across, error, promised, effort: (n,) particles across, coarse first, the largest error that
    was measured there or at finer ones, what is promised, and the effort.
    """

    setting: Setting
    across: Array
    error: Array
    promised: Array
    effort: Array

    def at(self, across: int) -> "Choice":
        """Between the measured resolutions, on logarithmic scales."""
        x, known_at = math.log(across), np.log(self.across)
        error, promised, effort = (
            math.exp(float(np.interp(x, known_at, np.log(y))))
            for y in (self.error, self.promised, self.effort)
        )
        return Choice(self.setting._replace(across=across), error, promised, effort)

    def choices(self) -> "list[Choice]":
        """At every whole number of particles across."""
        return [self.at(n) for n in range(int(self.across[0]), int(self.across[-1]) + 1)]


class Choice(NamedTuple):
    """A setting, the error to expect, the one that is promised (at most), and the effort."""

    setting: Setting
    error: float
    promised: float
    effort: float


# --- Lines ----------------------------------------------------------------------------------


def fit(samples: Iterable[Sample]) -> list[Line]:
    """The lines of one scene that may be offered: known up to its finest resolution.

    None on which a run blew up, that needs an agent, or whose steps are near the limit.
    """
    grouped: dict[Setting, list[Sample]] = {}
    for sample in samples:
        grouped.setdefault(sample.setting.line, []).append(sample)
    finest = max((s.setting.across for group in grouped.values() for s in group), default=0)
    return [_line(group) for group in grouped.values() if _offered(group, finest)]


def _offered(group: Sequence[Sample], finest: int) -> bool:
    setting = group[0].setting
    safe = setting.controller in (FIXED, *RULES) and setting.step <= LONGEST
    known_up = whole([sample.setting for sample in group], finest)
    return safe and known_up and all(sample.error > 0 for sample in group)


def _line(group: Sequence[Sample]) -> Line:
    group = sorted(group, key=lambda sample: sample.setting.across)
    across = np.array([sample.setting.across for sample in group], float)
    errors = np.array([sample.error for sample in group])
    effort = np.array([sample.effort for sample in group])
    worst = envelope(errors)
    return Line(group[0].setting.line, across, worst, doubt(across, errors) * worst, effort)


def envelope(errors: Array) -> Array:
    """(n,) the largest error here and at all finer resolutions; coarse first."""
    return np.maximum.accumulate(errors[::-1])[::-1]


def doubt(across: Array, errors: Array) -> float:
    """The worst ratio of an inner error to what the others promise at its place; at least 1."""
    worst, x = 1.0, np.log(across)
    for k in range(1, len(errors) - 1):
        others = np.arange(len(errors)) != k
        expected = np.interp(x[k], x[others], np.log(envelope(errors[others])))
        worst = max(worst, float(errors[k] / math.exp(expected)))
    return worst


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


def corrected(line: Line, probe: Probe) -> Line | None:
    """A line in a case that it wasn't fitted to, by a run of its coarsest setting there.

    Errors and promises grow by measured / expected error, and never shrink, since one small error
    may be luck; efforts change by measured / expected effort. None if that run blows up.
    """
    error, effort = probe(line.setting._replace(across=int(line.across[0])))
    if not error > 0:
        return None
    factor = max(error / line.error[0], 1.0)
    return line._replace(
        error=factor * line.error,
        promised=factor * line.promised,
        effort=effort / line.effort[0] * line.effort,
    )


def settle(
    lines: Sequence[Line], choose: Callable[[Sequence[Line]], Choice | None], probe: Probe
) -> tuple[Choice | None, list[Line]]:
    """The choice among lines of which the chosen one is corrected for the case, and all lines."""
    waiting, done = {line.setting: line for line in lines}, dict[Setting, Line]()
    while True:
        known_now = [*waiting.values(), *done.values()]
        choice = choose(known_now)
        if choice is None or choice.setting.line in done:
            return choice, known_now
        line = waiting.pop(choice.setting.line)
        better = corrected(line, probe)
        if better is not None:
            done[line.setting] = better


def _probe(case: Problem) -> Probe:
    """Runs of a user's case; the time is the median of a few, each beside the benchmark."""

    def run(setting: Setting) -> tuple[float, float]:
        before, efforts = rate(), list[float]()
        for _ in range(PROBES):
            outcome = execute(case, setting)
            before, between = rate(), before
            efforts.append(outcome.own * (before + between) / 2)
        return outcome.error, float(np.median(efforts))

    return run


class Advice(NamedTuple):
    """What `recommend` answers; seconds: expected processor time of the run, on one thread."""

    problem: Problem
    choice: Choice
    seconds: float


def advise(
    scene: str,
    error: float | None = None,
    budget: float | None = None,
    arguments: dict[str, Any] | None = None,
    table: Path | None = None,
    speed: float | None = None,
) -> Advice:
    """Settings for a scene, for an error (a share) or a budget [s], whichever is given.

    arguments: of the scene, in which the coarsest setting of what would be advised is run first,
    to correct what it promises; table: of samples, by default the one that comes with the package;
    speed: of this machine [benchmark particle-steps/s], measured if it isn't given. Raises
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
    lines = fit(read(scene, table))
    if not lines:
        raise ValueError(f"table: expected a line of {FEWEST} resolutions of {scene}, got none")
    speed = rate(CAREFUL) if speed is None else speed

    def choose(lines: Sequence[Line]) -> Choice | None:
        if error is not None:
            return for_error(lines, error)
        assert budget is not None
        return for_effort(lines, budget * speed)

    choice = choose(lines)
    if arguments:
        choice, lines = settle(lines, choose, _probe(found))
    if choice is None:
        asked = ("error", error, 1.0) if error is not None else ("budget", budget, speed)
        raise _too_small(scene, lines, *asked)
    return Advice(found, choice, choice.effort / speed)


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
    scene: str, lines: Sequence[Line], name: str, value: float | None, speed: float
) -> ValueError:
    if not lines:
        return ValueError(f"{scene}: expected a case that holds out, but all settings blow up")
    ends = [choice for line in lines for choice in (line.at(int(line.across[k])) for k in (0, -1))]
    known_values = [c.promised if name == "error" else c.effort / speed for c in ends]
    unit = "" if name == "error" else " s"
    return ValueError(
        f"{name}: expected at least {min(known_values):.3g}{unit}, since for {scene} "
        f"{min(known_values):.3g} to {max(known_values):.3g}{unit} was measured, got {value:g}"
    )


def parse_budget(text: str) -> float:
    """Seconds of a text such as 10s, 500ms, 2min, 1h or 10. Raises ValueError for others."""
    number = text.strip().lower()
    unit = next((u for u in ("ms", "min", "h", "s") if number.endswith(u)), "")
    try:
        return positive("budget", float(number.removesuffix(unit)) * UNITS.get(unit, 1.0))
    except ValueError:
        raise ValueError(
            f"budget: expected a time above 0 such as 10s, 500ms or 2min, got {text!r}"
        ) from None
