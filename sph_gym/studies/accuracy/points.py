"""A point of a diagram: one run, its error, its work and its times, each kept on disk.

Error and work are the same whenever a point is run again, to the last bit, and lie in one file
with all that they depend on; times lie in another, so that they can be taken anew.
"""

import hashlib
import json
import math
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import sph_gym
from sph_gym.solver.jit import source_hash
from sph_gym.studies import machine
from sph_gym.studies.accuracy import policies
from sph_gym.studies.accuracy.benchmark import rate
from sph_gym.studies.accuracy.problems import Problem
from sph_gym.studies.accuracy.running import Outcome, execute
from sph_gym.studies.accuracy.settings import Setting, build

# What is short is run more often, up to so much time [s] and so many runs.
PATIENCE, MOST = 0.3, 5
# An error above this is none that a diagram could show: 1000 %.
ABSURD = 10.0
# Of an agent that doesn't get to the end of its own episode.
LOST = Outcome(math.nan, "its agent blew up", [], 1.0, 0, 0, 0.0, math.nan, math.nan)


class Point(NamedTuple):
    """What is known of a run.

    knob: which one was turned; error: share of what the problem says, nan after a blow-up; cause:
    of the blow-up; seconds: of physical time; particles: fluid and wall; substeps, interactions:
    steps and pairs (i, j) of their force evaluations; wall, own: median seconds of the whole run
    on the wall and of the thread's processor time; rate: of the benchmark right before and after
    [particle-steps/s]; effort: median of own times rate, the particle-steps of the benchmark that
    take as long; runs: of which these are medians, spread: the range of their efforts / the
    median; differing: runs whose error differed, which should be none; speed: of the
    benchmark on the machine on which times are told.
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


@cache
def sources(agents: bool = False) -> str:
    """Hash of all of ours that an error depends on; agents: of one who learned or looks ahead."""
    root = Path(sph_gym.__file__).parent
    parts = ("solver", "scenes", "controllers", *(("env",) if agents else ()))
    paths = [path for part in parts for path in sorted((root / part).rglob("*.*"))]
    here = Path(__file__).parent
    paths += [here / f"{name}.py" for name in ("running", "settings", "policies")]
    digest = hashlib.sha256(f"{source_hash()} {np.__version__}".encode())
    for path in paths:
        if path.suffix in (".py", ".csv"):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def manifest(problem: Problem, setting: Setting, other: bool) -> dict[str, Any]:
    """All that the error of a point depends on."""
    agents = policies.needs_schedule(setting.controller)
    network = policies.network(setting.controller, problem.scene)
    learned = setting.controller in policies.LEARNED and network.is_file()
    return {
        "scene": problem.scene,
        "arguments": problem.given(other),
        "length": problem.length,
        "measure": problem.measure,
        "joined": problem.joined,
        "setting": setting._asdict(),
        "sources": sources(agents),
        "network": hashlib.sha256(network.read_bytes()).hexdigest()[:16] if learned else "",
        "versions": machine.describe(),
    }


def key_of(facts: dict[str, Any]) -> str:
    """Of a manifest: what its files are called; who runs it where doesn't count."""
    counted = {name: value for name, value in facts.items() if name != "versions"}
    return hashlib.sha256(json.dumps(counted, sort_keys=True).encode()).hexdigest()[:20]


def save(path: Path, content: dict[str, Any]) -> None:
    """Write JSON, so that an interruption leaves the old file or the new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_suffix(".tmp")
    draft.write_text(json.dumps(content, indent=1))
    draft.replace(path)


def point(
    problem: Problem,
    knob: str,
    setting: Setting,
    folder: Path,
    repeats: int = 3,
    again: bool = False,
    other: bool = False,
) -> Point:
    """A point from `folder`, or from as many runs as it takes; again: take its times anew.

    An interruption loses at most the run in hand.
    """
    facts = manifest(problem, setting, other)
    key = key_of(facts)
    record, times = folder / "points" / f"{key}.json", folder / "times" / f"{key}.json"
    played = _schedule(problem, setting, other, folder, key)
    taken: dict[str, Any] = {"wall": [], "own": [], "rate": [], "differing": 0}
    _run = partial(_run_once, problem, setting, other, played, record, taken, facts)
    if not record.exists():
        _run()
    elif times.exists() and not again:
        # in place, since further runs are entered there
        taken.update(json.loads(times.read_text()))
    found = json.loads(record.read_text())
    while not _enough(found, taken, repeats):
        _run()
        save(times, taken)
    if not times.exists():
        save(times, taken)
    return _point(problem, knob, setting, found, taken, key, other)


def _enough(found: dict[str, Any], taken: dict[str, Any], repeats: int) -> bool:
    """Whether a median can be taken; a blow-up needs no time."""
    n = len(taken["wall"])
    if found["outcome"]["cause"] or n >= MOST:
        return True
    return n >= repeats and sum(taken["own"]) >= PATIENCE


def _run_once(
    problem: Problem,
    setting: Setting,
    other: bool,
    played: policies.Schedule | None,
    record: Path,
    taken: dict[str, Any],
    facts: dict[str, Any],
) -> None:
    """Run, and enter the time; the first run writes the record, later ones must agree with it."""
    if played is not None and not played:
        outcome, rates = LOST._asdict(), [math.nan]
    else:
        before = rate()
        outcome = execute(problem, setting, other, played)._asdict()
        rates = [before, rate()]
    times = {name: outcome.pop(name) for name in ("wall", "own")}
    if record.exists():
        kept = json.loads(record.read_text())["outcome"]["error"]
        taken["differing"] += json.dumps(kept) != json.dumps(outcome["error"])
    else:
        save(record, {"hash": record.stem, **facts, "outcome": outcome})
    for name, value in times.items():
        taken[name].append(value)
    taken["rate"].append(float(np.mean(rates)))


def _schedule(
    problem: Problem, setting: Setting, other: bool, folder: Path, key: str
) -> policies.Schedule | None:
    """What an agent does, from the folder or from itself; None for rules and fixed settings.

    Nothing if it blew up.
    """
    if not policies.needs_schedule(setting.controller):
        return None
    path = folder / "schedules" / f"{key}.json"
    if not path.exists():
        scene = replace(nominal_scene(problem, setting, other), controls=None)
        try:
            save(path, {"controls": policies.schedule(setting.controller, scene)})
        except RuntimeError as error:
            save(path, {"controls": [], "cause": str(error)})
    controls: policies.Schedule = json.loads(path.read_text())["controls"]
    return controls


def nominal_scene(problem: Problem, setting: Setting, other: bool) -> Any:
    """The scene that an agent plays: with the article's own controls to begin with."""
    return build(problem, setting._replace(step=1.0, sound=1.0), other)


def _point(
    problem: Problem,
    knob: str,
    setting: Setting,
    found: dict[str, Any],
    taken: dict[str, Any],
    key: str,
    other: bool,
) -> Point:
    outcome = found["outcome"]
    efforts = np.multiply(taken["own"], taken["rate"])
    wall, own, rate_then, effort = (
        float(np.median(values)) if len(values) else math.nan
        for values in (taken["wall"], taken["own"], taken["rate"], efforts)
    )
    spread = float(np.ptp(efforts)) / effort if len(efforts) else 0.0
    return Point(
        problem.scene, knob, setting, problem.metres(other) / setting.across, outcome["error"],
        outcome["cause"], outcome["seconds"], outcome["particles"], outcome["substeps"],
        outcome["interactions"], wall, own, rate_then, effort, len(taken["wall"]),
        spread, taken["differing"], key, rate_then,
    )  # fmt: skip
