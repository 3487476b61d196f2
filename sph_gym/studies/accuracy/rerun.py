"""One point of the study run again: are its error, to the last bit, and its time the same?"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.studies.accuracy import shelf
from sph_gym.studies.accuracy.benchmark import rate
from sph_gym.studies.accuracy.points import same
from sph_gym.studies.accuracy.policies import needs_schedule
from sph_gym.studies.accuracy.problems import Problem, problem
from sph_gym.studies.accuracy.running import Outcome, execute
from sph_gym.studies.accuracy.settings import Setting

# A time, corrected by the benchmark, may be so many times the kept one, or so many times less.
FACTOR = 1.5
# What is short is run more often, up to so many times and so many seconds.
RUNS, PATIENCE = 3, 1.0


def rerun(key: str, folder: Path) -> int:
    """Run a kept point again and print both errors and times; 1 if either differs, else 0.

    key: its hash, or the beginning of one only. Raises ValueError if there is no such point.
    """
    whole = _find(key, folder)
    _, kept = shelf.record(folder, whole)
    if kept is None:
        raise ValueError(f"point: expected one that can be read, got {whole}")
    scene, setting, other = _case(kept)
    played = None
    if needs_schedule(setting.controller):
        _, schedule = shelf.schedule(folder, whole)
        played = (schedule or {"controls": []})["controls"]
        if not played:
            raise ValueError(f"point: expected one with a schedule of its agent, got {whole}")
    if shelf.key_of(shelf.manifest(scene, setting, other)) != whole:
        print("note: it was made with other sources than these")
    outcomes, efforts = list[Outcome](), list[float]()
    while not outcomes or (len(outcomes) < RUNS and sum(o.own for o in outcomes) < PATIENCE):
        before = rate()
        outcomes.append(execute(scene, setting, other, played))
        efforts.append(outcomes[-1].own * (before + rate()) / 2)
    return _told(whole, folder, kept, outcomes, efforts)


def _find(key: str, folder: Path) -> str:
    if not re.fullmatch("[0-9a-f]+", key):
        raise ValueError(f"point: expected a hash as in points.csv, got {key!r}")
    found = sorted(path.stem for path in (folder / "points").glob(f"{key}*.json"))
    if len(found) != 1:
        raise ValueError(
            f"point: expected the hash of one point in {folder}, got {key!r} of {len(found)}"
        )
    return found[0]


def _case(kept: dict[str, Any]) -> tuple[Problem, Setting, int]:
    scene, setting = problem(kept["scene"]), Setting(**kept["setting"])
    cases = range(len(scene.others) + 1)
    fitting = (other for other in cases if kept["arguments"] == scene.given(other))
    return scene, setting, next(fitting, 0)


def _told(
    key: str,
    folder: Path,
    kept: dict[str, Any],
    outcomes: Sequence[Outcome],
    efforts: Sequence[float],
) -> int:
    before = kept["outcome"]["error"]
    equal = all(same(before, outcome.error) for outcome in outcomes)
    print(f"{kept['scene']}, {key}")
    print(f"error kept: {before!r}, now: {outcomes[0].error!r}")
    print("the same to the last bit" if equal else "the errors differ")
    _, times = shelf.times(folder, key)
    taken = times or {"own": [], "rate": []}
    own = ", ".join(f"{seconds:.4g}" for seconds in taken["own"])
    now = ", ".join(f"{outcome.own:.4g}" for outcome in outcomes)
    print(f"processor seconds kept: {own or 'none'}; now: {now}")
    # a blow-up is run once, and its time is of no interest
    if not own or not before > 0:
        return int(not equal)
    usual = np.median(np.multiply(taken["own"], taken["rate"]))
    ratio = float(np.median(efforts) / usual)
    alike = 1 / FACTOR <= ratio <= FACTOR
    said = "as before" if alike else f"beyond a factor {FACTOR:g}"
    print(f"time, by the benchmark beside it, now / kept: {ratio:.3g}, {said}")
    return int(not (equal and alike))
