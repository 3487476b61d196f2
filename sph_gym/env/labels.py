"""What is known of each scene as a game: whether tricks lose, and how much there is to gain.

A benchmark is a scene where cheap tricks lose to the tuned CFL rule, so that its scores mean
something; on a diagnostic they may win, and it is there to look at the solver. How much tuning
gains over the best static setting is another matter, which `python -m sph_gym study headroom`
measures and writes as a table; a copy of it comes with the package.
"""

import csv
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from sph_gym.env import instances

HEADROOM = Path(__file__).parent / "headroom.csv"
COLUMNS = ("scene", "headroom", "label")
UNMEASURED = "not measured"
NOWHERE = "unknown: nowhere are both within tolerance"
MEANINGS = {
    "benchmark": "compare agents on it: cheap tricks lose to the tuned CFL rule",
    "diagnostic": "look at the solver with it, compare nobody: cheap tricks may win",
}


class Measured(NamedTuple):
    """Work of the best static setting / work of the look-ahead oracle, None if unknown; label."""

    headroom: float | None
    label: str


@cache
def measured(path: Path = HEADROOM) -> Mapping[str, Measured]:
    """What `study headroom` has found, by scene; nothing where it hasn't been run.

    Raises OSError if the table can't be read.
    """
    if not path.is_file():
        return {}
    try:
        with path.open(newline="") as file:
            reader = csv.DictReader(file, strict=True)
            rows = list(reader)
        if tuple(reader.fieldnames or ()) != COLUMNS:
            raise ValueError(f"expected columns {', '.join(COLUMNS)}")
        return {row["scene"]: _measured(row["headroom"], row["label"]) for row in rows}
    except (ValueError, KeyError, TypeError, csv.Error) as error:
        raise OSError(f"{path} is damaged ({type(error).__name__}: {error})") from None


def _measured(gain: str, told: str) -> Measured:
    return Measured(float(gain) if gain else None, told)


def headroom(scene: str, path: Path = HEADROOM) -> str:
    """What there is to gain on a scene, in words."""
    found = measured(path).get(scene)
    if found is None:
        return UNMEASURED
    return NOWHERE if found.headroom is None else f"{found.headroom:.2f} times less work"


def label(scene: str, path: Path = HEADROOM) -> str:
    """ "benchmark" or "diagnostic", and what else is known of the headroom."""
    found, given = measured(path).get(scene), instances.label(scene)
    # the reasons are those of the code, the headroom is that of the table
    return found.label if found is not None and found.label.startswith(given) else given


def write(found: Iterable[tuple[str, float | None, str]], path: Path) -> None:
    """Write scenes, headrooms and labels as the table that `measured` reads."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for scene, gain, told in found:
            writer.writerow([scene, "" if gain is None else f"{gain:.4g}", told])
    measured.cache_clear()
