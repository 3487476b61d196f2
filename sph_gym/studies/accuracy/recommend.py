"""Which settings to take: from the measured lines, for an error that is wanted or a time that is.

A line is one choice of all knobs at several resolutions. Between two of them error and time are
interpolated on logarithmic scales. What is promised is the largest error at this and all finer
resolutions, times what the line would have been wrong by about any of its own points had that
one been missing: a lucky run promises nothing.
"""

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym import scenes
from sph_gym.solver.checks import known, positive
from sph_gym.studies.accuracy.benchmark import CAREFUL, rate
from sph_gym.studies.accuracy.policies import RULES
from sph_gym.studies.accuracy.problems import Problem, problem
from sph_gym.studies.accuracy.settings import FIXED, Setting

Array = NDArray[np.float64]
COLUMNS = ("scene", *Setting._fields, "error", "effort")
# Resolutions that a line must have.
FEWEST = 3
# Of an error that is asked for.
ROUNDING = 1e-9
UNITS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}


class Sample(NamedTuple):
    """A run as the table has it; effort: particle-steps of the benchmark that take as long."""

    scene: str
    setting: Setting
    error: float
    effort: float


class Line(NamedTuple):
    """One choice of the knobs: particles across, what is promised there, and the effort."""

    setting: Setting
    across: Array
    promised: Array
    effort: Array

    def at(self, across: int) -> "Choice":
        """Between the measured resolutions, on logarithmic scales."""
        x, known_at = math.log(across), np.log(self.across)
        error, effort = (
            math.exp(float(np.interp(x, known_at, np.log(y)))) for y in (self.promised, self.effort)
        )
        return Choice(self.setting._replace(across=across), error, effort)

    def choices(self) -> "list[Choice]":
        """At every whole number of particles across."""
        return [self.at(n) for n in range(int(self.across[0]), int(self.across[-1]) + 1)]


class Choice(NamedTuple):
    """A setting, the error that it promises, and its effort."""

    setting: Setting
    error: float
    effort: float


# --- Lines ----------------------------------------------------------------------------------


def fit(samples: Iterable[Sample]) -> list[Line]:
    """The lines of one scene; one on which a run blew up isn't offered to anybody."""
    grouped: dict[Setting, list[Sample]] = {}
    for sample in samples:
        grouped.setdefault(sample.setting.line, []).append(sample)
    return [_line(group) for group in grouped.values() if _offered(group)]


def _offered(group: Sequence[Sample]) -> bool:
    rule = group[0].setting.controller in (FIXED, *RULES)
    return rule and len(group) >= FEWEST and all(sample.error > 0 for sample in group)


def _line(group: Sequence[Sample]) -> Line:
    group = sorted(group, key=lambda sample: sample.setting.across)
    across = np.array([sample.setting.across for sample in group], float)
    errors = np.array([sample.error for sample in group])
    effort = np.array([sample.effort for sample in group])
    return Line(group[0].setting.line, across, doubt(across, errors) * envelope(errors), effort)


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
    within = [choice for line in lines for choice in line.choices() if choice.error <= most]
    return min(within, key=lambda choice: choice.effort, default=None)


def for_effort(lines: Sequence[Line], effort: float) -> Choice | None:
    """The choice that promises least with at most this effort; None if there is none."""
    within = [choice for line in lines for choice in line.choices() if choice.effort <= effort]
    return min(within, key=lambda choice: (choice.error, choice.effort), default=None)


class Advice(NamedTuple):
    """What `recommend` answers; seconds: expected wall clock of the whole run, on one thread."""

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

    arguments: of the scene; table: of samples, by default the one that comes with the package;
    speed: of this machine [benchmark particle-steps/s], measured if it isn't given. Raises
    ValueError for an unknown scene or argument, if not exactly one of error and budget is given,
    and for an error or a budget below what was measured, with the range.
    """
    found = problem(scene)
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
    if error is not None:
        choice = for_error(lines, error) or _too_small("error", scene, error, lines, 1.0)
    else:
        assert budget is not None
        effort = budget * speed
        choice = for_effort(lines, effort) or _too_small("budget", scene, budget, lines, speed)
    return Advice(found, choice, choice.effort / speed)


def _checked(scene: str, arguments: dict[str, Any]) -> dict[str, Any]:
    for name in arguments:
        known(f"argument of {scene}", name, [n for n in scenes.parameters(scene) if n != "dx"])
    return arguments


def _too_small(name: str, scene: str, value: float, lines: Sequence[Line], speed: float) -> Choice:
    ends = [choice for line in lines for choice in (line.at(int(line.across[k])) for k in (0, -1))]
    known_values = [c.error if name == "error" else c.effort / speed for c in ends]
    unit = "" if name == "error" else " s"
    raise ValueError(
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


# --- The table ------------------------------------------------------------------------------


def read(scene: str, path: Path | None = None) -> list[Sample]:
    """Samples of a scene, by default those that come with the package.

    Raises ValueError if there are none.
    """
    place = resources.files("sph_gym.studies.accuracy") / "data" / f"{scene}.csv"
    if path is None and not place.is_file():
        raise ValueError(f"scene: expected one of {', '.join(shipped())}, got {scene!r}")
    text = place.read_text() if path is None else path.read_text()
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    try:
        return [_sample(row) for row in rows if row["scene"] == scene]
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"table: {path or place} is no table of samples: {error!r}") from None


def shipped() -> list[str]:
    """Scenes of which samples come with the package."""
    folder = resources.files("sph_gym.studies.accuracy") / "data"
    return sorted(file.name.removesuffix(".csv") for file in folder.iterdir())


def _sample(row: dict[str, str]) -> Sample:
    kinds = Setting.__annotations__
    values = {name: kinds[name](row[name]) for name in Setting._fields}
    return Sample(row["scene"], Setting(**values), float(row["error"]), float(row["effort"]))


def write(samples: Iterable[Sample], path: Path, comment: str) -> None:
    """Write a table that `read` takes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        file.write(f"# {comment}\n")
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for s in samples:
            writer.writerow([s.scene, *s.setting, f"{s.error:.6g}", f"{s.effort:.6g}"])
