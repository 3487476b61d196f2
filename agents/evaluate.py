"""Play an agent on instances, one episode or many, and sum up how it did."""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import pandas as pd

from agents import policies
from agents.arguments import BackendArgs, launch, option
from agents.policies import Policy, Spec, build
from sph_gym.env import SCENES, env_id
from sph_gym.env.instances import ODD, SIZES, shift
from sph_gym.files import atomic_write
from sph_gym.provenance import content_hash
from sph_gym.solver.checks import known
from sph_gym.studies.averages import bootstrap_interval
from sph_gym.studies.backends import LOCAL, Backend
from sph_gym.studies.episodes import WORST_ERROR
from sph_gym.studies.jobs import run_jobs
from sph_gym.studies.results import Results
from sph_gym.studies.table import print_table

# Columns of a table of runs and their headings.
MEASURES = {
    "return": "return",
    "work": "work",
    "density_error": "density [%]",
    "clumping": "clumping [%]",
    "noise": "noise [%]",
    "fidelity_error": "fidelity",
    "blowup": "blow-up [%]",
}
PERCENT = ("density_error", "clumping", "noise", "blowup")


# Column of the time that the policy itself takes.
CLOCK = "policy_seconds"

# Sources of the agents, besides those of the package, that decide how an episode goes: also those
# of agents from modules of their own, which `policies` imports.
SOURCES = (
    Path(__file__),
    Path(policies.__file__),
    *sorted(
        Path(str(sys.modules[name].__file__))
        for name in {getattr(each, "__module__", None) or "" for each in vars(policies).values()}
        if name.startswith("agents.") and name != policies.__name__
    ),
)


@dataclass
class EvaluationArgs(BackendArgs):
    """Arguments of a program that plays one agent."""

    scene: str = option("scene of the environment", "dam_break")
    instances: str = option("nominal, train, val, test or ood", "test")
    n_instances: int = option("how many of them", 8)
    output: Path = option("folder of the CSV file; finished episodes in it are kept", Path("runs"))


class Job(NamedTuple):
    """An episode to be played: an agent on an instance of a scene, with a seed."""

    spec: Spec
    scene: str
    instance: str
    seed: int


def instance_ids(scene: str, split: str, count: int) -> list[str]:
    """Return the first `count` instances of a split. Raises ValueError for unknown names."""
    known("scene", scene, SCENES)
    if not 1 <= count <= SIZES[known("instances", split, SIZES)]:
        raise ValueError(f"n_instances: expected 1 to {SIZES[split]} in {split!r}, got {count}")
    return [f"{scene}/{split}/{k}" for k in range(count)]


def play(env: gym.Env[Any, Any], policy: Policy, instance: str, seed: int) -> list[dict[str, Any]]:
    """Play one episode; return the info of every step, with the reward as "reward"."""
    observation, _ = env.reset(seed=seed, options={"instance": instance})
    infos: list[dict[str, Any]] = []
    over = False
    while not over:
        observation, reward, terminated, truncated, info = env.step(policy(env, observation))
        infos.append(info | {"reward": float(reward)})
        over = terminated or truncated
    return infos


def summarise(infos: list[dict[str, Any]], n_steps: int) -> dict[str, Any]:
    """Return an episode in one row; "return" is the sum of rewards per planned step.

    "error" is the mean of the largest error of each step, in multiples of its tolerance, "beyond"
    the share of steps out of tolerance; steps that a blow-up has prevented count as the worst.
    """
    table = pd.DataFrame(infos)
    terms = [name for name in table.columns if name.startswith("reward_")]
    lost = n_steps - len(table)
    errors = table["error"].clip(upper=WORST_ERROR)
    return {
        "return": float(table["reward"].sum()) / n_steps,
        "work": float(table["work"].mean()),
        "n_substeps": float(table["n_substeps"].sum()),
        "density_error": float(table["density_error"].mean()),
        "clumping": float(table["clumping"].mean()),
        "noise": float(table["noise"].mean()),
        "fidelity_error": float(table["fidelity_error"].mean()),
        "error": float(errors.sum() + WORST_ERROR * lost) / n_steps,
        "beyond": float(table["cost"].sum() + lost) / n_steps,
        "blowup": float(table["blowup"].max()),
        "blowup_cause": str(table["blowup_cause"].iloc[-1]) or "-",
        "steps": len(table),
        **{name: float(table[name].sum()) / n_steps for name in terms},
    }


class Timed:
    """A policy; seconds: processor time that it has taken so far, on its thread."""

    def __init__(self, policy: Policy) -> None:
        self._policy, self.seconds = policy, 0.0

    def __call__(self, env: gym.Env[Any, Any], observation: Any) -> Any:
        """Return the action of the policy."""
        began = time.thread_time()
        action = self._policy(env, observation)
        self.seconds += time.thread_time() - began
        return action


def run_episode(spec: Spec, scene: str, instance: str, seed: int) -> dict[str, Any]:
    """Build environment and agent, play one episode, and return its row.

    CLOCK, the policy's own time a step [s], is all that differs from run to run.
    """
    env, policy = gym.make(env_id(scene)), Timed(build(spec, seed))
    infos = play(env, policy, instance, seed)
    row = summarise(infos, env.unwrapped.n_steps)  # type: ignore[attr-defined]
    return row | {CLOCK: policy.seconds / len(infos)}


def run_episodes(
    jobs: Sequence[Job], folder: Path, title: str, backend: Backend = LOCAL
) -> list[dict[str, Any]]:
    """Return the row of every job, in their order; what `folder` has is not played again.

    Raises OSError for a network that can't be read.
    """
    code = content_hash(*SOURCES)
    keys = [about(job) | {"code": code} for job in jobs]
    return run_jobs(run_episode, jobs, keys, Results(folder / "episodes"), title, backend)


def evaluate(
    specs: Sequence[Spec],
    scene: str,
    instances: Sequence[str],
    path: Path,
    backend: Backend = LOCAL,
) -> pd.DataFrame:
    """Return one row an agent and instance, with the same seeds for all; also a CSV file, `path`.

    Finished episodes are kept beside it. Raises OSError for a network that can't be read.
    The file is the same to the last byte wherever the episodes are played.
    """
    numbered = list(enumerate(instances))
    jobs = [Job(spec, scene, instance, seed) for spec in specs for seed, instance in numbered]
    rows = run_episodes(jobs, path.parent, "episodes", backend)
    runs = pd.DataFrame([about(job) | row for job, row in zip(jobs, rows, strict=True)])
    runs = runs.drop(columns=CLOCK, errors="ignore")
    write_csv(runs, path)
    return runs


def about(job: Job) -> dict[str, Any]:
    """Return the columns that identify an episode.

    A file counts by its content: a new training writes its network to the same path.
    """
    settings = str(tuple(job.spec.settings or ()) or "")
    for file in (job.spec.network, job.spec.table):
        if file is not None:
            settings = f"{Path(file).name} {content_hash(Path(file))}"
    agent, instance, seed = job.spec.name, job.instance, job.seed
    return {"agent": agent, "settings": settings, "instance": instance, "seed": seed}


def write_csv(table: pd.DataFrame, path: Path) -> None:
    """Write a table as CSV; make its folder if there is none."""
    with atomic_write(path) as draft:
        table.to_csv(draft, index=False)


def summary_table(runs: pd.DataFrame) -> pd.DataFrame:
    """Return one row an agent, best return first: mean and interval of every measure."""
    rows = []
    for agent, group in runs.groupby("agent", sort=False):
        row: dict[str, Any] = {"agent": agent, "runs": len(group)}
        for measure in MEASURES:
            scale = 100.0 if measure in PERCENT else 1.0
            bounds = bootstrap_interval(scale * group[measure].to_numpy())
            row |= dict(zip((measure, f"{measure}_low", f"{measure}_high"), bounds, strict=True))
        rows.append(row)
    return pd.DataFrame(rows).sort_values("return", ascending=False, ignore_index=True)


def shift_table(runs: pd.DataFrame) -> pd.DataFrame:
    """Return a summary of each shift of "ood", with a column "shift"; empty without any."""
    shifts = runs["instance"].map(shift)
    present = [each for each in ODD if (shifts == each).any()]
    parts = [summary_table(runs[shifts == each]).assign(shift=each) for each in present]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def readable(summary: pd.DataFrame) -> pd.DataFrame:
    """Return a summary as text: mean ± half the 95 % interval, under headings with units.

    summary: as `summary_table` or `shift_table` returns it.
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


def show_summary(runs: pd.DataFrame, title: str) -> None:
    """Print the summary of runs to the terminal, and each shift of "ood" by itself."""
    show(readable(summary_table(runs)), title)
    shifts = shift_table(runs)
    if len(shifts):
        show(readable(shifts), f"{title}, by what is out of distribution")


def main(name: str, description: str | None) -> None:
    """Evaluate an agent that follows a rule: what `python -m agents.NAME` does."""
    launch(partial(play_agent, Spec(name)), EvaluationArgs, description)


def play_agent(spec: Spec, args: EvaluationArgs) -> None:
    """Evaluate one agent and print its row."""
    instances = instance_ids(args.scene, args.instances, args.n_instances)
    path = args.output / f"{spec.name}_{args.scene}_{args.instances}.csv"
    runs = evaluate([spec], args.scene, instances, path, args.where())
    show_summary(runs, f"{spec.name} on {args.scene} ({args.instances})")
    print(f"every run: {path}")
