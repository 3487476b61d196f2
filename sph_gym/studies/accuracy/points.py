"""Points of a diagram: one run each, its error, its work and its times, kept on disk.

Error and work are the same whenever a point is run again, to the last bit, and are kept with all
that they depend on; times are kept apart, so that they can be taken anew.
"""

import json
import math
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.controllers.network import shipped_network
from sph_gym.provenance import content_hash
from sph_gym.recommend.runs import RunOutcome, Schedule, execute, rate
from sph_gym.recommend.settings import Setting, build, is_agent
from sph_gym.scenes.refinement import Refinement
from sph_gym.studies import machine
from sph_gym.studies.accuracy import agents
from sph_gym.studies.results import COMMON, Results

# Runs that are short are repeated, up to so much time [s] and so many runs.
PATIENCE, MOST = 0.1, 5
# So are runs whose times differ by more than this share of the median, the three runs around it.
AGREED, FEWEST = 0.15, 3
# An error above this is none that a diagram could show: 1000 %.
ABSURD = 10.0
# Times of the runs of a point: by the clock, of processor time, and the benchmark beside them.
CLOCKS = ("wall", "own")
PER_RUN = (*CLOCKS, "rate")
# Outcome of an agent that doesn't get to the end of its own episode.
LOST = RunOutcome(
    math.nan, "its agent blew up", [], 1.0, 0, 0, 0.0, math.nan, math.nan, math.nan, math.nan
)  # fmt: skip


class Point(NamedTuple):
    """One run as the study has it.

    knob: which setting was changed; error: share of what the refinement series says, NaN after a
    blow-up; cause: of the blow-up; seconds: of physical time; particles: fluid and wall; substeps,
    interactions: steps and pairs (i, j) of their force evaluations; compression, mach: as of a
    `RunOutcome`; wall, own: median seconds of the whole run by the clock and of processor time;
    rate: of the benchmark right before and after [particle-steps/s]; effort: median of own times
    rate, the particle-steps of the benchmark that take as long; runs: of which these are medians;
    spread: the range of the three efforts around the median / the median; differing: runs whose
    error differed, which should be none; speed: of the benchmark on the machine for which times are
    given.
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
        """Processor seconds per simulated second."""
        return self.time / self.seconds

    @property
    def good(self) -> bool:
        """Whether it came to an end with an error worth the name."""
        return 0 < self.error < ABSURD


# --- On disk --------------------------------------------------------------------------------


class Sampling(NamedTuple):
    """Where points are kept, how often each is run at least, and whether times are taken anew."""

    folder: Path
    repeats: int = 3
    again: bool = False

    def results(self, kind: str, setting: Setting) -> Results:
        """Return the store of "points", "times" or "schedules"."""
        common = COMMON if is_agent(setting.controller) else tuple(p for p in COMMON if p != "env")
        sources = ("recommend/settings.py", "recommend/runs.py")
        return Results(self.folder / kind, *sources, common=common)


def key_of(case: Refinement, setting: Setting, other: int) -> dict[str, Any]:
    """Return all that the error of a point depends on, sources apart."""
    network = shipped_network(setting.controller, case.scene)
    return {
        "scene": case.scene,
        "arguments": case.given(other),
        "length": case.length,
        "measure": case.measure,
        "joined": case.joined,
        "setting": setting._asdict(),
        "network": content_hash(network) if network.is_file() else "",
        "numpy": np.__version__,
    }


def _versions() -> dict[str, str]:
    try:
        return {**machine.describe(), "sph_gym": metadata.version("sph_gym")}
    except metadata.PackageNotFoundError:
        return machine.describe()


def _are_numbers(values: Any) -> bool:
    return isinstance(values, list) and all(type(value) in (int, float) for value in values)


def is_record(kept: Any) -> bool:
    """Return whether a stored result is the record of a point."""
    outcome = kept.get("outcome") if isinstance(kept, dict) else None
    if not isinstance(outcome, dict):
        return False
    numbers = [n for n in RunOutcome._fields if n not in (*CLOCKS, "cause", "measures")]
    return isinstance(outcome.get("cause"), str) and _are_numbers([*map(outcome.get, numbers)])


def _is_times(kept: Any) -> bool:
    lists = [kept.get(name) for name in PER_RUN] if isinstance(kept, dict) else [None]
    return (
        all(map(_are_numbers, lists))
        and len({len(own) for own in lists if own is not None}) == 1
        and type(kept.get("differing")) is int
    )


def _is_schedule(kept: Any) -> bool:
    frames = kept.get("controls") if isinstance(kept, dict) else None
    return isinstance(frames, list) and all(_are_numbers(f) and len(f) == 3 for f in frames)


# --- Running --------------------------------------------------------------------------------


def measure_point(
    case: Refinement, knob: str, setting: Setting, sampling: Sampling, other: int = 0
) -> Point:
    """Return a point from its folder, or from as many runs as it takes.

    An interruption loses at most the run in hand.
    """
    key, schedule = key_of(case, setting, other), _schedule(case, setting, other, sampling)
    points, times = (sampling.results(kind, setting) for kind in ("points", "times"))
    record = points.load(key, is_record)
    kept = times.load(key, _is_times)
    if record is None or kept is None or sampling.again:
        kept = {**{name: [] for name in PER_RUN}, "differing": 0}
    before = None
    while record is None or not _is_enough(record, kept, sampling.repeats):
        if schedule == []:
            outcome, rates = LOST._asdict(), [math.nan]
        else:
            before = rate() if before is None else before
            outcome = execute(case, setting, other, schedule)._asdict()
            rates = [before, rate()]
        taken = {**{name: outcome.pop(name) for name in CLOCKS}, "rate": float(np.mean(rates))}
        before = rates[-1]
        # another process may have been faster
        new = {"outcome": outcome, "versions": _versions()}
        record = points.load(key, is_record) or points.save(key, new)
        kept["differing"] += not is_same(record["outcome"]["error"], outcome["error"])
        for name, value in taken.items():
            kept[name].append(value)
        times.save(key, kept)
    return _point(case, knob, setting, record["outcome"], kept, points.path(key).stem, other)


def _is_enough(record: dict[str, Any], times: dict[str, Any], repeats: int) -> bool:
    """Return whether a median can be taken; a blow-up needs no time."""
    n = len(times["wall"])
    if record["outcome"]["cause"] or n >= MOST:
        return True
    if n < repeats or sum(times["own"]) < PATIENCE:
        return False
    return n < FEWEST or _spread(np.multiply(times["own"], times["rate"])) <= AGREED


def _spread(efforts: NDArray[np.float64]) -> float:
    """Return the range of the three around the median, or of all, as a share of the median."""
    if not len(efforts):
        return 0.0
    median = float(np.median(efforts))
    near = sorted(efforts, key=lambda effort: abs(effort - median))[:FEWEST]
    return float(np.ptp(near)) / median


def is_same(one: float, other: float) -> bool:
    """Return whether two errors are the same to the last bit, or both of a blow-up."""
    return json.dumps(one) == json.dumps(other)


def _schedule(
    case: Refinement, setting: Setting, other: int, sampling: Sampling
) -> Schedule | None:
    """Return the controls of an agent, none if it blew up; None for rules and fixed settings."""
    if not is_agent(setting.controller):
        return None

    def play() -> dict[str, Any]:
        # it begins with the scene's own controls
        plain = build(case, setting._replace(step=1.0, sound=1.0), other)
        try:
            return {"controls": agents.play(setting.controller, replace(plain, controls=None))}
        except RuntimeError as error:
            return {"controls": [], "cause": str(error)}

    schedules, key = sampling.results("schedules", setting), key_of(case, setting, other)
    controls: Schedule = schedules.get(key, play, _is_schedule)["controls"]
    return controls


def _point(
    case: Refinement,
    knob: str,
    setting: Setting,
    outcome: dict[str, Any],
    times: dict[str, Any],
    key: str,
    other: int,
) -> Point:
    efforts = np.multiply(times["own"], times["rate"])
    wall, own, rate_then, effort = (
        float(np.median(values)) if len(values) else math.nan
        for values in (times["wall"], times["own"], times["rate"], efforts)
    )
    known = {name: value for name, value in outcome.items() if name in Point._fields}
    return Point(
        case.scene, knob, setting, case.metres(other) / setting.across, **known,
        wall=wall, own=own, rate=rate_then, effort=effort, runs=len(times["wall"]),
        spread=_spread(efforts), differing=times["differing"], key=key, speed=rate_then,
    )  # fmt: skip
