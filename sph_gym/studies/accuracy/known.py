"""What the study found of every scene, in two small tables that come with the package.

cheapest.csv: the measured setting that takes least time for 5, 2, 1 and 0.5 %; gains.csv: what each
knob buys by its best value, and its elasticity.
"""

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from sph_gym.studies.accuracy import fronts, gains, luck
from sph_gym.studies.accuracy.figures import STYLES, words
from sph_gym.studies.accuracy.plan import NUMBERS
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.accuracy.problems import problem
from sph_gym.studies.accuracy.settings import nominal

TIME = "cost"
# Gains below it are none.
NOTICED = 1.05
CHEAPEST = ("scene", "target", "error", "seconds", "across", "changes")
GAINS = ("scene", "knob", "elasticity", "value", "gain", "bound")


def write(by_scene: Mapping[str, Sequence[Point]], folder: Path) -> None:
    """Both tables, into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    tables = {
        "cheapest": (CHEAPEST, [row for points in by_scene.values() for row in _cheapest(points)]),
        "gains": (GAINS, [row for points in by_scene.values() for row in _gains(points)]),
    }
    for name, (columns, rows) in tables.items():
        with (folder / f"{name}.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, columns)
            writer.writeheader()
            writer.writerows(rows)


def _cheapest(points: Sequence[Point]) -> Iterator[dict[str, Any]]:
    """One row for each error; without a setting where it isn't reached, or only by chance."""
    scene = points[0].scene
    counted = [] if problem(scene).erratic else luck.sober(points)
    for target in fronts.TARGETS:
        row: dict[str, Any] = {"scene": scene, "target": target}
        found = fronts.cheapest(counted, target, TIME)
        if found is not None:
            start = nominal(problem(scene), found.setting.across)
            row |= {
                "error": f"{found.error:.3g}", "seconds": f"{found.time:.2g}",
                "across": found.setting.across,
                "changes": ", ".join(words(found.setting.differences(start))),
            }  # fmt: skip
        yield row


def _gains(points: Sequence[Point]) -> Iterator[dict[str, Any]]:
    """One row for each knob that has an elasticity or a value that went well."""
    for knob in ("resolution", *STYLES):
        row: dict[str, Any] = {"scene": points[0].scene, "knob": knob}
        slope = gains.elasticity(points, knob, TIME) if knob in NUMBERS else math.nan
        if math.isfinite(slope):
            row["elasticity"] = f"{slope:.2g}"
        best = None if knob == "resolution" else gains.best(points, knob, TIME)
        if best is not None:
            row |= {"value": best.value, "gain": f"{best.gain:.2g}", "bound": best.bound}
        if len(row) > 2:
            yield row


# --- Telling --------------------------------------------------------------------------------


def read(name: str, scene: str) -> list[dict[str, str]]:
    """Rows of a table of the package for a scene."""
    place = resources.files("sph_gym.studies.accuracy") / "found" / f"{name}.csv"
    rows = csv.DictReader(place.read_text().splitlines())
    return [row for row in rows if row["scene"] == scene]


def tell(scene: str) -> Iterator[str]:
    """Lines of text about a scene. Raises ValueError for an unknown one."""
    found = problem(scene)
    yield f"{scene}: {found.measure} [% {found.of}]"
    yield f"How it converges. {found.note}"
    yield ""
    yield "cheapest measured settings, luck apart; processor seconds of one thread:"
    for row in read("cheapest", scene):
        target = f"  {100 * float(row['target']):g} %"
        if not row["error"]:
            yield f"{target:<8}not reached, or only by chance"
            continue
        what = ", ".join(filter(None, [f"{found.length} / {row['across']}", row["changes"]]))
        yield f"{target:<8}{row['seconds']:>7} s  {what}"
    yield ""
    yield "one knob alone: d log error / d log time, and how many times faster at equal error"
    for row in read("gains", scene):
        label = STYLES[row["knob"]][2] if row["knob"] in STYLES else "resolution"
        gain = " ".join(filter(None, [row["bound"], row["gain"]]))
        value = f"{gain} with {row['value']}" if row["value"] else ""
        if value and float(row["gain"]) < NOTICED:
            value = "none helps"
        yield f"  {label:<22}{row['elasticity'] or '-':>7}  {value}".rstrip()


def page(folder: Path, scenes: Sequence[str]) -> str:
    """The cheapest settings of scenes as a table in Markdown; folder: of both tables."""
    with (folder / "cheapest.csv").open() as file:
        rows = list(csv.DictReader(file))
    targets = [f"{100 * target:g} %" for target in fronts.TARGETS]
    lines = [f"| scene | {' | '.join(targets)} |", "|---" * (len(targets) + 1) + "|"]
    missing = []
    for scene in scenes:
        own = [row for row in rows if row["scene"] == scene]
        cells = [f"{row['seconds']} s, {row['across']}" if row["error"] else "-" for row in own]
        name = scene.replace("_", " ")
        if any(row["error"] for row in own):
            lines.append(f"| {name} | {' | '.join(cells)} |")
        else:
            missing.append(name)
    return "\n".join([*lines, *([f"\nNone of them: {', '.join(missing)}."] if missing else [])])
