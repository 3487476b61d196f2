"""Tables of the study: points, gains, cheapest settings and promises as CSV and Parquet."""

import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from sph_gym.extras import needs_extra
from sph_gym.files import atomic_write, write_csv, write_text
from sph_gym.provenance import source_hash
from sph_gym.recommend import published, series
from sph_gym.recommend.settings import TITLES, Setting, nominal, write_changes
from sph_gym.recommend.tables import write as write_rows
from sph_gym.scenes.shared.refinement import refinement
from sph_gym.studies import machine
from sph_gym.studies.accuracy import analysis
from sph_gym.studies.accuracy.analysis import TARGETS, TIME, ValueGain
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.accuracy.promises import TriedRecommendation, records

# Entries of a point in their order, the setting apart.
COLUMNS = (
    "scene", "knob", "dx", "error", "cause", "seconds", "particles", "substeps", "interactions",
    "compression", "mach", "wall", "own", "rate", "effort", "runs", "spread", "differing", "key",
    "speed",
)  # fmt: skip


def write_scene(points: Sequence[Point], folder: Path) -> None:
    """Write the tables of one scene, and the one from which its settings are recommended."""
    scene, best = points[0].scene, {found.key for found in analysis.front(points, TIME)}
    listed = [{**record(found), "on_front": found.key in best} for found in points]
    _write(listed, folder / f"{scene}_points")
    _write(gain_rows(points), folder / f"{scene}_gains")
    kept = series.fit(points, series.noise_floor(analysis.nominal_series(points)))
    offered = [p for p in points if p.setting.series in kept and kept[p.setting.series].safe]
    sources = source_hash("solver", "scenes", "controllers", "recommend/runs.py")
    comment = f"sources {sources}; {machine.describe()['processor']}; {points[0].speed:.4g}/s"
    write_rows(offered, folder / f"{scene}_lines.csv", comment)


def write_all(points: Sequence[Point], trials: Sequence[TriedRecommendation], folder: Path) -> None:
    """Write the tables of all scenes; trials: of recommendations."""
    by_scene = [list(own) for _, own in groupby(points, lambda point: point.scene)]
    settings = [row for own in by_scene for row in cheapest_rows(own)]
    _write([record(found) for found in points], folder / "points")
    _write(records(trials), folder / "promises")
    _write(settings, folder / "cheapest")
    short = [_published_setting(row) for row in settings]
    gains = [row for own in by_scene for row in _published_gains(own)]
    found = folder / "found"
    _write_published(short, found / "cheapest.csv", published.CHEAPEST)
    _write_published(gains, found / "gains.csv", published.GAINS)
    write_text(found / "cheapest.md", _page(short))


def _write_published(rows: list[dict[str, Any]], path: Path, columns: Sequence[str]) -> None:
    write_csv(path, columns, ([row.get(column, "") for column in columns] for row in rows))


def _write(rows: list[dict[str, Any]], stem: Path) -> None:
    with needs_extra("studies"):
        import pandas as pd
    frame = pd.DataFrame(rows)
    with atomic_write(stem.with_suffix(".csv")) as draft:
        frame.to_csv(draft, index=False)
    with atomic_write(stem.with_suffix(".parquet")) as draft:
        frame.to_parquet(draft, index=False)


def record(point: Point) -> dict[str, Any]:
    """Return a point as a row of a table."""
    computed = {
        "processor_time": point.time,
        "processor_time_per_simulated_second": point.cost,
        "wall_per_simulated_second": point.wall / point.seconds,
        "particle_steps_per_simulated_second": point.particles * point.substeps / point.seconds,
        "interactions_per_simulated_second": point.interactions / point.seconds,
    }
    return {name: getattr(point, name) for name in COLUMNS} | point.setting._asdict() | computed


def gain_rows(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return error, time, work and gain of every value of every knob as rows of a table."""
    rows = []
    for knob in analysis.knobs(points):
        slopes = {
            "elasticity_over_time": analysis.knob_elasticity(points, knob, TIME),
            "elasticity_over_pairs": analysis.knob_elasticity(points, knob, "interactions"),
        }
        found = _sizes(points) if knob == "resolution" else analysis.value_gains(points, knob, TIME)
        rows += [{"scene": points[0].scene, **value._asdict(), **slopes} for value in found]
    return rows


def _sizes(points: Sequence[Point]) -> list[ValueGain]:
    """Return the nominal settings at other resolutions, against the nominal one."""
    start, *others = analysis.nominal_series(points)
    return [
        ValueGain(
            "resolution", str(found.setting.across), found.error / start.error,
            found.cost / start.cost, found.interactions / start.interactions, math.nan, 1,
            found.cause,
        )
        for found in others
    ]  # fmt: skip


def cheapest_rows(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return the measured setting of a scene that takes least time, for some errors.

    error is that of the run, error_without_luck the one that counts.
    """
    by_key, counted = {found.key: found for found in points}, analysis.count(points)
    rows = []
    for target in TARGETS:
        row: dict[str, Any] = {"target": target, "reached": False, "scene": points[0].scene}
        if found := analysis.cheapest(counted, target):
            row |= {"reached": True, "error_without_luck": found.error, **record(by_key[found.key])}
        rows.append(row)
    return rows


def _published_setting(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row of `cheapest_rows` in few words; without a setting if it is one of chance."""
    case = refinement(row["scene"])
    short = {"scene": case.scene, "target": row["target"]}
    if row["reached"] and not case.erratic:
        setting = Setting(**{name: row[name] for name in Setting._fields})
        changes = setting.differences(nominal(case, setting.across))
        short |= {
            "error": f"{row['error_without_luck']:.3g}",
            "seconds": f"{row['processor_time']:.2g}",
            "across": setting.across,
            "changes": ", ".join(write_changes(changes)),
        }
    return short


def _published_gains(points: Sequence[Point]) -> Iterator[dict[str, Any]]:
    """Yield a row for each knob that has an elasticity or a value that went well."""
    for knob in ("resolution", *TITLES):
        row: dict[str, Any] = {"scene": points[0].scene, "knob": knob}
        slope = analysis.knob_elasticity(points, knob, TIME)
        if math.isfinite(slope):
            row["elasticity"] = f"{slope:.2g}"
        best = None if knob == "resolution" else analysis.best_value(points, knob, TIME)
        if best is not None:
            row |= {"value": best.value, "gain": f"{best.gain:.2g}", "bound": best.bound}
        if len(row) > 2:
            yield row


def _page(rows: Sequence[dict[str, Any]]) -> str:
    """Return the cheapest settings of scenes as a table in Markdown."""
    targets = [f"{100 * target:g} %" for target in TARGETS]
    lines = [f"| scene | {' | '.join(targets)} |", "|---" * (len(targets) + 1) + "|"]
    missing = []
    for scene, own in groupby(rows, lambda row: str(row["scene"]).replace("_", " ")):
        cells = [f"{row['seconds']} s, {row['across']}" if "error" in row else "-" for row in own]
        if set(cells) == {"-"}:
            missing.append(scene)
        else:
            lines.append(f"| {scene} | {' | '.join(cells)} |")
    return "\n".join([*lines, *([f"\nNone of them: {', '.join(missing)}."] if missing else [])])
