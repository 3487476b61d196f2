"""Run one kept point again: are its error, to the last bit, and its time the same?"""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.recommend.runs import RunOutcome, execute, rate
from sph_gym.recommend.settings import Setting, is_agent
from sph_gym.scenes.refinement import refinement
from sph_gym.studies.accuracy.points import Sampling, is_record, is_same, key_of

# A time, corrected by the benchmark, may be so many times the kept one, or so many times less.
FACTOR = 1.5
# A run that is short is repeated, up to so many times and so many seconds.
RUNS, PATIENCE = 3, 1.0


def rerun(key: str, folder: Path) -> int:
    """Run a kept point again and print both errors and times; 1 if either differs, else 0.

    key: its hash, or the beginning of one only. Raises ValueError if there is no such point.
    """
    facts, kept, stem = _find(key, folder)
    case, setting = refinement(facts["scene"]), Setting(**facts["setting"])
    others = range(len(case.others) + 1)
    other = next((k for k in others if facts["arguments"] == case.given(k)), 0)
    sampling = Sampling(folder)
    if sampling.results("points", setting).path(key_of(case, setting, other)).stem != stem:
        print("note: it was made with other sources than these")
    schedule = None
    if is_agent(setting.controller):
        schedule = (_read(folder / "schedules" / f"{stem}.json") or {}).get("controls")
        if not schedule:
            raise ValueError(f"point: expected one with a schedule of its agent, got {stem}")
    outcomes, efforts = list[RunOutcome](), list[float]()
    while not outcomes or (len(outcomes) < RUNS and sum(run.own for run in outcomes) < PATIENCE):
        before = rate()
        outcomes.append(execute(case, setting, other, schedule))
        efforts.append(outcomes[-1].own * (before + rate()) / 2)
    print(f"{case.scene}, {stem}")
    equal = _compare_errors(kept["outcome"]["error"], [run.error for run in outcomes])
    print(f"processor seconds now: {', '.join(f'{run.own:.4g}' for run in outcomes)}")
    # a blow-up is run once, and its time is of no interest
    times = _read(folder / "times" / f"{stem}.json") if kept["outcome"]["error"] > 0 else None
    return int(not (_compare_times(times, efforts) and equal))


def _find(key: str, folder: Path) -> tuple[dict[str, Any], dict[str, Any], str]:
    """Return key, record and hash of a kept point."""
    if not re.fullmatch("[0-9a-f]+", key):
        raise ValueError(f"point: expected a hash as in points.csv, got {key!r}")
    found = sorted((folder / "points").glob(f"{key}*.json"))
    if len(found) != 1:
        raise ValueError(
            f"point: expected the hash of one point in {folder}, got {key!r} of {len(found)}"
        )
    kept = _read(found[0])
    if not is_record(kept):
        raise ValueError(f"point: expected one that can be read, got {found[0].stem}")
    return json.loads(found[0].read_text())["key"], kept, found[0].stem


def _read(path: Path) -> Any:
    """Return the result in a file of a store, whatever sources it was made with."""
    try:
        return json.loads(path.read_text())["result"]
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _compare_errors(kept: float, now: Sequence[float]) -> bool:
    equal = all(is_same(kept, error) for error in now)
    print(f"error kept: {kept!r}, now: {now[0]!r}")
    print("the same to the last bit" if equal else "the errors differ")
    return equal


def _compare_times(times: Any, efforts: Sequence[float]) -> bool:
    if not times or not times["own"]:
        return True
    print(f"processor seconds kept: {', '.join(f'{own:.4g}' for own in times['own'])}")
    usual = np.median(np.multiply(times["own"], times["rate"]))
    ratio = float(np.median(efforts) / usual)
    alike = 1 / FACTOR <= ratio <= FACTOR
    verdict = "as before" if alike else f"beyond a factor {FACTOR:g}"
    print(f"time, by the benchmark beside it, now / kept: {ratio:.3g}, {verdict}")
    return alike
