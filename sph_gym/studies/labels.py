"""The labels of scenes, and why they have them: printed and written after a study's table."""

import math
from collections.abc import Sequence
from pathlib import Path

from sph_gym.env import SCENES, instances
from sph_gym.files import write_csv
from sph_gym.studies.table import Row

# The rows of the study of headroom that labels are made of.
GAIN, NONE = "headroom over the best static", "no headroom: both within tolerance nowhere"


def explain(rows: Sequence[Row], path: Path) -> None:
    """Print for each scene of the rows that is no benchmark why it is none.

    Where rows tell of headroom, also write them as a table next to `path`.
    """
    shown = {row.case.split(",")[0].split("/")[0] for row in rows}
    for scene, reason in instances.DIAGNOSTIC.items():
        if scene in shown:
            print(f"{scene} is diagnostic, no benchmark: {reason}")
    found = headrooms(rows)
    if found:
        table = path.with_name(f"{path.stem}_labels.csv")
        rounded = ((n, "" if gain is None else f"{gain:.4g}", label) for n, gain, label in found)
        write_csv(table, ("scene", "headroom", "label"), rounded)
        print(f"labels: {table}; the pages of environments show those of FAMILY in sph_gym/scenes")


def headrooms(rows: Sequence[Row]) -> list[tuple[str, float | None, str]]:
    """Return scene, headroom or None, and label of each scene whose headroom the rows tell."""
    found: dict[str, tuple[float | None, str]] = {}
    for row in rows:
        scene, _, label = row.case.partition(", ")
        if scene in SCENES and row.quantity in (GAIN, NONE):
            known = row.quantity == GAIN and math.isfinite(row.value)
            found[scene] = (row.value if known else None, label)
    return [(scene, *told) for scene, told in found.items()]
