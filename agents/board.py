"""Tables and pictures of the leaderboard, made from its files."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from agents import entries, plots, scores
from agents.entries import GAMES, LeaderboardEntry
from agents.evaluate import show as show_table
from agents.report import markdown
from agents.scores import BEST_STATIC, GAP, ORACLE, RULE, Interval
from agents.styles import style_of

SPLIT = "test"
PICTURES = ("leaderboard_profiles.png", "leaderboard_trades.png")
DASH = "\N{EN DASH}"


def text(found: Sequence[LeaderboardEntry], runs: pd.DataFrame) -> str:
    """Return the part of the page: the tables of the test instances, and what is behind them.

    Agents that were kept from a family are no competitors: `zero_shot` has them.
    """
    found = entries.complete(found)
    own = usual(only(found, runs), SPLIT)
    parts = [
        _scored(own),
        markdown(table(found, own)),
        "Score by family:",
        markdown(by_family(own)),
        "Work of the learners, in multiples of the tuned rule's / of that of the best static "
        "setting in hindsight, on the same flows:",
        markdown(work(found, own)),
        "Probability [%] that the agent of the row earns more than that of the column:",
        markdown(improvements(own)),
        "![Share of runs above each score](pictures/leaderboard_profiles.png)",
        "![Work against error](pictures/leaderboard_trades.png)",
        _behind(found),
    ]
    return "\n\n".join(parts)


def only(found: Sequence[LeaderboardEntry], runs: pd.DataFrame) -> pd.DataFrame:
    """Return the runs of some entries."""
    return runs[runs["agent"].isin([entry.agent for entry in found])]


def usual(runs: pd.DataFrame, split: str) -> pd.DataFrame:
    """Return the runs of a set at the usual spacing."""
    return runs[(runs["split"] == split) & ~runs["finer"]]


def table(found: Sequence[LeaderboardEntry], runs: pd.DataFrame) -> pd.DataFrame:
    """Return the leaderboard as text, best first: by score, then by return."""
    about = {entry.agent: entry.about for entry in found}
    rows = []
    for agent, own in runs.groupby("agent"):
        score = scores.interval(scores.tables_by_family(own, "score"))
        hypervolume = scores.hypervolume(own["work"].to_numpy(), own["error"].to_numpy())
        row: dict[str, Any] = {
            "order": (-np.nan_to_num(score[0], nan=-np.inf), -own["return"].mean()),
            "agent": style_of(str(agent)).label,
            "runs": str(len(own)),
            "trainings": str(own["training"].nunique()) if about[agent]["networks"] else DASH,
            "score": ranged(score),
            "better than the rule [%]": percent(
                scores.interval(scores.chances(runs, str(agent), RULE), scores.mean)
            ),
            "return": f"{own['return'].mean():.3f}",
            "work": f"{own['work'].mean():.2f}",
            "error": f"{own['error'].mean():.2f}",
            "hypervolume": f"{hypervolume.mean():.3f}",
            "beyond [%]": f"{100 * own['beyond'].mean():.1f}",
            "blow-ups": f"{int(own['blowup'].sum())}",
            "policy [µs]": f"{about[agent]['policy_microseconds']:.0f}",
        }
        rows.append(row)
    rows.sort(key=lambda row: row.pop("order"))
    return pd.DataFrame(rows)


def by_family(runs: pd.DataFrame) -> pd.DataFrame:
    """Return the scores of each family as text."""
    rows = []
    for agent, own in runs.groupby("agent"):
        row = {"agent": style_of(str(agent)).label}
        for family in GAMES:
            part = scores.tables_by_family(own[own["family"] == family], "score")
            row[family] = ranged(scores.interval(part))
        rows.append(row)
    return pd.DataFrame(rows)


def work(found: Sequence[LeaderboardEntry], runs: pd.DataFrame) -> pd.DataFrame:
    """Return the mean work of the learners in each family against that of two others, as text."""
    rows = []
    for entry in found:
        if not entry.about["networks"]:
            continue
        row = {"agent": style_of(entry.agent).label}
        for family in GAMES:
            here = runs[runs["family"] == family]
            ratios = (scores.work_ratio(here, entry.agent, other) for other in (RULE, BEST_STATIC))
            row[family] = " / ".join(DASH if np.isnan(x) else f"{x:.2f}" for x in ratios)
        rows.append(row)
    return pd.DataFrame(rows)


def improvements(runs: pd.DataFrame) -> pd.DataFrame:
    """Return the probabilities of improvement of every agent over every other one, as text."""
    agents = sorted(set(runs["agent"]))
    rows = []
    for agent in agents:
        row = {"agent": style_of(agent).label}
        for other in agents:
            found = scores.chances(runs, agent, other) if agent != other else []
            row[style_of(other).label] = _chance(found)
        rows.append(row)
    return pd.DataFrame(rows)


def _chance(found: list[scores.Values]) -> str:
    return f"{100 * scores.mean(scores.pooled(found)):.0f}" if found else DASH


def _scored(runs: pd.DataFrame) -> str:
    """Return a sentence on how many instances have a score, and why others have none."""
    played = runs.loc[runs["agent"] == RULE, "instance"].nunique()
    judged = runs.loc[runs["agent"] == ORACLE, "instance"].nunique()
    scored = runs.loc[runs["score"].notna(), "instance"].nunique()
    return (
        f"{played} test instances; the oracle has played {judged} of them, and on {scored} it "
        f"earns at least {GAP:g} a step more than the tuned rule: these have a score."
    )


def _behind(found: Sequence[LeaderboardEntry]) -> str:
    """Return a sentence on versions and sources."""
    versions = " and ".join(sorted({entry.about["version"] for entry in found}))
    agents: dict[str, list[str]] = {}
    for entry in found:
        agents.setdefault(entry.about["sources"][:8], []).append(style_of(entry.agent).label)
    digests = "; ".join(f"`{digest}` ({', '.join(own)})" for digest, own in agents.items())
    if len(agents) == 1:
        digests = f"`{next(iter(agents))}`"
    return f"Flows of version {versions}. Digest of the sources: {digests}."


def ranged(found: Interval, digits: int = 2) -> str:
    """Return a value as text, with its interval if it has one; a dash if there is no value."""
    value, low, high = (f"{number:.{digits}f}" for number in found)
    if np.isnan(found[0]):
        return DASH
    return value if np.isnan(found[1]) else f"{value} [{low}, {high}]"


def percent(found: Interval) -> str:
    """Return shares in percent as text."""
    return ranged((100 * found[0], 100 * found[1], 100 * found[2]), 0)


def show(found: Sequence[LeaderboardEntry], splits: Sequence[str]) -> None:
    """Print the leaderboard of each set to the terminal, of all agents."""
    runs = scores.runs_of(found)
    for split in splits:
        own = usual(runs, split)
        if len(own):
            show_table(table(found, own), f"leaderboard, {split}")


def draw(found: Sequence[LeaderboardEntry], runs: pd.DataFrame, folder: Path) -> None:
    """Write the pictures of the test instances, of the same agents as the tables."""
    own = usual(only(entries.complete(found), runs), SPLIT)
    plots.plot_profiles(own, folder / PICTURES[0])
    plots.plot_trades(own, folder / PICTURES[1])
