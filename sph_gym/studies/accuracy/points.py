"""Points of a diagram: one run each, its error, its work and its times, kept on disk.

Error and work are the same whenever a point is run again, to the last bit; times, a list [wall,
own, rate] of each run, can be taken anew.
"""

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.controllers import Network
from sph_gym.controllers.shipped import network_of
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.oracle import COARSE, Oracle
from sph_gym.env.rules import Rules
from sph_gym.env.tuning import TuningEnv
from sph_gym.provenance import content_hash
from sph_gym.recommend.runs import RunOutcome, Schedule, execute, rate
from sph_gym.recommend.series import MeasuredRun
from sph_gym.recommend.settings import Setting, build, is_agent
from sph_gym.scenes.shared.refinement import Refinement, refinement
from sph_gym.solver.scene import Scene
from sph_gym.studies import machine
from sph_gym.studies.results import COMMON, Results
from sph_gym.timing import pinned

# Scenes of the study that are environments as they stand, for agents; a search takes a minute.
SEARCHED = ("dam_break",)
LEARNED = ("ppo_warm-absolute",)
# Runs that are short are repeated, up to so much time [s] and so many runs.
PATIENCE, MOST = 0.1, 5
# So are runs whose times differ by more than this share of the median, the three runs around it.
AGREED, FEWEST = 0.15, 3
# Entries of an outcome that differ from run to run.
CLOCKS = ("wall", "own")
# When a point is run again, its time, corrected by the benchmark, may be so many times the kept
# one, or so many times less.
FACTOR = 1.5
# Outcome of an agent that doesn't get to the end of its own episode.
LOST = RunOutcome(
    math.nan, "its agent blew up", 1.0, 0, 0, 0.0, math.nan, math.nan, math.nan, math.nan
)


@dataclass(frozen=True, kw_only=True)
class Point(MeasuredRun):
    """One run as the study has it.

    knob: which setting was changed; cause: of the blow-up; seconds: of physical time; particles:
    fluid and wall; substeps, interactions: steps and pairs (i, j) of their force evaluations; wall,
    own: median seconds of the whole run by the clock and of processor time; rate: of the benchmark
    right before and after [particle-steps/s]; effort: median of own times rate; runs: of which
    these are medians; spread: the range of the three efforts around the median / the median;
    differing: runs whose error differed, which should be none; speed: of the benchmark on the
    machine for which times are given.
    """

    knob: str
    dx: float
    cause: str
    seconds: float
    particles: int
    substeps: int
    interactions: float
    wall: float
    own: float
    rate: float
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


class Sampling(NamedTuple):
    """Folder of kept points, least number of runs of each, whether times are taken anew."""

    folder: Path
    repeats: int = 3
    again: bool = False

    def results(self, kind: str, setting: Setting) -> Results:
        """Return the store of "points" or of "schedules"."""
        common = COMMON if is_agent(setting.controller) else tuple(p for p in COMMON if p != "env")
        sources = ("recommend/settings.py", "recommend/runs.py")
        return Results(self.folder / kind, *sources, common=common)


def key_of(case: Refinement, setting: Setting, other: int) -> dict[str, Any]:
    """Return all that the error of a point depends on, sources apart."""
    network = network_of(setting.controller, case.scene)
    return {
        "scene": case.scene,
        "arguments": case.given(other),
        "length": case.length,
        "measure": case.measure,
        "joined": case.joined,
        "setting": setting._asdict(),
        "network": "" if network is None else content_hash(network),
        "numpy": np.__version__,
    }


def _versions() -> dict[str, str]:
    try:
        return {**machine.describe(), "sph_gym": metadata.version("sph_gym")}
    except metadata.PackageNotFoundError:
        return machine.describe()


def measure_point(
    case: Refinement, knob: str, setting: Setting, sampling: Sampling, other: int = 0
) -> Point:
    """Return a point from its folder, or from as many runs as it takes.

    An interruption loses at most the run in hand.
    """
    points, key = sampling.results("points", setting), key_of(case, setting, other)
    schedule = _schedule(case, setting, other, sampling)
    dx = case.metres(other) / setting.across
    facts = {"scene": case.scene, "knob": knob, "setting": setting, "dx": dx}
    facts["key"] = points.path(key).stem
    kept = points.load(key, partial(_usable, facts))
    if kept is not None and sampling.again:
        kept |= {"times": [], "differing": 0}
    before = None
    while kept is None or not _is_enough(kept, sampling.repeats):
        if schedule == []:
            outcome, before = LOST, math.nan
            times = [math.nan] * 3
        else:
            start = rate() if before is None else before
            outcome, before = execute(case, setting, other, schedule), rate()
            times = [outcome.wall, outcome.own, (start + before) / 2]
        if kept is None:
            work = {n: value for n, value in outcome._asdict().items() if n not in CLOCKS}
            kept = {"outcome": work, "times": [], "differing": 0, "versions": _versions()}
        kept["differing"] += not is_same(kept["outcome"]["error"], outcome.error)
        kept["times"].append(times)
        points.save(key, kept)
    return make_point(facts, kept)


def _usable(facts: dict[str, Any], kept: dict[str, Any]) -> dict[str, Any]:
    """Return what is kept of a point if one can be made of it, else raise an error."""
    make_point(facts, kept)
    return kept


def measure_apart(case: Refinement, setting: Setting, repeats: int) -> dict[str, Any]:
    """Return what is kept of a point, measured by a worker that needs no folder of the study."""
    with pinned(here=True), TemporaryDirectory() as scratch:
        sampling = Sampling(Path(scratch), repeats)
        measure_point(case, "", setting, sampling)
        points = sampling.results("points", setting)
        kept: dict[str, Any] = points.load(key_of(case, setting, 0))
    return kept


def _is_enough(kept: dict[str, Any], repeats: int) -> bool:
    """Return whether a median can be taken; a blow-up needs no time."""
    _, own, speed = np.array(kept["times"], float).reshape(-1, 3).T
    if kept["outcome"]["cause"] or len(own) >= MOST:
        return True
    agreed = len(own) < FEWEST or _spread(own * speed) <= AGREED
    return len(own) >= repeats and own.sum() >= PATIENCE and agreed


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


def make_point(facts: dict[str, Any], kept: dict[str, Any]) -> Point:
    """Return a point from what it is of and what is kept of it."""
    wall, own, speed = np.array(kept["times"], float).reshape(-1, 3).T
    columns = {"wall": wall, "own": own, "rate": speed, "effort": own * speed}
    medians: dict[str, Any] = {
        name: float(np.median(values)) if len(values) else math.nan
        for name, values in columns.items()
    }
    names = {field.name for field in fields(Point)}
    work = {name: value for name, value in kept["outcome"].items() if name in names}
    return Point(
        **facts, **work, **medians, runs=len(own), spread=_spread(own * speed),
        differing=kept["differing"], speed=medians["rate"],
    )  # fmt: skip


# --- Agents ---------------------------------------------------------------------------------

# Their controls are written down first, then played: the time that an agent itself takes, which is
# another matter, counts for nothing.


def available(name: str, scene: str) -> bool:
    """Return whether there is such a controller for a scene."""
    if name in LEARNED:
        return scene in SEARCHED and network_of(name, scene) is not None
    return not is_agent(name) or (name == "lookahead" and scene in SEARCHED)


def play(name: str, scene: Scene) -> Schedule:
    """Return the controls of every frame as an agent sets them.

    Raises RuntimeError if the scene blows up.
    """
    env = TuningEnv(scene)
    observation, _ = env.reset(seed=0)
    policy = _policy(name, scene)
    played: Schedule = []
    while not env.episode.over:
        observation, _, terminated, _, _ = env.step(policy(env, observation))
        played.append([float(value) for value in env.sim.controls])
        if terminated:
            raise RuntimeError(f"{name}: blew up at t = {env.sim.time:g} s")
    return played


def _policy(name: str, scene: Scene) -> Callable[[Any, Any], Any]:
    if name == "lookahead":
        return Oracle(COARSE)
    network = network_of(name, scene.name)
    assert network is not None
    trained = Network.load(network)
    trained.check(observation_layout(Rules()), action_layout("absolute"))
    return lambda env, observation: trained(observation)


def _schedule(
    case: Refinement, setting: Setting, other: int, sampling: Sampling
) -> Schedule | None:
    """Return the controls of an agent, none if it blew up; None for rules and fixed settings."""
    if not is_agent(setting.controller):
        return None

    def make() -> dict[str, Any]:
        # it begins with the scene's own controls
        plain = build(case, setting._replace(step=1.0, sound=1.0), other)
        try:
            return {"controls": play(setting.controller, replace(plain, controls=None))}
        except RuntimeError as error:
            return {"controls": [], "cause": str(error)}

    def read(kept: dict[str, Any]) -> Schedule:
        controls: Schedule = np.reshape(np.array(kept["controls"], float), (-1, 3)).tolist()
        return controls

    schedules, key = sampling.results("schedules", setting), key_of(case, setting, other)
    return schedules.get(key, make, read)


# --- Again ----------------------------------------------------------------------------------


def rerun(key: str, folder: Path) -> int:
    """Run a kept point again and print both errors and times; 1 if either differs, else 0.

    key: its hash, or the beginning of one only. Raises ValueError if there is no such point.
    """
    if not re.fullmatch("[0-9a-f]+", key):
        raise ValueError(f"point: expected a hash as in points.csv, got {key!r}")
    found = list((folder / "points").glob(f"{key}*.json"))
    if len(found) != 1:
        raise ValueError(
            f"point: expected the hash of one point in {folder}, got {key!r} of {len(found)}"
        )
    [path] = found
    try:
        stored = json.loads(path.read_text())
        facts, setting = stored["key"], Setting(**stored["key"]["setting"])
        fixed = {"scene": facts["scene"], "knob": "", "setting": setting, "dx": 0.0, "key": ""}
        before = make_point(fixed, stored["result"])
    except (OSError, ValueError, KeyError, TypeError):
        raise ValueError(f"point: expected one that can be read, got {path}") from None
    case = refinement(facts["scene"])
    others = range(len(case.others) + 1)
    other = next((k for k in others if facts["arguments"] == case.given(k)), 0)
    with TemporaryDirectory() as scratch:
        now = measure_point(case, "", setting, Sampling(Path(scratch)), other)
    print(f"{case.scene}, {path.stem}")
    if now.key != path.stem:
        print("note: it was made with other sources than these")
    equal = is_same(before.error, now.error) and not now.differing
    print(f"error kept: {before.error!r}, now: {now.error!r}")
    print("the same to the last bit" if equal else "the errors differ")
    # the time of a blow-up is of no interest
    if not before.good or not before.runs:
        return int(not equal)
    ratio = now.effort / before.effort
    alike = 1 / FACTOR <= ratio <= FACTOR
    verdict = "as before" if alike else f"beyond a factor {FACTOR:g}"
    print(f"processor seconds kept: {before.own:.4g}, now: {now.own:.4g}")
    print(f"time, by the benchmark beside it, now / kept: {ratio:.3g}, {verdict}")
    return int(not (equal and alike))
