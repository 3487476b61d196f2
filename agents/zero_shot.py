"""Transfer: gains over the tuned rule where an agent was not trained.

A gain is the mean reward a step above the tuned rule's on the same instances; all runs are those of
the leaderboard's files. Three tables: flows of "ood", shift by shift, against the test flows; the
same test flows at finer spacings; and each family for learners that weren't trained on all.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from agents import board, entries, scores
from agents.arguments import launch, option
from agents.entries import GAMES, LeaderboardEntry
from agents.report import markdown
from agents.scores import RULE, Values
from agents.styles import style_of
from sph_gym.env.instances import FINER, ODD

# A gain on the usual flows below this is none that could be kept.
LEAST = 0.01
USUAL = "test"


@dataclass
class ZeroShotArgs:
    """Arguments of the tables."""

    results: Path = option("folder of the leaderboard's files", entries.FOLDER)


def by_shift(runs: pd.DataFrame) -> pd.DataFrame:
    """Return gains on the test flows and on each shift of "ood", with the share that is kept."""
    rows = []
    for agent, own in _others(runs):
        usual = _gains(board.usual(own, USUAL))
        odd = board.usual(own, "ood")
        if not usual or odd.empty:
            continue
        row = {"agent": style_of(agent).label, USUAL: _gain(usual)}
        for shift in ODD:
            row[shift] = kept(_gains(odd[odd["shift"] == shift]), usual)
        rows.append(row)
    return pd.DataFrame(rows)


def by_spacing(runs: pd.DataFrame) -> pd.DataFrame:
    """Return gains on test flows at finer spacings, with the share of that on the same flows.

    The share compares what the same trainings gain on the same flows.
    """
    test = runs[runs["split"] == USUAL].copy()
    test[["flow", "_", "factor"]] = [id_.partition(f"/{FINER}") for id_ in test["instance"]]
    test["factor"] = test["factor"].replace("", "1").astype(int)
    rows = []
    for agent, own in _others(test):
        row = {"agent": style_of(agent).label}
        for factor, finer in own[own["factor"] > 1].groupby("factor"):
            # of the same trainings, too: not all of them may have played at each spacing
            same = own[own["factor"] == 1].merge(finer[["training", "flow"]])
            row[f"dx/{factor}"] = kept(_gains(finer), _gains(same))
        if len(row) > 1:
            rows.append(row)
    return pd.DataFrame(rows)


def by_family(found: Sequence[LeaderboardEntry], runs: pd.DataFrame) -> pd.DataFrame:
    """Return gains of learners on every family, if any learner missed one in training.

    A family that a learner was not trained on has a star.
    """
    test, rows = board.usual(runs, USUAL), []
    learners = [entry for entry in found if entry.about["trained_on"]]
    if len(entries.complete(learners)) == len(learners):
        return pd.DataFrame()
    for entry in learners:
        seen = entry.about["trained_on"]
        row = {"agent": style_of(entry.agent).label}
        for family in GAMES:
            own = test[(test["agent"] == entry.agent) & (test["family"] == family)]
            row[family] = _gain(_gains(own)) + ("" if family in seen else " *")
        rows.append(row)
    return pd.DataFrame(rows)


def kept(gains: list[Values], usual: list[Values]) -> str:
    """Return a mean gain with its interval, and the share of the usual gain that it is."""
    if not gains or not usual:
        return board.DASH
    mean, base = (scores.mean(scores.pooled(each)) for each in (gains, usual))
    share = f", {100 * mean / base:.0f} %" if base >= LEAST else ""
    return _gain(gains) + share


def _gain(gains: list[Values]) -> str:
    return board.ranged(scores.interval(gains, scores.mean))


def _gains(runs: pd.DataFrame) -> list[Values]:
    return scores.tables_by_family(runs, "gain")


def _others(runs: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """Return the runs of every agent but the rule."""
    return [(str(agent), own) for agent, own in runs.groupby("agent") if agent != RULE]


def tables(found: Sequence[LeaderboardEntry], runs: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return all tables that there is something for, by what they show."""
    every = {
        "Gain over the tuned rule by what is out of distribution, and the share kept of that on "
        "the test flows": by_shift(runs),
        "The same test flows at finer spacings: gain, and the share kept": by_spacing(runs),
        "Gain by family (* not trained on)": by_family(found, runs),
    }
    return {title: each for title, each in every.items() if len(each)}


def text(found: Sequence[LeaderboardEntry], runs: pd.DataFrame) -> str:
    """Return the part of the page."""
    parts = [
        f"{title}:\n\n{markdown(each.fillna(board.DASH))}"
        for title, each in tables(found, runs).items()
    ]
    return "\n\n".join(parts) or "Nothing has been played out of distribution yet."


def main(args: ZeroShotArgs) -> None:
    """Print the tables."""
    found = entries.read_all(args.results)
    print(text(found, scores.runs_of(found)))


if __name__ == "__main__":
    launch(main, ZeroShotArgs, __doc__)
