"""Networks that come with the package, and which of them is best for a family of flows.

A network NAME is two files of `networks/`: NAME.npz, numbers only, and NAME.json, its card. A name
is an algorithm and the family that it was trained on, or "benchmark" for all of them: such as
ppo_warm_benchmark.
`networks/best.json` has the networks of every family, the best one first.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.controllers.network import SHIPPED, Network
from sph_gym.solver.checks import known

# Entries of a card: what the network does, how it was trained and by which command, on which seeds,
# how long [minutes], what it reached (figures with intervals), and where it must not be trusted.
CARD = ("what", "how", "command", "seeds", "minutes", "figures", "limits")
BEST, BENCHMARK = "best", "benchmark"


class ShippedPolicy:
    """A network of the package: an observation becomes an action.

    name: of the network; network: with the layouts of its observations and actions; card: entries
    by the names of CARD.
    """

    def __init__(self, name: str, network: Network, card: dict[str, Any]) -> None:
        self.name, self.network, self.card = name, network, card

    def __call__(self, observation: NDArray[Any]) -> Any:
        """Return the action for an observation (n,): (3,), or the number of a discrete action.

        Raises ValueError for an observation of another length.
        """
        values = self.network(observation)
        return np.int64(values.argmax()) if self.network.squash == "none" else values


def shipped(family: str, action_mode: str = "absolute") -> ShippedPolicy:
    """Return the best network for a family of flows, such as "dam_break" or "benchmark".

    action_mode: of the environment that is to be stepped with what the policy returns.
    Raises ValueError if the package has none for it, or if its files are damaged.
    """
    best = _best()
    if not best:
        raise ValueError(
            f"family: no network comes with this version, so none for {family!r}; a clone of the "
            "project trains some: sph-gym agents"
        )
    policies = [load(name) for name in best[known("family", family, best)]]
    by_mode = {policy.network.action.partition(" ")[0]: policy for policy in reversed(policies)}
    return by_mode[known("action_mode", action_mode, by_mode)]


def load(name: str) -> ShippedPolicy:
    """Return a network of the package by its name, such as "ppo_warm_benchmark".

    Raises ValueError for an unknown name, a damaged file, or a card without all entries of CARD.
    """
    known("network", name, names())
    path = SHIPPED / f"{name}.json"
    try:
        card = json.loads(path.read_text(encoding="utf-8"))
        missing = [entry for entry in CARD if entry not in card]
    except (OSError, ValueError, TypeError) as error:
        raise ValueError(f"network: {path} is no card ({error})") from None
    if missing:
        raise ValueError(f"network: expected {', '.join(missing)} in the card {path}")
    return ShippedPolicy(name, Network.load(SHIPPED / f"{name}.npz"), card)


def names() -> list[str]:
    """Return the names of all networks of the package."""
    return sorted(path.stem for path in SHIPPED.glob("*.npz"))


def fitting(family: str) -> dict[str, str]:
    """Return the networks for a family, by algorithm and as "best".

    An algorithm stands for its network of that family, or else for the one for all families.
    """
    found: dict[str, str] = {}
    for of in (BENCHMARK, family):
        found |= {n.removesuffix(f"_{of}"): n for n in names() if n.endswith(f"_{of}")}
    best = _best()
    return found | ({BEST: best[family][0]} if family in best else {})


def network_of(algorithm: str, family: str) -> Path | None:
    """Return the file of an algorithm's network for a family, None if the package has none."""
    name = fitting(family).get(algorithm)
    return None if name is None else SHIPPED / f"{name}.npz"


def _best() -> dict[str, list[str]]:
    path = SHIPPED / f"{BEST}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
