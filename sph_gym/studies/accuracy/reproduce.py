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
from sph_gym.studies.accuracy.points import Sampling, efforts_of, is_same, key_of

# A time, corrected by the benchmark, may be so many times the kept one, or so many times less.
FACTOR = 1.5
# A run that is short is repeated, up to so many times and so many seconds.
RUNS, PATIENCE = 3, 1.0


def rerun(key: str, folder: Path) -> int:
    """Run a kept point again and print both errors and times; 1 if either differs, else 0.

    key: its hash, or the beginning of one only. Raises ValueError if there is no such point.
    """
    path = _find(key, folder)
    facts, kept = _read(path)
    case, setting = refinement(facts["scene"]), Setting(**facts["setting"])
    others = range(len(case.others) + 1)
    other = next((k for k in others if facts["arguments"] == case.given(k)), 0)
    now = Sampling(folder).results("points", setting).path(key_of(case, setting, other))
    if now.stem != path.stem:
        print("note: it was made with other sources than these")
    schedule = None
    if is_agent(setting.controller):
        schedule = _read(folder / "schedules" / path.name)[1]["controls"]
        if not schedule:
            raise ValueError(f"point: expected one whose agent got to its end, got {path.stem}")
    outcomes, efforts = list[RunOutcome](), list[float]()
    while not outcomes or (len(outcomes) < RUNS and sum(run.own for run in outcomes) < PATIENCE):
        before = rate()
        outcomes.append(execute(case, setting, other, schedule))
        efforts.append(outcomes[-1].own * (before + rate()) / 2)
    print(f"{case.scene}, {path.stem}")
    return int(not (_compare_errors(kept, outcomes) & _compare_times(kept, outcomes, efforts)))


def _find(key: str, folder: Path) -> Path:
    if not re.fullmatch("[0-9a-f]+", key):
        raise ValueError(f"point: expected a hash as in points.csv, got {key!r}")
    found = sorted((folder / "points").glob(f"{key}*.json"))
    if len(found) != 1:
        raise ValueError(
            f"point: expected the hash of one point in {folder}, got {key!r} of {len(found)}"
        )
    return found[0]


def _read(path: Path) -> tuple[Any, Any]:
    """Return key and result in a file of a store, whatever sources it was made with."""
    try:
        stored = json.loads(path.read_text())
        return stored["key"], stored["result"]
    except (OSError, ValueError, KeyError, TypeError):
        raise ValueError(f"point: expected one that can be read, got {path}") from None


def _compare_errors(kept: dict[str, Any], now: Sequence[RunOutcome]) -> bool:
    before = kept["outcome"]["error"]
    equal = all(is_same(before, run.error) for run in now)
    print(f"error kept: {before!r}, now: {now[0].error!r}")
    print("the same to the last bit" if equal else "the errors differ")
    return equal


def _compare_times(
    kept: dict[str, Any], now: Sequence[RunOutcome], efforts: Sequence[float]
) -> bool:
    own = ", ".join(f"{times[1]:.4g}" for times in kept["times"])
    print(f"processor seconds kept: {own or 'none'}; now: {', '.join(f'{r.own:.4g}' for r in now)}")
    # a blow-up is run once, and its time is of no interest
    if not own or not kept["outcome"]["error"] > 0:
        return True
    ratio = float(np.median(efforts) / np.median(efforts_of(kept)))
    alike = 1 / FACTOR <= ratio <= FACTOR
    verdict = "as before" if alike else f"beyond a factor {FACTOR:g}"
    print(f"time, by the benchmark beside it, now / kept: {ratio:.3g}, {verdict}")
    return alike
