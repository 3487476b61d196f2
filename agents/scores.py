"""Statistics of the leaderboard: scores, their intervals, profiles, improvement, hypervolume.

The score of a run is 0 where it earns as much as the tuned rule on the same instance and 1 where it
earns as much as the oracle. Where the two are closer than GAP, what is between them is mostly
chance, and the instance has no score; all other measures count it.

Intervals are stratified bootstraps: families are strata, in each of which instances are drawn with
replacement; trainings are drawn once for all families. Families with few instances are one stratum,
since a handful says too little of how much instances differ.

Source: Agarwal et al. 2021, "Deep reinforcement learning at the edge of the statistical precipice".
"""

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from agents.entries import LeaderboardEntry
from sph_gym.env import instances
from sph_gym.studies.averages import interquartile_mean

RULE, ORACLE, BEST_STATIC = "tuned_cfl", "lookahead", "hindsight"
# Smallest gap in mean reward a step between rule and oracle for which an instance has a score.
GAP = 0.05
REPLICAS, LEVEL = 2000, 0.95
# Instances that make a family a stratum of its own.
FEW = 5
# Returns that differ by less are equal: files keep so many digits.
EQUAL = 1e-8
# Work and error, in multiples of the rule's and of the tolerance, from which hypervolumes are
# taken: as dear or as wrong as that counts nothing.
WORST = (2.0, 2.0)

Values = NDArray[np.float64]
Interval = tuple[float, float, float]


def runs_of(entries: Sequence[LeaderboardEntry]) -> pd.DataFrame:
    """Return the runs of all entries, with agent, family, split, shift, finer, and their score.

    finer: True at another spacing than the usual one; score: not a number without rule or oracle.
    """
    runs = pd.concat([each.runs.assign(agent=each.agent) for each in entries], ignore_index=True)
    ids = pd.Series({id_: instances.parse(id_) for id_ in runs["instance"].unique()})
    found = runs["instance"].map(ids)
    runs["family"] = [each.scene for each in found]
    runs["split"] = [each.split for each in found]
    runs["finer"] = runs["instance"].str.contains(instances.FINER)
    runs["shift"] = [instances.shift(id_) for id_ in runs["instance"]]
    runs["gain"] = runs["return"] - runs["instance"].map(returns_of(runs, RULE))
    gap = returns_of(runs, ORACLE) - returns_of(runs, RULE)
    runs["score"] = runs["gain"] / runs["instance"].map(gap.where(gap >= GAP))
    return runs


def returns_of(runs: pd.DataFrame, agent: str) -> pd.Series:
    """Return the returns of an agent by instance, means over its trainings."""
    return runs[runs["agent"] == agent].groupby("instance")["return"].mean()


def tables_by_family(runs: pd.DataFrame, measure: str) -> list[Values]:
    """Return (n_trainings, n_instances) of one agent for each family.

    Instances without a value, or that a training hasn't played, are left out.
    """
    tables = []
    for _, own in runs.groupby("family", sort=True):
        table = own.pivot(index="training", columns="instance", values=measure).dropna(axis=1)
        if table.size:
            tables.append(table.to_numpy(float))
    return tables


def mean(values: Values) -> Values:
    """Return the mean along the last axis."""
    return np.asarray(values.mean(axis=-1))


def pooled(tables: Sequence[Values]) -> Values:
    """Return all values of all families, (n,)."""
    return np.concatenate([each.ravel() for each in tables])


def interval(
    tables: Sequence[Values], statistic: Callable[[Values], Values] = interquartile_mean
) -> Interval:
    """Return a statistic of all values, and the ends of its 95 % interval.

    tables: (n_trainings, n_instances) of each family, which may differ in their instances; of the
    trainings, only the first ones count that all families have. Not a number without values; a
    single instance has no interval.
    """
    if not tables:
        return np.nan, np.nan, np.nan
    n_trainings = min(map(len, tables))
    tables = [table[:n_trainings] for table in tables]
    value = float(statistic(pooled(tables)))
    if sum(table.shape[1] for table in tables) == 1:
        return value, np.nan, np.nan
    rng = np.random.default_rng(0)
    trainings = rng.integers(n_trainings, size=(REPLICAS, n_trainings, 1))
    drawn = []
    for table in _strata(tables):
        columns = rng.integers(table.shape[1], size=(REPLICAS, 1, table.shape[1]))
        drawn.append(table[trainings, columns].reshape(REPLICAS, -1))
    replicas = statistic(np.concatenate(drawn, axis=1))
    low, high = np.quantile(replicas, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return value, float(low), float(high)


def _strata(tables: Sequence[Values]) -> list[Values]:
    few = [table for table in tables if table.shape[1] < FEW]
    strata = [table for table in tables if table.shape[1] >= FEW]
    return [*strata, np.concatenate(few, axis=1)] if few else strata


def chances(runs: pd.DataFrame, agent: str, other: str) -> list[Values]:
    """Return how often an agent earns more than another one on the same instance.

    (n_trainings, n_instances) of each family: the share of the other's trainings that each of the
    agent's beats; equal returns count half. Their mean is the probability of improvement.
    """
    ours, theirs = (runs[runs["agent"] == name] for name in (agent, other))
    pairs = ours.merge(theirs, on=["family", "instance"], suffixes=("", "_other"))
    ahead = pairs["return"] - pairs["return_other"]
    pairs["better"] = np.where(ahead.abs() < EQUAL, 0.5, ahead > 0)
    means = pairs.groupby(["family", "training", "instance"], as_index=False)["better"].mean()
    return tables_by_family(means, "better")


def work_ratio(runs: pd.DataFrame, agent: str, other: str) -> float:
    """Return the mean work of an agent over that of another one, on flows that both have played.

    Not a number if there are none.
    """
    ours, theirs = (
        runs[runs["agent"] == name].groupby("instance")["work"].mean() for name in (agent, other)
    )
    both = ours.index.intersection(theirs.index)
    return float(ours[both].mean() / theirs[both].mean())


def hypervolume(work: Values, error: Values) -> Values:
    """Return the share of all trades of work against error that each run is at least as good as.

    It is the area between a run and WORST, over that between nothing and WORST.
    """
    sides = [
        np.clip(1 - each / worst, 0, 1) for each, worst in zip((work, error), WORST, strict=True)
    ]
    return np.asarray(sides[0] * sides[1])
