"""Figures on the cards of the shipped networks: those that the leaderboard has of them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from agents import board
from agents.entries import LeaderboardEntry
from agents.scores import RULE
from agents.styles import style_of
from sph_gym.controllers.network import SHIPPED
from sph_gym.controllers.shipped import load, names
from sph_gym.files import atomic_write
from sph_gym.provenance import content_hash


def figures(
    network: Path, found: Sequence[LeaderboardEntry], runs: pd.DataFrame
) -> dict[str, str] | None:
    """Return what the leaderboard says of a network's agent, None if it has not played there.

    An agent has several trainings. The figures are of all of them: one alone would be chance.
    """
    digest = content_hash(network)
    entry = next((each for each in found if digest in each.about["networks"].values()), None)
    if entry is None:
        return None
    rows = board.table(found, board.usual(runs, board.SPLIT)).set_index("agent")
    own, rule = (rows.loc[style_of(name).label] for name in (entry.agent, RULE))
    place = list(entry.about["networks"].values()).index(digest) + 1
    return {
        "source": f"docs/leaderboard/{entry.agent}.json: {own['trainings']} trainings, of which "
        f"this is number {place}, on {rule['runs']} test instances each",
        "score, 0 the tuned rule, 1 the oracle": own["score"],
        "better than the tuned rule": f"{own['better than the rule [%]']} % of the runs",
        "mean reward a step": f"{own['return']}, the tuned rule {rule['return']}",
        "work": f"{own['work']} of the tuned rule's",
        "steps out of tolerance": f"{own['beyond [%]']} %, the tuned rule {rule['beyond [%]']} %",
        "blow-ups": f"{own['blow-ups']} in {own['runs']} episodes, the tuned rule "
        f"{rule['blow-ups']} in {rule['runs']}",
    }


def renewed(found: Sequence[LeaderboardEntry], runs: pd.DataFrame) -> dict[Path, dict[str, Any]]:
    """Return the cards of all shipped networks that have played, with their present figures."""
    cards = {}
    for name in names():
        known = figures(SHIPPED / f"{name}.npz", found, runs)
        if known is not None:
            cards[SHIPPED / f"{name}.json"] = load(name).card | {"figures": known}
    return cards


def write(found: Sequence[LeaderboardEntry], runs: pd.DataFrame) -> None:
    """Write the present figures into the cards."""
    for path, card in renewed(found, runs).items():
        with atomic_write(path) as draft:
            draft.write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")
