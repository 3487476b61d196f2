"""What the study leaves behind: points, gains and cheapest settings as CSV and Parquet."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sph_gym.studies import machine
from sph_gym.studies.accuracy import figures, fronts, recommend, summary
from sph_gym.studies.accuracy.benchmark import CAREFUL, rate
from sph_gym.studies.accuracy.plan import NUMBERS, knobs, rungs
from sph_gym.studies.accuracy.points import Point, sober, sources
from sph_gym.studies.accuracy.problems import Problem
from sph_gym.studies.accuracy.promises import samples

TIME = "cost"


def write_scene(scene: Problem, points: Sequence[Point], folder: Path) -> None:
    """Tables and picture of one scene, and the table from which its settings are recommended."""
    best = {found.key for found in fronts.front(sober(points), TIME)}
    listed = [{**record(found), "on_front": found.key in best} for found in points]
    _both(listed, folder / f"{scene.scene}_points")
    _both(gains(points), folder / f"{scene.scene}_gains")
    comment = f"sources {sources()}; {machine.describe()['processor']}; {rate(CAREFUL):.4g}/s"
    recommend.write(_on_lines(points), folder / f"{scene.scene}_lines.csv", comment)
    print(f"plot: {figures.draw(scene, points, folder / f'{scene.scene}.png')}")


def write_all(points: Sequence[Point], folder: Path) -> None:
    """Tables and picture of all scenes."""
    _both([record(found) for found in points], folder / "points")
    _both(cheapest(points), folder / "cheapest")
    by_scene: dict[str, list[Point]] = {}
    for found in points:
        by_scene.setdefault(found.scene, []).append(found)
    print(f"plot: {summary.draw(by_scene, folder / 'summary.png')}")


def _on_lines(points: Sequence[Point]) -> list[recommend.Sample]:
    """Only what a recommendation can be made of."""
    every = samples(points)
    lines = {line.setting for line in recommend.fit(every)}
    return [sample for sample in every if sample.setting.line in lines]


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
        "wall_per_simulated_second": point.cost,
        "particle_steps_per_simulated_second": point.particle_steps,
        "interactions_per_simulated_second": point.interactions / point.seconds,
    }
    return {**fields, **setting._asdict(), **computed}


def gains(points: Sequence[Point]) -> list[dict[str, Any]]:
    """What every value of every knob does to error, time and work, and what it buys."""
    start, ladder, rows = points[0], rungs(points), []
    for knob in knobs(points):
        turned = [found for found in points if found.knob == knob]
        slope = fronts.elasticity([start, *turned], TIME) if knob in NUMBERS else float("nan")
        for found in turned:
            value = found.setting.across if knob == "resolution" else getattr(found.setting, knob)
            rows.append(
                {
                    "scene": found.scene,
                    "knob": knob,
                    "value": str(value),
                    "error_factor": found.error / start.error,
                    "time_factor": found.cost / start.cost,
                    "work_factor": found.interactions / start.interactions,
                    "gain_at_equal_error": fronts.worth(ladder, found, TIME),
                    "elasticity_of_knob": slope,
                    "blew_up": found.cause,
                }
            )
    return rows


def cheapest(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Of every scene, the measured setting that takes least time for some errors."""
    rows = []
    for scene in dict.fromkeys(found.scene for found in points):
        own = sober([found for found in points if found.scene == scene])
        for target in fronts.TARGETS:
            found = fronts.cheapest(own, target, TIME)
            if found is not None:
                rows.append({"target": target, **record(found)})
    return rows
