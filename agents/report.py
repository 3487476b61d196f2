"""Tables and one self-contained page from the runs of several agents."""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from matplotlib.markers import MarkerStyle
from matplotlib.transforms import Affine2D

from agents.evaluate import MEASURES, readable, write_csv
from agents.policies import ORACLES
from agents.styles import Marker, sentence, style_of
from sph_gym.env.rewards import MILDEST, MOST_WORK, WINDOW, WORST, Tolerances
from sph_gym.files import atomic_write

# Files that the report looks for in its folder, and those that it must be given.
PLOTS = ("returns.png", "cost_against_error.png", "reward_terms.png", "controls.png")
ANIMATION = "side_by_side.mp4"
# With fewer runs a bootstrap interval is far too narrow.
FEW = 5
CONTEXT = ("scene", "instances", "recorded_instance", "command", "versions", "cpu", "date", "notes")


def write_tables(summary: pd.DataFrame, folder: Path, stem: str = "table") -> None:
    """Write STEM.csv (means and interval ends as numbers) and STEM.md (text) into the folder.

    summary: as `agents.evaluate.summary_table` or `shift_table` returns it.
    """
    write_csv(summary, folder / f"{stem}.csv")
    with atomic_write(folder / f"{stem}.md") as draft:
        draft.write_text(f"{markdown(readable(summary))}\n", encoding="utf-8")


def markdown(lines: pd.DataFrame) -> str:
    """Return a table of text in Markdown; all but agents and shifts are flush right."""
    sides = ["left" if name in ("shift", "agent") else "right" for name in lines.columns]
    return str(lines.to_markdown(index=False, colalign=sides, disable_numparse=True))


def write_report(folder: Path, context: Mapping[str, Any]) -> Path:
    """Write report.html with the plots and the animation of the folder; return its path.

    context: scene (name), instances (their ids; the k-th was run with seed k), summary (from
    `agents.evaluate.summary_table`), recorded_instance (id of the one in the animation and in
    controls.png), command (that made it all), versions (name to version), cpu and date
    (text), notes (sentences about how the agents were set up).
    Raises FileNotFoundError if a picture is missing, KeyError if an entry of the context is.
    """
    summary = context["summary"]
    html = _template().render(
        **{name: context[name] for name in CONTEXT},
        headline=headline(summary),
        headings=_headings(),
        rows=_rows(summary),
        pictures={name: _data_uri(folder / name, "image/png") for name in PLOTS},
        animation=_data_uri(folder / ANIMATION, "video/mp4"),
        tolerances=Tolerances(),
        window=WINDOW,
        least=f"{1 - MOST_WORK / 2:g}",
        mildest=f"{MILDEST:g}",
        worst=f"{WORST:g}",
    )
    path = folder / "report.html"
    with atomic_write(path) as draft:
        draft.write_text(html, encoding="utf-8")
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
    """Return the result in a few sentences: who does best, by how much, and where it fails.

    summary: as `summary_table` returns it. Oracles are bounds, so that one does best only if there
    are no others.
    """
    rivals = summary[~summary["agent"].isin(ORACLES)]
    first = (rivals if len(rivals) else summary).iloc[0]
    text = (
        f"{style_of(first['agent']).label} did best, with a return of {first['return']:.2f} per "
        f"step (95 % interval {first['return_low']:.2f} to {first['return_high']:.2f}) and "
        f"{first['work']:.2f} times the work of the tuned CFL rule."
    )
    text += _lead(first, summary)
    if first["runs"] < FEW:
        text += " So few runs say little, and their interval less: take 16 instances or more."
    text += f" It blew up in {first['blowup']:.0f} % of its runs." if first["blowup"] else ""
    others = rivals[rivals["agent"] != first["agent"]]
    near = others[others["return_high"] >= first["return_low"]]
    if len(near):
        names = _listed(near["agent"])
        best = style_of(first["agent"]).label
        text += f" The interval of {best} overlaps with that of {names}:"
        text += " other instances may change the order."
    blown = others[others["blowup"] > 0]
    if len(blown):
        text += f" Blow-ups: {', '.join(_share(row) for _, row in blown.iterrows())}."
    return text.replace(" %", "\N{NO-BREAK SPACE}%")


def _lead(first: pd.Series, summary: pd.DataFrame) -> str:
    """Return how far the best agent is from the tuned rule and from the oracle, as sentences."""
    returns = summary.set_index("agent")["return"]
    text = ""
    if "tuned_cfl" in returns and first["agent"] != "tuned_cfl":
        ahead = first["return"] - returns["tuned_cfl"]
        text += f" That is {ahead:.2f} more than the tuned CFL rule earns."
    if "lookahead" in returns and first["agent"] != "lookahead":
        text += (
            f" The look-ahead oracle, which sees the future, earns {returns['lookahead']:.2f}: "
            "a bound, no competitor."
        )
    return text


def _share(row: pd.Series) -> str:
    return f"{style_of(row['agent']).label} in {row['blowup']:.0f} % of its runs"


def _listed(agents: pd.Series) -> str:
    return " and ".join(style_of(agent).label for agent in agents)


def _headings() -> list[str]:
    """Return the headings of the measures, with an arrow to where it gets better."""
    return [f"{text} {'↑' if name == 'return' else '↓'}" for name, text in MEASURES.items()]


def _rows(summary: pd.DataFrame) -> list[dict[str, Any]]:
    """Return one row an agent, with cells (mean, half the interval, is it the best)."""
    text = readable(summary)
    cells = {
        measure: [tuple(cell.split(" ± ")) for cell in text[heading]]
        for measure, heading in MEASURES.items()
    }
    best = {measure: _best(summary, measure, means) for measure, means in cells.items()}
    return [
        {
            "agent": style_of(agent),
            "sentence": sentence(agent),
            "shape": _shape(style_of(agent).marker),
            "runs": int(summary["runs"][k]),
            "blown": bool(summary["blowup"][k] > 0),
            "cells": [
                (*cells[measure][k], cells[measure][k][0] == best[measure]) for measure in cells
            ],
        }
        for k, agent in enumerate(summary["agent"])
    ]


def _best(summary: pd.DataFrame, measure: str, cells: Sequence[tuple[str, ...]]) -> str | None:
    """Return the best mean as it is printed; None if all are alike.

    Runs that blew up are short, so what is a mean over steps counts only without blow-ups.
    """
    means = [cell[0] for cell in cells]
    values = summary[measure]
    if measure not in ("return", "blowup") and not summary["blowup"].all():
        values = values[summary["blowup"] == 0]
    k = values.idxmax() if measure == "return" else values.idxmin()
    return means[k] if len(set(means)) > 1 else None


def _shape(marker: Marker) -> str:
    """Return a matplotlib marker as SVG path data in a box from -50 to 50."""
    style = MarkerStyle(marker)
    path = style.get_path().transformed(style.get_transform() + Affine2D().scale(100, -100))
    polygons = [np.asarray(polygon) for polygon in path.to_polygons()]
    size = max(np.abs(polygon).max() for polygon in polygons) / 50
    return "".join(
        "M" + "L".join(f"{x:.0f} {y:.0f}" for x, y in polygon / size) + "Z" for polygon in polygons
    )


def _data_uri(path: Path, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"
