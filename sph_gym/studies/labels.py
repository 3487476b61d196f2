"""The labels of scenes, and why they have them: printed and written after a study's table."""

import math
from collections.abc import Sequence
from pathlib import Path

from sph_gym.env import SCENES, instances, labels
from sph_gym.studies.table import Row

# The rows of the study of headroom that labels are made of.
GAIN, NONE = "headroom over the best static", "no headroom: both within tolerance nowhere"


def explain(rows: Sequence[Row], path: Path) -> None:
    """Print for each scene of the rows that is no benchmark why it is none.

    Where rows tell of headroom, also write the table of `sph_gym.env.labels` next to `path`.
    """
    shown = {row.case.split(",")[0].split("/")[0] for row in rows}
    for scene, reason in instances.DIAGNOSTIC.items():
        if scene in shown:
            print(f"{scene} is diagnostic, no benchmark: {reason}")
    found = headrooms(rows)
    if found:
        table = path.with_name(f"{path.stem}_labels.csv")
        labels.write(found, table)
        print(f"labels: {table}; the pages of environments show its copy {labels.HEADROOM}")


def headrooms(rows: Sequence[Row]) -> list[tuple[str, float | None, str]]:
    """Return scene, headroom or None, and label of each scene whose headroom the rows tell."""
    found: dict[str, tuple[float | None, str]] = {}
    for row in rows:
        scene, _, label = row.case.partition(", ")
        if scene in SCENES and row.quantity in (GAIN, NONE):
            known = row.quantity == GAIN and math.isfinite(row.value)
            found[scene] = (row.value if known else None, label)
    return [(scene, *found[scene]) for scene in found]
