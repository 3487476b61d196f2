"""Entries of the leaderboard: one JSON file an agent, with all it was measured on and with what.

A file holds the runs of one agent and the digests of what decides them: the manifests (which flows
the ids mean, and their references), the networks or the table of settings, and the sources. Runs
are the same wherever they are repeated, to the last digit, as long as the processor has the same
vectors: others add up in another order. Only the policy's own time isn't, so it is one number, with
the machine.
"""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from agents.evaluate import CLOCK, SOURCES
from agents.policies import LEARNED, STATIC, Spec
from sph_gym.env import instances, manifest
from sph_gym.env.selection import GROUPS
from sph_gym.files import atomic_write
from sph_gym.provenance import content_hash, source_hash
from sph_gym.solver.checks import known
from sph_gym.studies import machine
from sph_gym.studies.results import COMMON

FOLDER = Path(__file__).parents[1] / "docs" / "leaderboard"
GAMES = GROUPS["benchmark"]
# Columns of a run: which training of the agent, the instance, and what `run_episode` measures.
MEASURED = ("return", "work", "error", "beyond", "blowup", "steps")
COLUMNS = ("training", "instance", *MEASURED)
# Digits that are kept of a number.
DIGITS = 9


class Agent(NamedTuple):
    """An agent of the leaderboard.

    name: of its file; specs: for every family, one of each training; trained_on: families that its
    trainings saw, none for agents that don't learn.
    """

    name: str
    specs: Mapping[str, tuple[Spec, ...]]
    trained_on: tuple[str, ...] = ()

    @property
    def networks(self) -> dict[str, str]:
        """Digests of its networks by the names of their files, training by training.

        Raises OSError without a file.
        """
        trainings = zip(*self.specs.values(), strict=True)
        specs = (spec for families in trainings for spec in families)
        # one network may play all families
        paths = dict.fromkeys(Path(spec.network) for spec in specs if spec.network is not None)
        return {f"{path.parent.name}/{path.name}": content_hash(path) for path in paths}

    @property
    def table(self) -> str | None:
        """Digest of its table of settings, None for agents without."""
        tables = {spec.table for family in self.specs.values() for spec in family}
        return next((content_hash(Path(table)) for table in tables if table is not None), None)


def rule(name: str, table: Path | None = None) -> Agent:
    """Return an agent that was not trained; table: of the settings, for a static agent.

    Raises ValueError for one that needs a network, or a table that it has not.
    """
    if name in LEARNED:
        raise ValueError(f"agents: {name} needs networks, give it as --learner with --networks")
    if (name in STATIC) != (table is not None):
        needed = "a file of settings" if name in STATIC else "none"
        raise ValueError(f"table: expected {needed} for {name}, got {table}")
    if table is not None and not table.is_file():
        raise ValueError(f"table: there is no file {table}")
    spec = Spec(name, table=None if table is None else str(table))
    return Agent(name, dict.fromkeys(GAMES, (spec,)))


def learner(name: str, networks: Sequence[str], trained_on: Sequence[str]) -> Agent:
    """Return an agent with a network of each training.

    name: begins with its algorithm, as "ppo" or "ppo-small"; networks: files, in which {family}
    stands for the family if each has its own. Raises ValueError that names the argument.
    """
    algorithm = known("learner", name.split("-")[0], LEARNED)
    if not re.fullmatch(r"[\w-]+", name):
        raise ValueError(f"learner: expected letters, digits, _ and - in a name, got {name!r}")
    if not networks:
        raise ValueError(f"networks: expected a file of each training of {name}, got none")
    for family in trained_on:
        known("trained_on", family, GAMES)
    specs = {
        family: tuple(
            Spec(algorithm, network=path.replace("{family}", family)) for path in networks
        )
        for family in GAMES
    }
    paths = {Path(str(spec.network)) for each in specs.values() for spec in each}
    for path in paths:
        if not path.is_file():
            raise ValueError(f"networks: there is no file {path}")
    found = Agent(name, specs, tuple(trained_on))
    digests = {path: content_hash(path) for path in paths}
    contents = {
        tuple(digests[Path(str(spec.network))] for spec in training)
        for training in zip(*specs.values(), strict=True)
    }
    if len(contents) < len(networks):
        raise ValueError(
            "networks: expected another network for each training, and got one of them twice"
        )
    if len(found.networks) < len(paths):
        raise ValueError(
            "networks: expected files that differ in their names or those of their folders, by "
            f"which they are listed, got {', '.join(sorted(map(str, paths)))}"
        )
    return found


class LeaderboardEntry(NamedTuple):
    """Contents of a file: digests and times (`about`), and a table of COLUMNS, a row a run."""

    about: dict[str, Any]
    runs: pd.DataFrame

    @property
    def agent(self) -> str:
        """Name of the agent."""
        return str(self.about["agent"])


def complete(found: Iterable[LeaderboardEntry]) -> list[LeaderboardEntry]:
    """Return the entries of agents from whose training no family was left out."""
    return [each for each in found if set(each.about["trained_on"] or GAMES) >= set(GAMES)]


def sources() -> str:
    """Return the digest of all sources that decide how an episode goes."""
    return content_hash(source_hash(*COMMON), *SOURCES)


def manifests() -> dict[str, dict[str, str]]:
    """Return the digests of the flows of every family and of their references."""
    found = {family: manifest.load(family) for family in GAMES}
    return {family: each.digests for family, each in found.items() if each is not None}


def make(agent: Agent, runs: pd.DataFrame) -> LeaderboardEntry:
    """Return the entry of an agent; runs: with COLUMNS and CLOCK."""
    here = machine.describe()
    about = {
        "agent": agent.name,
        "version": manifest.VERSION,
        "trained_on": list(agent.trained_on),
        "networks": agent.networks,
        "table": agent.table,
        "sources": sources(),
        "manifests": manifests(),
        "policy_microseconds": round(1e6 * float(runs[CLOCK].median()), 1),
        "processor": here["processor"],
        "vectors": here["vectors"],
    }
    table = runs[list(COLUMNS)].copy()
    table["order"] = table["instance"].map(_order)
    table = table.sort_values(["training", "order"], ignore_index=True).drop(columns="order")
    return LeaderboardEntry(about, table)


def _order(id_: str) -> tuple[str, str, int, str]:
    found = instances.parse(id_)
    return found.scene, found.split, found.number, id_


def path_of(name: str, folder: Path) -> Path:
    """Return the file of an agent."""
    return folder / f"{name}.json"


def write(entry: LeaderboardEntry, folder: Path) -> Path:
    """Write the file of an agent, a run a line, and return its path."""
    path = path_of(entry.agent, folder)
    rows = map(shortened, entry.runs[list(COLUMNS)].itertuples(index=False))
    lines = ",\n".join(map(json.dumps, rows))
    head = json.dumps({**entry.about, "columns": COLUMNS}, indent=1)
    with atomic_write(path) as draft:
        draft.write_text(f'{head[:-2]},\n "runs": [\n{lines}\n]}}\n', encoding="utf-8")
    return path


def shortened(row: Iterable[Any]) -> list[Any]:
    """Return values with as many digits as files keep."""
    return [float(f"{x:.{DIGITS}g}") if isinstance(x, float) else x for x in row]


def read(path: Path) -> LeaderboardEntry:
    """Return what a file holds. Raises ValueError if it is none of the leaderboard."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        rows, columns = data.pop("runs"), data.pop("columns")
        if tuple(columns) != COLUMNS or data["agent"] != path.stem:
            raise ValueError("other columns or another agent")
        return LeaderboardEntry(data, pd.DataFrame(rows, columns=columns))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{path} is no entry of the leaderboard: {error}") from None


def read_all(folder: Path) -> list[LeaderboardEntry]:
    """Return all entries of a folder. Raises ValueError if there are none."""
    found = [read(path) for path in sorted(folder.glob("*.json"))]
    if not found:
        raise ValueError(f"results: there are no entries in {folder}")
    return found
