"""Run one kept point again: are its error, to the last bit, and its time the same?"""

import json
import re
from pathlib import Path
from tempfile import TemporaryDirectory

from sph_gym.recommend.settings import Setting
from sph_gym.scenes.shared.refinement import refinement
from sph_gym.studies.accuracy.points import Sampling, is_same, make_point, measure_point

# A time, corrected by the benchmark, may be so many times the kept one, or so many times less.
FACTOR = 1.5


def rerun(key: str, folder: Path) -> int:
    """Run a kept point again and print both errors and times; 1 if either differs, else 0.

    key: its hash, or the beginning of one only. Raises ValueError if there is no such point.
    """
    path = _find(key, folder)
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


def _find(key: str, folder: Path) -> Path:
    if not re.fullmatch("[0-9a-f]+", key):
        raise ValueError(f"point: expected a hash as in points.csv, got {key!r}")
    found = sorted((folder / "points").glob(f"{key}*.json"))
    if len(found) != 1:
        raise ValueError(
            f"point: expected the hash of one point in {folder}, got {key!r} of {len(found)}"
        )
    return found[0]
