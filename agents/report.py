"""Tables and one self-contained page from the runs of several agents."""

import base64
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from matplotlib.markers import MarkerStyle
from matplotlib.transforms import Affine2D

from agents.evaluate import MEASURES, readable
from agents.looks import look
from sph_gym.env.rewards import MILDEST, MOST_WORK, WINDOW, WORST, Tolerances


class Plot(NamedTuple):
    """A plot of the report: heading, what there is to see, and what replaces the picture."""

    heading: str
    caption: str
    alt: str


# What the report looks for in its folder: the plots, and one of the animations, if there is any.
PLOTS: dict[str, Plot] = {
    "returns.png": Plot(
        "Who does best",
        "Each faint dot is one instance, each strong mark the mean over all of them with its 95 % "
        "interval. Look for marks further to the right than that of the tuned CFL rule near 0.5, "
        "and for intervals that don't overlap. Stretched dots mean that an agent does well on "
        "some flows and badly on others; a cross is a run that blew up.",
        "Dot plot of the return per step, one row an agent, best first",
    ),
    "cost_against_error.png": Plot(
        "What it costs, and what it spoils",
        "Left means cheaper, down means truer, so the lower left corner is the place to be, and "
        "everything below the dashed line is, on average, within tolerance. Work and errors are "
        "counted up to a blow-up, which a hollow mark warns of. Agents that did the same lie on "
        "top of each other.",
        "Work against fidelity error and against density error, one mark an agent",
    ),
    "reward_terms.png": Plot(
        "Where the return comes from",
        "To the right, what was earned by saving work; to the left, what was lost, by cause. The "
        "diamond is the sum, the return. A short bar to the right with nothing to the left is an "
        "agent that is safe but spends much; a bar to the left is an agent that went too far.",
        "Stacked bars of the terms of the reward, one row an agent, best first",
    ),
    "controls.png": Plot(
        "What the agents do over one episode",
        "The four upper panels are decisions and what they cost, the two lower ones consequences; "
        "dashed lines are tolerances. Look for agents that change their settings with the flow, "
        "for instance when the fluid hits a wall, and whether their errors stay below the line. A "
        "line that ends early in a cross blew up.",
        "Time step, sound speed, XSPH epsilon, substeps, density error and fidelity error over "
        "time, one line an agent",
    ),
}
ANIMATIONS = {"side_by_side.mp4": "video/mp4", "side_by_side.gif": "image/gif"}


def write_tables(summary: pd.DataFrame, folder: Path, stem: str = "table") -> None:
    """Write STEM.csv (means and interval ends as numbers) and STEM.md (text) into the folder.

    summary: as `agents.evaluate.summary_table` or `shift_table` returns it.
    """
    summary.to_csv(folder / f"{stem}.csv", index=False)
    text = readable(summary)
    sides = ["left" if name in ("shift", "agent") else "right" for name in text.columns]
    markdown = text.to_markdown(index=False, colalign=sides, disable_numparse=True)
    (folder / f"{stem}.md").write_text(f"{markdown}\n", encoding="utf-8")


def write_report(folder: Path, context: Mapping[str, Any]) -> Path:
    """Write report.html, with the plots of PLOTS and an animation of the folder, return its path.

    context: scene (name), instances (their ids; the k-th was run with seed k), summary (of
    `agents.evaluate.summary_table`), recorded_instance (id of the one in the animation and in
    controls.png), command (that made it all), versions (name to version), cpu and date
    (text), notes (sentences about how the agents were set up).
    Raises FileNotFoundError if a plot is missing, KeyError if an entry of the context is.
    """
    summary, found = context["summary"], [n for n in ANIMATIONS if (folder / n).exists()]
    names = (
        "scene", "instances", "recorded_instance", "command", "versions", "cpu", "date", "notes"
    )  # fmt: skip
    html = _template().render(
        **{name: context[name] for name in names},
        headline=headline(summary),
        headings=_headings(),
        rows=_rows(summary),
        plots=[(plot, _data_uri(folder / name, "image/png")) for name, plot in PLOTS.items()],
        animation=_data_uri(folder / found[0], ANIMATIONS[found[0]]) if found else "",
        tolerances=Tolerances(),
        window=WINDOW,
        least=f"{1 - MOST_WORK / 2:g}",
        mildest=f"{MILDEST:g}",
        worst=f"{WORST:g}",
    )
    path = folder / "report.html"
    path.write_text(html, encoding="utf-8")
    return path


def _template() -> Template:
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html.j2")


def headline(summary: pd.DataFrame) -> str:
    """What came out, in a few sentences; summary: of `agents.evaluate.summary_table`."""
    first = summary.iloc[0]
    text = (
        f"{look(first['agent']).label} did best, with a return of {first['return']:.2f} per step "
        f"(95 % interval {first['return_low']:.2f} to {first['return_high']:.2f}) and "
        f"{first['work']:.2f} times the work of the tuned CFL rule."
    )
    if first["blowup"]:
        text += f" It blew up in {first['blowup']:.0f} % of its runs."
    near = summary[1:][summary["return_high"][1:] >= first["return_low"]]
    if len(near):
        names = " and ".join(look(agent).label for agent in near["agent"])
        text += f" Its interval overlaps with that of {names}: other instances may turn the order."
    return text.replace(" %", "\N{NO-BREAK SPACE}%")


def _headings() -> list[str]:
    """Of the measures, with an arrow to where it gets better."""
    return [f"{text} {'↑' if name == 'return' else '↓'}" for name, text in MEASURES.items()]


def _rows(summary: pd.DataFrame) -> list[dict[str, Any]]:
    """The table: one row an agent, cells of (mean, half the interval, whether it is the best)."""
    text = readable(summary)
    cells = {
        measure: [tuple(cell.split(" ± ")) for cell in text[heading]]
        for measure, heading in MEASURES.items()
    }
    best = {measure: _best(summary, measure, means) for measure, means in cells.items()}
    return [
        {
            "agent": look(agent),
            "shape": _shape(look(agent).marker),
            "runs": int(summary["runs"][k]),
            "blown": bool(summary["blowup"][k] > 0),
            "cells": [
                (*cells[measure][k], cells[measure][k][0] == best[measure]) for measure in cells
            ],
        }
        for k, agent in enumerate(summary["agent"])
    ]


def _best(summary: pd.DataFrame, measure: str, cells: Sequence[tuple[str, ...]]) -> str | None:
    """The best mean as it is printed; None if all are alike.

    Runs that blew up are short, so what is a mean over steps counts only without blow-ups.
    """
    means = [cell[0] for cell in cells]
    values = summary[measure]
    if measure not in ("return", "blowup") and not summary["blowup"].all():
        values = values[summary["blowup"] == 0]
    k = values.idxmax() if measure == "return" else values.idxmin()
    return means[k] if len(set(means)) > 1 else None


def _shape(marker: str) -> str:
    """A matplotlib marker as SVG path data in a box from -50 to 50."""
    style = MarkerStyle(marker)
    path = style.get_path().transformed(style.get_transform() + Affine2D().scale(100, -100))
    polygons = [np.asarray(polygon) for polygon in path.to_polygons()]
    size = max(np.abs(polygon).max() for polygon in polygons) / 50
    return "".join(
        "M" + "L".join(f"{x:.0f} {y:.0f}" for x, y in polygon / size) + "Z" for polygon in polygons
    )


def _data_uri(path: Path, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"


def cpu_name() -> str:
    """The processor of this computer, as far as it tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
