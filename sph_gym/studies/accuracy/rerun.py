"""One point of the study run again: is its error still the same, to the last bit?"""

import re
from pathlib import Path
from typing import Any

from sph_gym.studies.accuracy import shelf
from sph_gym.studies.accuracy.points import same
from sph_gym.studies.accuracy.policies import needs_schedule
from sph_gym.studies.accuracy.problems import Problem, problem
from sph_gym.studies.accuracy.running import Outcome, execute
from sph_gym.studies.accuracy.settings import Setting


def rerun(key: str, folder: Path) -> int:
    """Run a kept point again and print both errors and times; 1 if the errors differ, else 0.

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
    outcome = execute(scene, setting, other, played)
    return _told(whole, folder, kept, outcome)


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


def _told(key: str, folder: Path, kept: dict[str, Any], outcome: Outcome) -> int:
    before = kept["outcome"]["error"]
    _, times = shelf.times(folder, key)
    taken = ", ".join(f"{own:.4g}" for own in (times or {"own": []})["own"])
    print(f"{kept['scene']}, {key}")
    print(f"error kept: {before!r}, now: {outcome.error!r}")
    print(f"processor seconds kept: {taken or 'none'}; now: {outcome.own:.4g}")
    equal = same(before, outcome.error)
    print("the same to the last bit" if equal else "the errors differ")
    return int(not equal)
