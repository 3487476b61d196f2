"""The best static settings: `python -m agents.static_search --method tpe --scene benchmark`.

`grid_search` tries all combinations, `random_search`, `tpe` and `cma_es` (Optuna's samplers) try
`trials` settings within the same bounds. Each scene gets the setting with the best mean return on
its instances, or each instance its own, in hindsight (`--per instance`).
"""

import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import pandas as pd

from agents.arguments import BackendArgs, launch, option
from agents.evaluate import MEASURES, Job, instance_ids, run_episodes, show, write_csv
from agents.policies import STATIC, Settings, Spec, read_table
from sph_gym.env.selection import members
from sph_gym.extras import needs_extra
from sph_gym.files import atomic_write
from sph_gym.solver.checks import in_range, known, positive, whole

SETTINGS = list(Settings._fields)
PER = ("scene", "instance")
# Settings that a sampler draws before it is told how they did: a generation of CMA-ES.
BATCH = 8


@dataclass
class StaticSearchArgs(BackendArgs):
    """Arguments of a search."""

    method: str = option("grid_search, random_search, tpe or cma_es", "grid_search")
    scene: str = option('scene of the environment; "benchmark": each of the six', "dam_break")
    instances: str = option("nominal, train, val, test or ood", "train")
    n_instances: int = option("how many of them, of each scene", 8)
    per: str = option("what gets a setting of its own: scene, or instance (hindsight)", "scene")
    courant: tuple[float, ...] = option("dt c / h", (0.4, 0.6, 0.8, 1.0, 1.2))
    sound: tuple[float, ...] = option("sound speed / nominal c0", (0.2, 0.3, 0.4, 0.55, 0.75, 1.0))
    xsph: tuple[float, ...] = option("XSPH epsilon", (0.1, 0.3, 0.5, 0.7))
    trials: int = option("settings that a sampler tries between the ends of these lists", 120)
    first: tuple[Path, ...] = option("tables whose settings a sampler tries before its own", ())
    seed: int = option("of the sampler", 0)
    output: Path = option("folder of the tables; finished episodes in it are kept", Path("runs"))

    def __post_init__(self) -> None:
        known("method", self.method, STATIC[:-1])
        known("per", self.per, PER)
        for name in ("courant", "sound"):
            for value in getattr(self, name):
                positive(name, value)
        for value in self.xsph:
            in_range("xsph", value, 0.0)
        if self.first and self.method == "grid_search":
            raise ValueError("first: expected none for grid_search, which tries the whole grid")

    @property
    def runs(self) -> Path:
        """The file that holds every run."""
        return self.output / f"{self.method}_{self.scene}_{self.instances}_per_{self.per}.csv"

    @property
    def table(self) -> Path:
        """The file of the best settings, by scene or instance."""
        return self.runs.with_suffix(".json")


class Proposer(Protocol):
    """Proposes settings, batch by batch, until `ask` returns none."""

    def ask(self) -> list[Settings]:
        """Return the settings to try next."""

    def tell(self, returns: list[float]) -> None:
        """Take the mean returns of the settings that were asked for."""


class GridSearch:
    """All combinations in one batch."""

    def __init__(self, args: StaticSearchArgs) -> None:
        self._left = list(
            map(Settings._make, itertools.product(args.courant, args.sound, args.xsph))
        )

    def ask(self) -> list[Settings]:
        """Return all settings, then none."""
        return self._left

    def tell(self, returns: list[float]) -> None:
        """End the search."""
        self._left = []


class Sampler:
    """A sampler of Optuna.

    first: settings that it tries before its own.
    """

    def __init__(self, args: StaticSearchArgs, first: Sequence[Settings]) -> None:
        with needs_extra("agents"):
            import optuna
        samplers: dict[str, Any] = {
            "random_search": lambda: optuna.samplers.RandomSampler(args.seed),
            "tpe": lambda: optuna.samplers.TPESampler(seed=args.seed, constant_liar=True),
            "cma_es": lambda: optuna.samplers.CmaEsSampler(seed=args.seed, popsize=BATCH),
        }
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._study = optuna.create_study(sampler=samplers[args.method](), direction="maximize")
        real = optuna.distributions.FloatDistribution
        self._space = {
            "courant": real(min(args.courant), max(args.courant), log=True),
            "sound": real(min(args.sound), max(args.sound), log=True),
            "xsph": real(min(args.xsph), max(args.xsph)),
        }
        for settings in first:
            self._study.enqueue_trial(settings._asdict())
        self._left, self._asked = whole("trials", args.trials, at_least=1), list[Any]()

    def ask(self) -> list[Settings]:
        """Return up to BATCH settings."""
        count = min(BATCH, self._left)
        self._left -= count
        self._asked = [self._study.ask(dict(self._space)) for _ in range(count)]
        return [Settings(**trial.params) for trial in self._asked]

    def tell(self, returns: list[float]) -> None:
        """Take the mean returns of the settings that were asked for."""
        for trial, value in zip(self._asked, returns, strict=True):
            self._study.tell(trial, value)


class Group(NamedTuple):
    """Instances that share a setting."""

    name: str
    ids: list[str]
    proposer: Proposer


def _groups(args: StaticSearchArgs) -> Iterator[Group]:
    tables = [read_table(path) for path in args.first]
    for scene in members(args.scene):
        ids = instance_ids(scene, args.instances, args.n_instances)
        parts = {scene: ids} if args.per == "scene" else {id_: [id_] for id_ in ids}
        for name, part in parts.items():
            if args.method == "grid_search":
                yield Group(name, part, GridSearch(args))
                continue
            found = [table.get(name, table.get(scene)) for table in tables]
            first = [Settings(*settings) for settings in found if settings is not None]
            yield Group(name, part, Sampler(args, first))


def search(args: StaticSearchArgs) -> pd.DataFrame:
    """Try all settings; return a row a group and setting, the best mean return of each first.

    Writes every run as CSV, and the best setting of every group as JSON. Raises ValueError for
    unknown names, and ImportError that names the extra if Optuna is needed and missing.
    """
    groups, tables = list(_groups(args)), list[pd.DataFrame]()
    # all groups go on together, so that many episodes are played side by side
    while asked := {group.name: found for group in groups if (found := group.proposer.ask())}:
        table = _play(args, groups, asked)
        tables.append(table)
        means = table.groupby(["group", "place"])["return"].mean()
        for group in groups:
            group.proposer.tell(means[group.name].tolist())
    runs = pd.concat(tables, ignore_index=True).drop(columns="place")
    write_csv(runs, args.runs)
    found = runs.groupby(["group", *SETTINGS], as_index=False)[list(MEASURES)].mean()
    found = found.sort_values(["group", "return"], ascending=[True, False], ignore_index=True)
    with atomic_write(args.table) as draft:
        draft.write_text(json.dumps(best(found), indent=1) + "\n")
    return found


def _play(
    args: StaticSearchArgs, groups: list[Group], asked: dict[str, list[Settings]]
) -> pd.DataFrame:
    """Return a row an episode; "place" is that of its setting in the batch of its group."""
    tried = [
        (Job(Spec(args.method, settings), id_.split("/")[0], id_, seed), group.name, place)
        for group in groups
        for place, settings in enumerate(asked[group.name])
        for seed, id_ in enumerate(group.ids)
    ]
    rows = run_episodes([job for job, _, _ in tried], args.output, args.method, args.where())
    return pd.DataFrame(
        {"group": name, "place": place, "instance": job.instance}
        | Settings(*job.spec.settings)._asdict()  # type: ignore[misc]
        | row
        for (job, name, place), row in zip(tried, rows, strict=True)
    )


def best(found: pd.DataFrame) -> dict[str, Settings]:
    """Return the best setting of every group of a search."""
    firsts = found.groupby("group", sort=False).first()
    return {str(name): Settings(*map(float, row)) for name, *row in firsts[SETTINGS].itertuples()}


def main(args: StaticSearchArgs) -> None:
    """Search, and print the best settings of every group."""
    found = search(args)
    top = found.groupby("group").head(10 if found["group"].nunique() == 1 else 1)
    numbers = top.drop(columns="group").map(lambda value: f"{value:.3g}")
    show(pd.concat([top[["group"]], numbers], axis=1), f"{args.method} ({args.instances})")
    print(f"every run: {args.runs}, the best settings: {args.table}")


if __name__ == "__main__":
    launch(main, StaticSearchArgs, __doc__)
