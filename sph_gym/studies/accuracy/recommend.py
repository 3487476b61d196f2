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
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym import scenes
from sph_gym.solver.checks import known, positive
from sph_gym.studies.accuracy.asking import share_of_one
from sph_gym.studies.accuracy.benchmark import CAREFUL, rate
from sph_gym.studies.accuracy.elsewhere import Probe, Settled, settle
from sph_gym.studies.accuracy.lines import Choice, Line, fit, scatter
from sph_gym.studies.accuracy.problems import Problem, problem
from sph_gym.studies.accuracy.running import execute
from sph_gym.studies.accuracy.samples import FEWEST, read
from sph_gym.studies.accuracy.settings import Setting

# Of an error that is asked for.
ROUNDING = 1e-9
# Runs of which a probe takes the median time, and seconds after which it makes no more.
PROBES, ENOUGH = 3, 0.5
# Seconds that a run of what would be advised in another case may take.
AFFORDABLE = 10.0


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
