"""Why scenes are labelled as they are: what a study prints after its table."""

from collections.abc import Sequence
from pathlib import Path

from sph_gym.env import instances
from sph_gym.studies.table import Row


def explain(rows: Sequence[Row], path: Path) -> None:
    """Print why those scenes of the rows are no benchmarks that aren't; path: not used."""
    shown = {row.case.split(",")[0].split("/")[0] for row in rows}
    for scene, reason in instances.DIAGNOSTIC.items():
        if scene in shown:
            print(f"{scene} is diagnostic, no benchmark: {reason}")
