"""What the study leaves behind: points, gains and cheapest settings as CSV and Parquet."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sph_gym.studies import machine
from sph_gym.studies.accuracy import figures, fronts, known, lines, luck, promises, summary
from sph_gym.studies.accuracy import gains as buying
from sph_gym.studies.accuracy.plan import NUMBERS, knobs, rungs
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.accuracy.problems import Problem
from sph_gym.studies.accuracy.promises import Trial, samples
from sph_gym.studies.accuracy.samples import Sample, write
from sph_gym.studies.accuracy.shelf import sources

TIME = "cost"


def write_scene(scene: Problem, points: Sequence[Point], folder: Path) -> None:
    """Tables and picture of one scene, and the table from which its settings are recommended."""
    best = {found.key for found in luck.front(points, TIME)}
    listed = [{**record(found), "on_front": found.key in best} for found in points]
    _both(listed, folder / f"{scene.scene}_points")
    _both(gains(points), folder / f"{scene.scene}_gains")
    comment = f"sources {sources()}; {machine.describe()['processor']}; {points[0].speed:.4g}/s"
    write(_on_lines(points), folder / f"{scene.scene}_lines.csv", comment)
    print(f"plot: {figures.draw(scene, points, folder / f'{scene.scene}.png')}")


def write_all(points: Sequence[Point], trials: Sequence[Trial], folder: Path) -> None:
    """Tables and picture of all scenes; trials: of recommendations."""
    _both([record(found) for found in points], folder / "points")
    _both(promises.records(trials), folder / "promises")
    _both(cheapest(points), folder / "cheapest")
    by_scene: dict[str, list[Point]] = {}
    for found in points:
        by_scene.setdefault(found.scene, []).append(found)
    known.write(by_scene, folder / "found")
    (folder / "found" / "cheapest.md").write_text(known.page(folder / "found", list(by_scene)))
    print(f"plot: {summary.draw(by_scene, folder / 'summary.png')}")


def _on_lines(points: Sequence[Point]) -> list[Sample]:
    """Only what a recommendation can be made of."""
    every = samples(points)
    offered = {line.setting for line in lines.fit(every)}
    return [sample for sample in every if sample.setting.line in offered]


def _both(listed: list[dict[str, Any]], stem: Path) -> None:
    try:
        import pandas as pd
    except ImportError:
        raise ImportError('tables need more: pip install "sph_gym[studies]"') from None
    frame = pd.DataFrame(listed)
    stem.parent.mkdir(parents=True, exist_ok=True)
    frame.to_csv(stem.with_suffix(".csv"), index=False)
    frame.to_parquet(stem.with_suffix(".parquet"), index=False)


def record(point: Point) -> dict[str, Any]:
    """A point as a row of a table."""
    fields = point._asdict()
    setting = fields.pop("setting")
    computed = {
        "processor_time": point.time,
        "processor_time_per_simulated_second": point.cost,
        "wall_per_simulated_second": point.wall / point.seconds,
        "particle_steps_per_simulated_second": point.particle_steps,
        "interactions_per_simulated_second": point.interactions / point.seconds,
    }
    return {**fields, **setting._asdict(), **computed}


def gains(points: Sequence[Point]) -> list[dict[str, Any]]:
    """What every value of every knob does to error, time and work, and what it buys."""
    rows = []
    for knob in knobs(points):
        slopes = [
            buying.elasticity(points, knob, cost) if knob in NUMBERS else float("nan")
            for cost in (TIME, "interactions")
        ]
        for found in (
            _resolved(points) if knob == "resolution" else buying.values(points, knob, TIME)
        ):
            rows.append(
                {
                    "scene": points[0].scene,
                    **found._asdict(),
                    "elasticity_over_time": slopes[0],
                    "elasticity_over_pairs": slopes[1],
                }
            )
    return rows


def _resolved(points: Sequence[Point]) -> list[buying.Value]:
    """The nominal settings at other resolutions, against the nominal one."""
    start, *others = rungs(points)
    return [
        buying.Value(
            "resolution", str(found.setting.across), found.error / start.error,
            found.cost / start.cost, found.interactions / start.interactions, math.nan, 1,
            found.cause,
        )
        for found in others
    ]  # fmt: skip


def cheapest(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Of every scene, the measured setting that takes least time for some errors.

    error is that of the run, error_without_luck the one that counts.
    """
    rows = []
    for scene in dict.fromkeys(found.scene for found in points):
        own = {found.key: found for found in points if found.scene == scene}
        counted = luck.sober(list(own.values()))
        for target in fronts.TARGETS:
            row: dict[str, Any] = {"target": target, "reached": False, "scene": scene}
            found = fronts.cheapest(counted, target, TIME)
            if found is not None:
                row |= {"reached": True, "error_without_luck": found.error}
                row |= record(own[found.key])
            rows.append(row)
    return rows
