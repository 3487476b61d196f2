"""Results of the accuracy study that come with the package: cheapest settings and gains.

cheapest.csv: the measured setting that takes least time for 5, 2, 1 and 0.5 %, luck
apart; gains.csv: the gain of each setting by its best value, and its elasticity.
"""

import csv
from collections.abc import Iterator
from importlib import resources

from sph_gym.recommend.settings import TITLES
from sph_gym.scenes.shared.refinement import refinement

FOLDER = resources.files("sph_gym.recommend") / "data" / "found"
CHEAPEST = ("scene", "target", "error", "seconds", "across", "changes")
GAINS = ("scene", "knob", "elasticity", "value", "gain", "bound")
# Gains below it are none.
NOTICED = 1.05


def read(name: str, scene: str) -> list[dict[str, str]]:
    """Return the rows of a scene in the table "cheapest" or "gains"."""
    rows = csv.DictReader((FOLDER / f"{name}.csv").read_text().splitlines())
    return [row for row in rows if row["scene"] == scene]


def summarize(scene: str) -> Iterator[str]:
    """Yield lines of text about a scene. Raises ValueError for an unknown one."""
    case = refinement(scene)
    yield f"{scene}: {case.measure} [% {case.of}]"
    yield f"How it converges. {case.note}"
    yield ""
    yield "cheapest measured settings, luck apart; processor seconds of one thread:"
    for row in read("cheapest", scene):
        target = f"  {100 * float(row['target']):g} %"
        if not row["error"]:
            yield f"{target:<8}not reached, or only by chance"
            continue
        what = ", ".join(filter(None, [f"{case.length} / {row['across']}", row["changes"]]))
        yield f"{target:<8}{row['seconds']:>7} s  {what}"
    yield ""
    yield "one knob alone: d log error / d log time, and how many times faster at equal error"
    for row in read("gains", scene):
        label = TITLES[row["knob"]][0] if row["knob"] in TITLES else "resolution"
        gain = " ".join(filter(None, [row["bound"], row["gain"]]))
        value = f"{gain} with {row['value']}" if row["value"] else ""
        if value and float(row["gain"]) < NOTICED:
            value = "none helps"
        yield f"  {label:<22}{row['elasticity'] or '-':>7}  {value}".rstrip()
