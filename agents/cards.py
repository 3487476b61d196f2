"""Cards of the shipped networks, and the figures on them: those that the leaderboard has."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from agents import board
from agents.entries import LeaderboardEntry
from agents.scores import RULE
from agents.styles import style_of
from sph_gym.controllers.network import SHIPPED, Network, shipped_network
from sph_gym.controllers.shipped import BEST, load, names
from sph_gym.env.selection import members
from sph_gym.files import atomic_write
from sph_gym.provenance import content_hash


def figures(
    network: Path, found: Sequence[LeaderboardEntry], runs: pd.DataFrame
) -> dict[str, str] | None:
    """Return what the leaderboard says of a network's agent, None without test flows of it.

    An agent has several trainings. The figures are of all of them: one alone would be chance.
    """
    digest = content_hash(network)
    entry = next((each for each in found if digest in each.about["networks"].values()), None)
    if entry is None:
        return None
    rows = board.table(found, board.usual(runs, board.SPLIT)).set_index("agent")
    labels = [style_of(name).label for name in (entry.agent, RULE)]
    if not set(labels) <= set(rows.index):
        return None
    own, rule = (rows.loc[label] for label in labels)
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
    """Return the cards of all shipped networks, with their present figures; none without runs."""
    cards = {}
    for name in names():
        known = figures(SHIPPED / f"{name}.npz", found, runs)
        cards[SHIPPED / f"{name}.json"] = load(name).card | {"figures": known or {}}
    return cards


def ship(
    path: Path, name: str, scene: str, *, how: str, command: str, seed: int, minutes: int
) -> Path:
    """Copy a network into the package with a card, list it as usable, and return where it is.

    path: of the exported network; name: of its algorithm; how, command, seed, minutes: of the
    training. There are no figures until the leaderboard has played it. In the list of the best
    networks it comes last.
    """
    target = shipped_network(name, scene)
    target.parent.mkdir(parents=True, exist_ok=True)
    network = Network.load(path)
    network.save(target)
    n_in, *widths = (weight.shape[1] for weight in network.weights)
    card = {
        "what": f"A policy for {scene}: observations {network.observation!r} to actions "
        f"{network.action!r}, a perceptron with {n_in} inputs and layers of "
        f"{' and '.join(map(str, widths))} {network.activation} units.",
        "how": how,
        "command": command,
        "seeds": [seed],
        "minutes": minutes,
        "figures": {},
        "limits": "They are not known yet: see the figures, and what docs/agents.md says of "
        "flows unlike those of the training.",
    }
    _write(target.with_suffix(".json"), card)
    path = SHIPPED / f"{BEST}.json"
    best = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    # a dictionary: its order, and so the file, is always the same
    for family in dict.fromkeys((*members(scene), scene)):
        usable = best.setdefault(family, [])
        usable += [target.stem] if target.stem not in usable else []
    _write(path, best)
    return target


def write(found: Sequence[LeaderboardEntry], runs: pd.DataFrame) -> None:
    """Write the present figures into the cards."""
    for path, card in renewed(found, runs).items():
        _write(path, card)


def _write(path: Path, content: Any) -> None:
    with atomic_write(path) as draft:
        draft.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
