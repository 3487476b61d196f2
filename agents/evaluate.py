"""One episode of one agent on one instance, and many of them; the ground that all agents share."""

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd

from agents.jobs import run_jobs
from agents.policies import Policy, Spec, build
from sph_gym.env import SCENES, env_id
from sph_gym.env.instances import ODD, SIZES, shift
from sph_gym.solver.checks import known
from sph_gym.studies.table import print_table

# Columns of a table of runs and their headings.
MEASURES = {
    "return": "return",
    "work": "work",
    "density_error": "density [%]",
    "clumping": "clumping [%]",
    "fidelity_error": "fidelity",
    "blowup": "blow-up [%]",
}
PERCENT = ("density_error", "clumping", "blowup")


@dataclass
class Args:
    """Run one agent on numbered instances of a scene and print how it did."""

    scene: str = "dam_break"
    """scene of the environment"""
    instances: str = "test"
    """nominal, train, val, test or ood"""
    n_instances: int = 8
    """how many of them"""
    output: Path = Path("runs")
    """folder of the CSV file"""


def instance_ids(scene: str, split: str, count: int) -> list[str]:
    """The first `count` instances of a split. Raises ValueError for names that don't exist."""
    known("scene", scene, SCENES)
    if split not in SIZES:
        raise ValueError(f"instances: expected one of {', '.join(SIZES)}, got {split!r}")
    if not 1 <= count <= SIZES[split]:
        raise ValueError(f"n_instances: expected 1 to {SIZES[split]} in {split!r}, got {count}")
    return [f"{scene}/{split}/{k}" for k in range(count)]


def play(env: gym.Env[Any, Any], policy: Policy, instance: str, seed: int) -> list[dict[str, Any]]:
    """One episode; returns the info of every step, with the reward as "reward"."""
    observation, _ = env.reset(seed=seed, options={"instance": instance})
    infos: list[dict[str, Any]] = []
    over = False
    while not over:
        observation, reward, terminated, truncated, info = env.step(policy(env, observation))
        infos.append(info | {"reward": float(reward)})
        over = terminated or truncated
    return infos


def summarise(infos: list[dict[str, Any]], n_steps: int) -> dict[str, Any]:
    """An episode in one row. "return" is the sum of rewards per planned step."""
    table = pd.DataFrame(infos)
    terms = [name for name in table.columns if name.startswith("reward_")]
    return {
        "return": float(table["reward"].sum()) / n_steps,
        "work": float(table["work"].mean()),
        "n_substeps": float(table["n_substeps"].sum()),
        "density_error": float(table["density_error"].mean()),
        "clumping": float(table["clumping"].mean()),
        "fidelity_error": float(table["fidelity_error"].mean()),
        "blowup": float(table["blowup"].max()),
        "blowup_cause": str(table["blowup_cause"].iloc[-1]) or "-",
        "steps": len(table),
        **{name: float(table[name].sum()) / n_steps for name in terms},
    }


def run_episode(spec: Spec, scene: str, instance: str, seed: int) -> dict[str, Any]:
    """Build environment and agent, play one episode, summarise it."""
    env = gym.make(env_id(scene))
    began = time.perf_counter()
    infos = play(env, build(spec, seed), instance, seed)
    row = summarise(infos, env.unwrapped.n_steps)  # type: ignore[attr-defined]
    return row | {"wall_seconds": time.perf_counter() - began}


def evaluate(
    specs: Sequence[Spec], scene: str, instances: Sequence[str], path: Path, title: str = "episodes"
) -> pd.DataFrame:
    """Every agent on every instance with the same seeds; finished runs in `path` are kept.

    Raises OSError for a network that can't be read.
    """
    jobs, keys = [], []
    for spec in specs:
        about = {"agent": spec.name, "settings": _settings(spec)}
        for seed, instance in enumerate(instances):
            jobs.append((spec, scene, instance, seed))
            keys.append(about | {"instance": instance, "seed": seed})
    return run_jobs(run_episode, jobs, keys, path, title)


def _settings(spec: Spec) -> str:
    """What sets an agent apart from others of its name: its settings, or what its network holds.

    A network that is trained anew lies where the old one lay, so that its path tells nothing.
    """
    if spec.network is None:
        return str(spec.settings or "")
    path = Path(spec.network)
    return f"{path.name} sha256:{hashlib.sha256(path.read_bytes()).hexdigest()}"


def interval(values: np.ndarray, confidence: float = 0.95) -> tuple[float, float, float]:
    """Mean and bootstrap confidence interval over instances."""
    from scipy.stats import bootstrap

    values = np.asarray(values, dtype=float)
    mean = float(values.mean())
    if len(values) < 2 or np.ptp(values) == 0:
        return mean, mean, mean
    found = bootstrap(
        (values,), np.mean, confidence_level=confidence, method="percentile", rng=0
    ).confidence_interval
    return mean, float(found.low), float(found.high)


def summary_table(runs: pd.DataFrame) -> pd.DataFrame:
    """One row an agent, best return first: mean and interval of every measure."""
    rows = []
    for agent, group in runs.groupby("agent", sort=False):
        row: dict[str, Any] = {"agent": agent, "runs": len(group)}
        for measure in MEASURES:
            scale = 100.0 if measure in PERCENT else 1.0
            bounds = interval(scale * group[measure].to_numpy())
            row |= dict(zip((measure, f"{measure}_low", f"{measure}_high"), bounds, strict=True))
        rows.append(row)
    return pd.DataFrame(rows).sort_values("return", ascending=False, ignore_index=True)


def shift_table(runs: pd.DataFrame) -> pd.DataFrame:
    """The summary of each shift of "ood" by itself, with a column "shift"; empty without any.

    Each is another question, and a mean over all of them answers none.
    """
    shifts = runs["instance"].map(shift)
    parts = [summary_table(runs[shifts == each]).assign(shift=each)
             for each in ODD if (shifts == each).any()]  # fmt: skip
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def readable(summary: pd.DataFrame) -> pd.DataFrame:
    """The summary as text: mean ± half the 95 % interval, under headings with units.

    summary: of `summary_table` or `shift_table`.
    """
    texts = [name for name in ("shift", "agent") if name in summary]
    table = summary[texts].copy()
    for measure, heading in MEASURES.items():
        digits = 1 if measure in PERCENT else 2
        table[heading] = [
            f"{row[measure]:.{digits}f} ± "
            f"{(row[f'{measure}_high'] - row[f'{measure}_low']) / 2:.{digits}f}"
            for _, row in summary.iterrows()
        ]
    return table


def show(table: pd.DataFrame, title: str) -> None:
    """Print a table of text to the terminal."""
    n_text = 1 + ("shift" in table)
    print_table(title, list(table.columns), table.to_numpy().tolist(), n_text=n_text)


def main(spec: Spec, args: Args) -> None:
    """Evaluate one agent and print its row: what `python -m agents.NAME` does."""
    instances = instance_ids(args.scene, args.instances, args.n_instances)
    path = args.output / f"{spec.name}_{args.scene}_{args.instances}.csv"
    runs = evaluate([spec], args.scene, instances, path)
    show(readable(summary_table(runs)), f"{spec.name} on {args.scene} ({args.instances})")
    shifts = shift_table(runs)
    if len(shifts):
        show(readable(shifts), f"{spec.name} on {args.scene}, by what is out of distribution")
    print(f"every run: {path}")
