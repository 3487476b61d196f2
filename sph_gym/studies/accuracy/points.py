"""A point of a diagram: one run, its error, its work and its times, each kept on disk.

Error and work are the same whenever a point is run again, to the last bit, and lie in one file
with all that they depend on; times lie in another, so that they can be taken anew.
"""

import json
import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.studies import store
from sph_gym.studies.accuracy import policies, shelf
from sph_gym.studies.accuracy.benchmark import rate
from sph_gym.studies.accuracy.problems import Problem
from sph_gym.studies.accuracy.running import Outcome, execute
from sph_gym.studies.accuracy.settings import Setting, build

# What is short is run more often, up to so much time [s] and so many runs.
PATIENCE, MOST = 0.1, 5
# So is what differs: up to so much of the median, the three runs around it.
AGREED, FEWEST = 0.15, 3
# An error above this is none that a diagram could show: 1000 %.
ABSURD = 10.0
# Of an agent that doesn't get to the end of its own episode.
LOST = Outcome(
    math.nan, "its agent blew up", [], 1.0, 0, 0, 0.0, math.nan, math.nan, math.nan, math.nan
)  # fmt: skip


class Point(NamedTuple):
    """What is known of a run.

    knob: which one was turned; error: share of what the problem says, nan after a blow-up; cause:
    of the blow-up; seconds: of physical time; particles: fluid and wall; substeps, interactions:
    steps and pairs (i, j) of their force evaluations; compression, mach: as of an `Outcome`;
    wall, own: median seconds of the whole run
    on the wall and of the thread's processor time; rate: of the benchmark right before and after
    [particle-steps/s]; effort: median of own times rate, the particle-steps of the benchmark that
    take as long; runs: of which these are medians, spread: the range of the three efforts around
    the median / the median; differing: runs whose error differed, which should be none; speed: of
    the benchmark on the machine on which times are told.
    """

    scene: str
    knob: str
    setting: Setting
    dx: float
    error: float
    cause: str
    seconds: float
    particles: int
    substeps: int
    interactions: float
    compression: float
    mach: float
    wall: float
    own: float
    rate: float
    effort: float
    runs: int
    spread: float
    differing: int
    key: str
    speed: float

    @property
    def time(self) -> float:
        """Processor seconds of the whole run, one thread, while the machine has its `speed`."""
        return self.effort / self.speed

    @property
    def cost(self) -> float:
        """The same per simulated second."""
        return self.time / self.seconds

    @property
    def particle_steps(self) -> float:
        """Per simulated second."""
        return self.particles * self.substeps / self.seconds

    @property
    def good(self) -> bool:
        """Whether it came to an end with an error worth the name."""
        return 0 < self.error < ABSURD


# --- On disk --------------------------------------------------------------------------------


def point(
    problem: Problem,
    knob: str,
    setting: Setting,
    folder: Path,
    repeats: int = 3,
    again: bool = False,
    other: int = 0,
) -> Point:
    """A point from `folder`, or from as many runs as it takes; again: take its times anew.

    An interruption loses at most the run in hand.
    """
    facts = shelf.manifest(problem, setting, other)
    key = shelf.key_of(facts)
    played = _schedule(problem, setting, other, folder, key)
    _, found = shelf.record(folder, key)
    path, timed = shelf.times(folder, key)
    taken: dict[str, Any] = {"wall": [], "own": [], "rate": [], "differing": 0}
    if found is not None and timed is not None and not again:
        # in place, since further runs are entered there
        taken.update(timed)
    _run = partial(_run_once, problem, setting, other, played, folder, taken, facts)
    before = None
    if found is None:
        found, before = _run(before)
    while not _enough(found, taken, repeats):
        _, before = _run(before)
        store.write(path, taken)
    if taken != timed:
        store.write(path, taken)
    return _point(problem, knob, setting, found, taken, key, other)


def _enough(found: dict[str, Any], taken: dict[str, Any], repeats: int) -> bool:
    """Whether a median can be taken; a blow-up needs no time."""
    n = len(taken["wall"])
    if found["outcome"]["cause"] or n >= MOST:
        return True
    if n < repeats or sum(taken["own"]) < PATIENCE:
        return False
    return n < FEWEST or _spread(np.multiply(taken["own"], taken["rate"])) <= AGREED


def _spread(efforts: NDArray[np.float64]) -> float:
    """The range of the three around the median, or of what there is, as a share of the median."""
    if not len(efforts):
        return 0.0
    median = float(np.median(efforts))
    near = sorted(efforts, key=lambda effort: abs(effort - median))[:FEWEST]
    return float(np.ptp(near)) / median


def _run_once(
    problem: Problem,
    setting: Setting,
    other: int,
    played: policies.Schedule | None,
    folder: Path,
    taken: dict[str, Any],
    facts: dict[str, Any],
    before: float | None,
) -> tuple[dict[str, Any], float]:
    """Run, and enter the time; the first run writes the record, later ones must agree with it.

    before: the speed of the machine right before it, measured if it isn't known from the end of
    another run. Returns the record and the speed right after.
    """
    if played is not None and not played:
        outcome, rates = LOST._asdict(), [math.nan]
    else:
        before = rate() if before is None else before
        outcome = execute(problem, setting, other, played)._asdict()
        rates = [before, rate()]
    times = {name: outcome.pop(name) for name in shelf.CLOCKS}
    key = shelf.key_of(facts)
    path, kept = shelf.record(folder, key)
    if kept is None:
        kept = {"hash": key, **facts, "outcome": outcome}
        store.write(path, kept)
    taken["differing"] += not same(kept["outcome"]["error"], outcome["error"])
    for name, value in times.items():
        taken[name].append(value)
    taken["rate"].append(float(np.mean(rates)))
    return dict(kept), rates[-1]


def same(one: float, other: float) -> bool:
    """Whether two errors are the same to the last bit, or both of a blow-up."""
    return json.dumps(one) == json.dumps(other)


def _schedule(
    problem: Problem, setting: Setting, other: int, folder: Path, key: str
) -> policies.Schedule | None:
    """What an agent does, from the folder or from itself; None for rules and fixed settings.

    Nothing if it blew up.
    """
    if not policies.needs_schedule(setting.controller):
        return None
    path, kept = shelf.schedule(folder, key)
    if kept is None:
        scene = replace(nominal_scene(problem, setting, other), controls=None)
        try:
            kept = {"controls": policies.schedule(setting.controller, scene)}
        except RuntimeError as error:
            kept = {"controls": [], "cause": str(error)}
        store.write(path, kept)
    controls: policies.Schedule = kept["controls"]
    return controls


def nominal_scene(problem: Problem, setting: Setting, other: int) -> Any:
    """The scene that an agent plays: with the article's own controls to begin with."""
    return build(problem, setting._replace(step=1.0, sound=1.0), other)


def _point(
    problem: Problem,
    knob: str,
    setting: Setting,
    found: dict[str, Any],
    taken: dict[str, Any],
    key: str,
    other: int,
) -> Point:
    outcome = found["outcome"]
    efforts = np.multiply(taken["own"], taken["rate"])
    wall, own, rate_then, effort = (
        float(np.median(values)) if len(values) else math.nan
        for values in (taken["wall"], taken["own"], taken["rate"], efforts)
    )
    spread = _spread(efforts)
    return Point(
        problem.scene, knob, setting, problem.metres(other) / setting.across, outcome["error"],
        outcome["cause"], outcome["seconds"], outcome["particles"], outcome["substeps"],
        outcome["interactions"], outcome["compression"], outcome["mach"], wall, own, rate_then,
        effort, len(taken["wall"]), spread, taken["differing"], key, rate_then,
    )  # fmt: skip
