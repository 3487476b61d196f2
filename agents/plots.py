"""The plots of a comparison, one function each."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import (
    FuncFormatter,
    LogLocator,
    NullFormatter,
    NullLocator,
    SymmetricalLogLocator,
)
from numpy.typing import NDArray

from agents.scores import Interval, interval, mean, tables_by_family
from agents.styles import AgentStyle, Line, Marker, style_of
from sph_gym.env.rewards import TERMS, Tolerances
from sph_gym.files import atomic_write
from sph_gym.studies.averages import bootstrap_interval

# Markers look equally large at these sizes; a circle stays visible below a square.
SIZES: dict[Marker, float] = {"o": 1.25, "s": 0.85, "P": 1.2, "*": 1.5, "p": 1.2, (4, 1, 0): 1.6}
INK, MUTED, RULE = "#262c36", "#5f6670", "#d6d9dd"
LOOK: dict[Any, Any] = {
    **{f"axes.spines.{side}": False for side in ("top", "right")},
    **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), MUTED),
    **dict.fromkeys(("axes.labelcolor", "axes.titlecolor", "legend.labelcolor"), INK),
    **dict.fromkeys(("xtick.labelcolor", "ytick.labelcolor"), INK),
    **{"axes.grid": True, "axes.axisbelow": True, "grid.color": RULE, "grid.linewidth": 0.6},
    **{"axes.titlelocation": "left", "legend.frameon": False, "savefig.facecolor": "white"},
}
# Colour and hatch of the terms of the reward; none of them is the colour of an agent.
TERM_STYLES = {
    "work": ("#8fa3ad", ""),
    "density": ("#332288", ""),
    "clumping": ("#ddcc77", "...."),
    "noise": ("#44aa99", "\\\\\\\\"),
    "fidelity": ("#aa4455", "////"),
    "blowup": ("#222222", "xxxx"),
}
# Panels of the controls over an episode, and their scales.
PANELS = {
    "time step [ms]": "log",
    "sound speed / nominal": "log",
    "XSPH epsilon": "linear",
    "substeps per step": "log",
    "density error [%]": "symlog",
    "fidelity error / tolerance": "symlog",
}


def plot_returns(runs: pd.DataFrame, path: Path) -> None:
    """Plot the return per step of every run, its mean and its 95 % interval, one row an agent.

    runs: one row a run, with agent, return and blowup. Raises ValueError if there are no runs.
    """
    order = _ranking(runs)
    with _figure(path, 9.0, 1.7 + 0.5 * len(order)) as figure:
        ax = _agent_rows(figure, order)
        ax.axvline(0.0, color=MUTED, lw=0.8)
        ax.axvline(0.5, color=INK, lw=1.0, ls="--")
        for row, agent in enumerate(order):
            _return_row(ax, row, agent, runs[runs["agent"] == agent])
        _means_beside(ax, order, runs)
        ax.set_xlim(min(-0.05, float(runs["return"].min()) - 0.05), 1.02)
        ax.set_xlabel("return per step (1 is best, 0.5 = tuned CFL rule's work within tolerance)")
        handles = [
            _handle("one instance", "o", MUTED, 4.0, alpha=0.5),
            _handle("one that blew up", "x", MUTED, 6.0, mew=1.5),
            _handle("mean and 95 % interval", "D", INK, ls="-", lw=2.5),
        ]
        _legend(figure, handles, 3)


def _return_row(ax: Axes, row: int, agent: str, runs: pd.DataFrame) -> None:
    style, values = style_of(agent), runs["return"].to_numpy(float)
    heights = row + np.random.default_rng(0).uniform(-0.25, 0.25, len(values))
    blown = runs["blowup"].to_numpy() > 0
    ax.scatter(
        values[~blown], heights[~blown], s=24, color=style.colour, alpha=0.35, lw=0, zorder=2
    )
    ax.scatter(values[blown], heights[blown], s=30, color=style.colour, marker="x", lw=1.4)
    mean, low, high = bootstrap_interval(values)
    ax.plot([low, high], [row, row], color=style.colour, lw=3, zorder=3, solid_capstyle="butt")
    _mark(ax, mean, row, style, 10)


def _means_beside(ax: Axes, order: Sequence[str], runs: pd.DataFrame) -> None:
    """Write means and intervals to the right, under a heading above the first row."""
    texts = ["mean (95 % interval)"]
    for agent in order:
        mean, low, high = bootstrap_interval(runs[runs["agent"] == agent]["return"].to_numpy())
        text = f"{mean:.2f}  ({low:.2f} to {high:.2f})"
        texts.append(text.replace("-", "\N{MINUS SIGN}"))
    ax.set_ylim(len(order) - 0.5, -1.0)
    beside = ax.twinx()
    beside.set_ylim(ax.get_ylim())
    beside.set_yticks([-0.8, *range(len(order))], texts)
    beside.tick_params(axis="y", length=0)
    beside.spines[:].set_visible(False)
    beside.grid(False)


def plot_cost_against_error(runs: pd.DataFrame, path: Path) -> None:
    """Plot mean work against mean errors, with 95 % intervals, one mark an agent.

    runs: one row a run, with agent, return, work, fidelity_error, density_error and blowup.
    Raises ValueError if there are no runs.
    """
    order, tolerance = _ranking(runs), Tolerances().compression
    with _figure(path, 10.0, 5.6) as figure:
        panels = figure.subplots(1, 2, sharey=True)
        for ax, measure, unit, title in (
            (panels[0], "fidelity_error", 1.0, "fidelity error"),
            (
                panels[1],
                "density_error",
                tolerance,
                f"density error (tolerance {100 * tolerance:g} %)",
            ),
        ):
            for agent in order:
                own = runs[runs["agent"] == agent]
                work, error = (
                    bootstrap_interval(each.to_numpy())
                    for each in (own["work"], own[measure] / unit)
                )
                _cross(ax, work, error, style_of(agent), bool(own["blowup"].any()))
            ax.axhline(1.0, color=INK, lw=1.0, ls="--", zorder=1)
            ax.set_xlabel("work / work of the tuned CFL rule")
            ax.set_title(title, size=11)
            ax.set_title("↙ better", loc="right", size=10, color=MUTED)
        _cost_scales(panels)
        handles = [_agent_handle(agent, runs) for agent in order]
        _legend(figure, [*handles, _handle("tolerance", "", INK, ls="--", lw=1.0)], 4)


def _cross(ax: Axes, x: Interval, y: Interval, style: AgentStyle, blown: bool) -> None:
    """Mark mean and interval both ways, hollow if any of the runs blew up."""
    (x_mean, *x_ends), (y_mean, *y_ends) = x, y
    ax.plot(x_ends, [y_mean, y_mean], color=style.colour, lw=1.6, zorder=2)
    ax.plot([x_mean, x_mean], y_ends, color=style.colour, lw=1.6, zorder=2)
    _mark(ax, x_mean, y_mean, style, 9, hollow=blown)


def _cost_scales(panels: Sequence[Axes]) -> None:
    """Make both scales logarithmic, with equal work and the tolerance always in sight."""
    lowest = min(ax.dataLim.y0 for ax in panels)
    highest = max(ax.dataLim.y1 for ax in panels)
    for ax in panels:
        ax.set_xscale("log", base=2)
        ax.xaxis.set_major_formatter(FuncFormatter(_fraction))
        ax.xaxis.set_minor_locator(NullLocator())
        low, high = ax.get_xlim()
        ax.set_xlim(min(low, 0.45), max(high, 2.2))
        _error_scale(ax, 0.01)
        ax.set_ylim(lowest / 1.5 if lowest > 0.02 else 0.0, max(1.5 * highest, 2.0))
    panels[0].set_ylabel("error in multiples of its tolerance")


def _fraction(x: float, _: int) -> str:
    return f"{x:g}" if x >= 1 else f"1/{1 / x:g}"


def plot_profiles(runs: pd.DataFrame, path: Path) -> None:
    """Plot the share of an agent's runs with a score above each level, one line an agent.

    runs: one row a run, with agent and score, which is not a number where there is none.
    """
    scored, levels = runs[runs["score"].notna()], np.linspace(-0.5, 1.25, 141)
    with _figure(path, 9.0, 5.0) as figure:
        ax = figure.add_subplot()
        for agent, own in scored.groupby("agent"):
            style = style_of(str(agent))
            share = (own["score"].to_numpy()[:, None] > levels).mean(axis=0)
            ax.plot(levels, share, color=style.colour, ls=style.line, lw=style.width)
        for level in (0.0, 1.0):
            ax.axvline(level, color=INK, lw=1.0, ls="--", zorder=1)
        ax.set(xlim=(levels[0], levels[-1]), ylim=(0.0, 1.02), ylabel="share of runs above it")
        ax.set_xlabel("score (0: the tuned CFL rule, 1: the oracle)")
        styles = [style_of(str(agent)) for agent in scored["agent"].unique()]
        _legend(figure, [_handle(s.label, "", s.colour, ls=s.line, lw=s.width) for s in styles], 4)


def plot_trades(runs: pd.DataFrame, path: Path) -> None:
    """Plot mean work against the mean largest error, with 95 % intervals, one mark an agent.

    runs: one row a run, as `agents.scores.runs_of` returns them.
    """
    with _figure(path, 8.0, 5.6) as figure:
        ax = figure.add_subplot()
        for agent in _ranking(runs):
            own = runs[runs["agent"] == agent]
            work, error = (
                interval(tables_by_family(own, measure), mean) for measure in ("work", "error")
            )
            _cross(ax, work, error, style_of(agent), bool(own["blowup"].any()))
        ax.axhline(1.0, color=INK, lw=1.0, ls="--", zorder=1)
        ax.set_xlabel("work / work of the tuned CFL rule")
        ax.set_title("↙ better", loc="right", size=10, color=MUTED)
        _cost_scales([ax])
        handles = [_agent_handle(agent, runs) for agent in _ranking(runs)]
        _legend(figure, [*handles, _handle("tolerance", "", INK, ls="--", lw=1.0)], 2)


def plot_reward_terms(runs: pd.DataFrame, path: Path) -> None:
    """Plot the mean terms of the reward per step as stacked bars, one row an agent.

    runs: one row a run, with agent, return and reward_TERM for every term of the reward.
    Raises ValueError if there are no runs.
    """
    order = _ranking(runs)
    means = runs.groupby("agent")[["return", *(f"reward_{term}" for term in TERMS)]].mean()
    with _figure(path, 9.0, 1.7 + 0.45 * len(order)) as figure:
        ax = _agent_rows(figure, order)
        for row, agent in enumerate(order):
            ends = {True: 0.0, False: 0.0}
            for term, (colour, hatch) in TERM_STYLES.items():
                value = float(means.loc[agent, f"reward_{term}"])
                bar = ax.barh(row, value, 0.62, ends[value > 0], color=colour, lw=0.6)
                bar.patches[0].set(hatch=hatch, ec="white")
                ends[value > 0] += value
        ax.plot(means.loc[order, "return"], range(len(order)), "D", mfc="white", mec=INK, ms=7)
        ax.axvline(0.0, color=INK, lw=1.0)
        ax.set_ylim(len(order) - 0.5, -0.5)
        ax.set_xlabel("mean reward per step")
        patches = [
            Patch(fc=colour, hatch=hatch, ec="white", label=term.replace("blowup", "blow-up"))
            for term, (colour, hatch) in TERM_STYLES.items()
        ]
        _legend(figure, [*patches, _handle("sum = return", "D", INK, mfc="white")], 7)


def plot_controls(
    episodes: dict[str, list[dict[str, Any]]], path: Path, nominal_stiffness: float
) -> None:
    """Plot controls and errors over time, one line an agent.

    episodes: infos of every step by agent, as `agents.evaluate.play` returns them, all of the
    same instance; nominal_stiffness: of that instance [Pa]. Raises ValueError without episodes.
    """
    if not episodes:
        raise ValueError("episodes: expected at least one, got none")
    with _figure(path, 10.0, 9.4) as figure:
        axes = figure.subplots(3, 2, sharex=True).flat
        for (label, scale), ax in zip(PANELS.items(), axes, strict=True):
            for k, (agent, infos) in enumerate(episodes.items()):
                y = _series(infos, nominal_stiffness)[label]
                _line(ax, k, style_of(agent), infos, y)
            _panel(ax, label, scale)
        for ax in figure.axes[-2:]:
            ax.set_xlabel("time [s]")
        handles = [
            _handle(s.label, s.marker, s.colour, ls=s.line, lw=s.width, mec="white")
            for s in map(style_of, episodes)
        ]
        _legend(figure, handles, 4)


def _series(infos: Sequence[Mapping[str, Any]], nominal: float) -> dict[str, NDArray[Any]]:
    """Return the quantities of the panels over the steps, (n_steps,) each."""
    columns = pd.DataFrame(infos)
    values: tuple[pd.Series, ...] = (
        1e3 * columns["dt"],
        (columns["stiffness"] / nominal) ** 0.5,
        columns["xsph"],
        columns["n_substeps"],
        100 * columns["density_error"],
        # after a blow-up it isn't measured
        columns["fidelity_error"].where(columns["blowup"] == 0),
    )
    return {label: one.to_numpy(float) for label, one in zip(PANELS, values, strict=True)}


def _line(
    ax: Axes, k: int, style: AgentStyle, infos: Sequence[Mapping[str, Any]], y: NDArray[Any]
) -> None:
    t = np.array([info["time"] for info in infos])
    gap = max(len(t) // 6, 1)
    look: dict[str, Any] = {"color": style.colour, "ls": style.line, "lw": style.width}
    look |= {"marker": style.marker, "ms": 6 * SIZES.get(style.marker, 1.0), "mec": "white"}
    ax.plot(t, y, **look, mew=0.6, markevery=(k * gap // 7 % len(t), gap))
    measured = np.flatnonzero(np.isfinite(y))
    if infos[-1]["blowup"] and len(measured):
        end = measured[-1]
        ax.plot(t[end], y[end], "x", color=style.colour, ms=10, mew=2.5, zorder=5)


def _panel(ax: Axes, label: str, scale: str) -> None:
    ax.set_title(label, size=10)
    if scale == "log":
        ax.set_yscale("log")
        # controls stay within a decade, where 1, 2 and 5 alone may label a single place
        ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 3, 5, 7)))
        ax.yaxis.set_major_formatter("{x:g}")
        ax.yaxis.set_minor_formatter(NullFormatter())
    if scale == "symlog":
        tolerance = 100 * Tolerances().compression if "%" in label else 1.0
        ax.axhline(tolerance, color=INK, lw=1.0, ls="--", zorder=1)
        _error_scale(ax, 0.1)


def _error_scale(ax: Axes, linear_below: float) -> None:
    """Make the scale logarithmic, but with room for 0."""
    ax.set_yscale("symlog", linthresh=linear_below, linscale=0.3)
    ax.yaxis.set_major_locator(
        SymmetricalLogLocator(base=10, linthresh=linear_below, subs=[1, 2, 5])
    )
    ax.yaxis.set_major_formatter("{x:g}")
    ax.set_ylim(bottom=0.0)


def _ranking(runs: pd.DataFrame) -> list[str]:
    """Return the agents, best mean return first."""
    if runs.empty:
        raise ValueError("runs: expected at least one, got none")
    means = runs.groupby("agent", sort=False)["return"].mean()
    return list(means.sort_values(ascending=False, kind="stable").index)


@contextmanager
def _figure(path: Path, width: float, height: float) -> Iterator[Figure]:
    """Yield a figure of a size [inches] in the look of all plots; write it in the end."""
    with rc_context(LOOK):
        figure = Figure(figsize=(width, height), dpi=150, layout="constrained")
        yield figure
        with atomic_write(path) as draft:
            figure.savefig(draft)


def _agent_rows(figure: Figure, order: Sequence[str]) -> Axes:
    """Return axes with the names of agents at the left, the first on top."""
    ax = figure.add_subplot()
    ax.set_yticks(range(len(order)), [_plain(style_of(agent).label) for agent in order], size=11)
    ax.set_ylim(len(order) - 0.5, -0.5)
    ax.spines["left"].set_visible(False)
    ax.tick_params(axis="y", length=0)
    ax.grid(False, axis="y")
    return ax


def _plain(text: str) -> str:
    """Return a text in which no dollar sign begins a formula."""
    return text.replace("$", r"\$")


def _mark(
    ax: Axes, x: float, y: float, style: AgentStyle, size: float, hollow: bool = False
) -> None:
    edge, face, width = (style.colour, "white", 1.6) if hollow else ("white", style.colour, 0.8)
    scale = SIZES.get(style.marker, 1.0)
    ax.plot(
        x,
        y,
        marker=style.marker,
        ls="none",
        ms=scale * size,
        mfc=face,
        mec=edge,
        mew=width,
        zorder=5 - scale / 2,
    )


def _handle(
    label: str, marker: Marker, colour: str, size: float = 7.0, ls: Line = "none", **style: Any
) -> Line2D:
    """Return an entry of a legend."""
    style |= {"ms": size * SIZES.get(marker, 1.0), "label": _plain(label)}
    return Line2D([], [], marker=marker, color=colour, ls=ls, **style)


def _agent_handle(agent: str, runs: pd.DataFrame) -> Line2D:
    style, blown = style_of(agent), runs[runs["agent"] == agent]["blowup"] > 0
    if not blown.any():
        return _handle(style.label, style.marker, style.colour, 8.0)
    label = f"{style.label} ({blown.sum()} of {len(blown)} blew up)"
    return _handle(label, style.marker, style.colour, 8.0, mfc="white", mew=1.6)


def _legend(figure: Figure, handles: list[Any], n_columns: int) -> None:
    figure.legend(handles=handles, loc="outside lower center", ncols=n_columns)
