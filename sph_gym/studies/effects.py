"""What every effect costs in every scene when present, and the proof that it is free when absent.

The proof: the package, with a scene that doesn't name the effect, against a copy in which the code
of the effect doesn't exist, on the same scene. The two must have as many instructions, hold as
many bytes and take the same time.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

import sph_gym
from sph_gym import scenes
from sph_gym.studies import variants
from sph_gym.studies.cutting import copy_without
from sph_gym.studies.table import Row
from sph_gym.studies.timing import Runner, in_turns, own_clock, same_home

# Spacing [m] that gives each scene some 3000 particles of fluid.
SPACINGS = {
    "dam_break": 0.0125,
    "drop_impact": 0.008,
    "relaxation": 0.008,
    "hydrostatic_tank": 0.01,
}
# An absent effect may take so much of a step [%]: what cannot be told from nothing.
TIME = 2.0


class Plan(NamedTuple):
    """Scenes and their spacings [m], repetitions, particle-steps of a timed call."""

    spacings: dict[str, float] = SPACINGS
    rounds: int = 61
    work: int = 200_000


FULL = Plan()
QUICK = Plan({"dam_break": SPACINGS["dam_break"]}, 31)


def measure(quick: bool) -> Iterator[Row]:
    """All rows, as they are measured, with a progress bar; quick: the dam break alone.

    Raises ImportError that names the extra to install.
    """
    try:
        from tqdm import tqdm
    except ImportError:
        raise ImportError('studies need more: pip install "sph_gym[studies]"') from None
    with tqdm(tasks(QUICK if quick else FULL), unit="part") as bar:
        for title, rows in bar:
            bar.set_description(title)
            yield from rows()


def tasks(plan: Plan) -> list[tuple[str, Callable[[], Iterable[Row]]]]:
    """Title and rows of every part of the study."""
    parts: list[tuple[str, Callable[[], Iterable[Row]]]] = []
    for scene in plan.spacings:
        for effect in variants.EFFECTS:
            title = f"{scene}, {effect}"
            parts.append((title, partial(present, plan, scene, effect)))
            parts.append((title, partial(absent, plan, scene, effect)))
    return parts


# --- Present --------------------------------------------------------------------------------


def present(plan: Plan, scene: str, effect: str) -> Iterator[Row]:
    """The scene with all it names against the scene without the effect, or with it added.

    Both set out from the same state in every call: the work is compared, not the flow.
    """
    whole = scenes.make(scene, dx=plan.spacings[scene])
    try:
        pair = variants.added(whole, effect), variants.left_out(whole, effect)
    except ValueError:
        # no walls can be added to open space
        return
    runners = [Runner(one, work=plan.work) for one in pair]
    same_home(runners)
    clock = own_clock()
    times = in_turns([partial(runner.seconds, clock) for runner in runners], plan.rounds)
    share = 100 * (1 - float(np.median(times[:, 1] / times[:, 0])))
    cost = float(np.median(times[:, 0] - times[:, 1])) / runners[0].sim.n_fluid * 1e9
    case = f"{effect}, {scene}" + ("" if variants.names(whole, effect) else " (added)")
    yield Row("cost when present", case, share, "% of a step")
    yield Row("cost when present", case, cost, "ns/fluid particle")


# --- Absent ---------------------------------------------------------------------------------


def absent(plan: Plan, scene: str, effect: str) -> Iterator[Row]:
    """The package against a copy without the effect's code, both on a scene without the effect."""
    spec = {
        "scene": scene,
        "arguments": {"dx": plan.spacings[scene]},
        "effect": effect,
        "dtype": "float64",
        "work": plan.work,
    }
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        cut = copy_without(effect, Path(folder))
        packages = Path(sph_gym.__file__).parent, cut
        # both compile at the same time
        workers = [stack.enter_context(Worker(package, spec)) for package in packages]
        ours, theirs = (worker.report() for worker in workers)
        times = in_turns([worker.seconds for worker in workers], plan.rounds)
    yield from compared(f"{effect}, {scene}", ours, theirs, times[:, 0] / times[:, 1])


def compared(
    case: str, ours: dict[str, Any], cut: dict[str, Any], ratios: Iterable[float]
) -> Iterator[Row]:
    """Rows on what the package has more than the copy, and ratios of their times."""
    for key, quantity, unit in (
        ("instructions", "absent: instructions of a step", "more"),
        ("loop", "absent: instructions of the pair loop", "more"),
        ("bytes", "absent: bytes of all arrays", "more"),
    ):
        if ours[key] is not None and cut[key] is not None:
            more = float(ours[key] - cut[key])
            yield Row(quantity, case, more, f"{unit} than {cut[key]}", 0.0)
    time = 100 * (float(np.median(list(ratios))) - 1)
    yield Row("absent: time of a step", case, time, "% more", TIME)


class Worker:
    """A process that runs a package's solver; see worker.py. A context manager."""

    def __init__(self, package: Path, spec: dict[str, Any]) -> None:
        self.package = package
        self._cache = tempfile.TemporaryDirectory()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "sph_gym.studies.worker"],
            cwd=package.parent,
            env=os.environ | {"PYTHONPATH": str(package.parent), "SPH_GYM_CACHE": self._cache.name},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._ask(json.dumps(spec))

    def __enter__(self) -> "Worker":
        return self

    def __exit__(self, *_: object) -> None:
        self._pipe("stdin").close()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._pipe("stdout").close()
        self._cache.cleanup()

    def report(self) -> dict[str, Any]:
        """What the worker says once it has compiled."""
        report: dict[str, Any] = self._answer()
        assert Path(report["package"]).samefile(self.package), report["package"]
        return report

    def seconds(self) -> float:
        """Time of one step [s]."""
        self._ask("time")
        return float(self._answer())

    def _pipe(self, name: str) -> IO[str]:
        pipe: IO[str] = getattr(self._process, name)
        return pipe

    def _ask(self, line: str) -> None:
        self._pipe("stdin").write(line + "\n")
        self._pipe("stdin").flush()

    def _answer(self) -> Any:
        line = self._pipe("stdout").readline()
        if not line:
            raise OSError(f"the process that measures {self.package} ended early")
        return json.loads(line)
