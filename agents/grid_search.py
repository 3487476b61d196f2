"""The best static setting of a grid over Courant multiple, sound speed and xsph."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from agents.arguments import BackendArgs, option, parse
from agents.evaluate import MEASURES, Job, instance_ids, run_episodes, show, write_csv
from agents.policies import Spec

SETTINGS = ["courant", "sound", "xsph"]


@dataclass
class GridSearchArgs(BackendArgs):
    """Arguments of a search: the grid, and the training instances to try it on."""

    scene: str = option("scene of the environment", "dam_break")
    n_instances: int = option("training instances per setting", 8)
    courant: tuple[float, ...] = option("dt c / h", (0.4, 0.6, 0.8, 1.0, 1.2))
    sound: tuple[float, ...] = option("sound speed / nominal c0", (0.2, 0.3, 0.4, 0.55, 0.75, 1.0))
    xsph: tuple[float, ...] = option("XSPH epsilon", (0.1, 0.3, 0.5, 0.7))
    output: Path = option("folder of the CSV file; finished episodes in it are kept", Path("runs"))

    @property
    def table(self) -> Path:
        """The file that holds every run."""
        return self.output / f"grid_search_{self.scene}.csv"


def search(args: GridSearchArgs) -> pd.DataFrame:
    """Try every setting of the grid; return one row a setting, best mean return first."""
    instances = instance_ids(args.scene, "train", args.n_instances)
    jobs = [
        Job(Spec("grid_search", settings), args.scene, instance, seed)
        for settings in itertools.product(args.courant, args.sound, args.xsph)
        for seed, instance in enumerate(instances)
    ]
    rows = run_episodes(jobs, args.output, "grid search", args.where())
    tried = pd.DataFrame([job.spec.settings for job in jobs], columns=SETTINGS)
    tried["instance"] = [job.instance for job in jobs]
    runs = tried.join(pd.DataFrame(rows))
    write_csv(runs, args.table)
    means = runs.groupby(SETTINGS, as_index=False)[list(MEASURES)].mean()
    return means.sort_values("return", ascending=False, ignore_index=True)


def best(table: pd.DataFrame) -> Spec:
    """Return the agent that keeps the best setting of a search."""
    courant, sound, xsph = (float(table.loc[0, name]) for name in SETTINGS)
    return Spec("grid_search", (courant, sound, xsph))


if __name__ == "__main__":
    arguments = parse(GridSearchArgs, __doc__)
    top = search(arguments).head(10).map(lambda value: f"{value:.3g}")
    show(top, f"best static settings on {arguments.scene} (train)")
    print(f"every run: {arguments.table}")
