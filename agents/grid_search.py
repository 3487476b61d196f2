"""The best static setting of a grid over Courant multiple, sound speed and xsph."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import tyro

from agents.evaluate import instance_ids, run_episode, show
from agents.jobs import run_jobs
from agents.policies import Spec

SETTINGS = ["courant", "sound", "xsph"]


@dataclass
class Args:
    """Try every static setting of a grid on training instances; every run goes to a CSV file."""

    scene: str = "dam_break"
    """scene of the environment"""
    n_instances: int = 8
    """training instances per setting"""
    courant: tuple[float, ...] = (0.4, 0.6, 0.8, 1.0, 1.2)
    """dt c / h"""
    sound: tuple[float, ...] = (0.2, 0.3, 0.4, 0.55, 0.75, 1.0)
    """sound speed / nominal c0"""
    xsph: tuple[float, ...] = (0.1, 0.3, 0.5)
    """XSPH epsilon"""
    output: Path = Path("runs")
    """folder of the CSV file"""


def search(args: Args) -> pd.DataFrame:
    """Run what is missing. Returns one row a setting, best mean return first."""
    instances = instance_ids(args.scene, "train", args.n_instances)
    jobs, keys = [], []
    for settings in itertools.product(args.courant, args.sound, args.xsph):
        for seed, instance in enumerate(instances):
            jobs.append((Spec("grid_search", settings), args.scene, instance, seed))
            keys.append({**dict(zip(SETTINGS, settings, strict=True)), "instance": instance})
    path = args.output / f"grid_search_{args.scene}.csv"
    runs = run_jobs(run_episode, jobs, keys, path, "grid search")
    measures = ["return", "work", "density_error", "clumping", "fidelity_error", "blowup"]
    means = runs.groupby(SETTINGS, as_index=False)[measures].mean()
    return means.sort_values("return", ascending=False, ignore_index=True)


def best(table: pd.DataFrame) -> Spec:
    """The agent that keeps the best setting of a search."""
    courant, sound, xsph = (float(table.loc[0, name]) for name in SETTINGS)
    return Spec("grid_search", (courant, sound, xsph))


def _text(table: pd.DataFrame) -> pd.DataFrame:
    return table.map(lambda value: f"{value:.3g}")


if __name__ == "__main__":
    arguments = tyro.cli(Args, description=__doc__)
    result = search(arguments)
    show(_text(result.head(10)), f"best static settings on {arguments.scene} (train)")
    print(f"every run: {arguments.output / f'grid_search_{arguments.scene}.csv'}")
