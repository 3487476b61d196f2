"""What runs say together: Pareto fronts, elasticities, orders, and what a knob buys."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from sph_gym.studies.accuracy.trust import LEAST_ORDER

# A knob that changes the cost by less than this factor has no elasticity: a slope over so short a
# way changes its sign with the noise.
NOTICED = 1.5
# Of errors that are equal.
ROUNDING = 1e-9
TARGETS = (0.05, 0.02, 0.01, 0.005)


class Known(Protocol):
    """What these functions need of a run."""

    @property
    def error(self) -> float:
        """A share."""

    @property
    def good(self) -> bool:
        """Whether the error is one."""


Run = TypeVar("Run", bound=Known)


class Fit(NamedTuple):
    """log y = intercept + slope log x."""

    intercept: float
    slope: float


def fit(x: Sequence[float], y: Sequence[float]) -> Fit:
    """The power law of least squares; NaN for less than two different x."""
    a, b = np.log(np.asarray(x, float)), np.log(np.asarray(y, float))
    if len(a) < 2 or np.ptp(a) < 1e-9:
        return Fit(math.nan, math.nan)
    slope, intercept = np.polyfit(a, b, 1)
    return Fit(float(intercept), float(slope))


def front(runs: Iterable[Run], cost: str) -> list[Run]:
    """Those that no other beats in both error and cost, the cheapest first."""
    best: list[Run] = []
    for run in sorted(runs, key=lambda run: (getattr(run, cost), run.error)):
        if run.good and (not best or run.error < best[-1].error):
            best.append(run)
    return best


def cheapest(runs: Iterable[Run], target: float, cost: str) -> Run | None:
    """The run with the least cost whose error is at most `target`; None if there is none."""
    within = [run for run in runs if run.good and run.error <= target]
    return min(within, key=lambda run: float(getattr(run, cost)), default=None)


def order(dx: Sequence[float], errors: Sequence[float]) -> float:
    """Of convergence: d log error / d log dx over all resolutions."""
    return fit(dx, errors).slope


def flat(ladder: Sequence[Known], cost: str) -> bool:
    """Whether errors hardly fall along a sweep of resolutions, the cost going as dx^-3."""
    good = [run for run in ladder if run.good]
    return is_flat([getattr(run, cost) for run in good], [run.error for run in good])


def is_flat(costs: Sequence[float], errors: Sequence[float]) -> bool:
    """The same of costs and errors."""
    return not -3 * fit(costs, errors).slope >= LEAST_ORDER


class Worth(NamedTuple):
    """How many times faster at equal error; bound: ">" or "<" where it is at least or at most so.

    "" where it was interpolated between measured runs.
    """

    gain: float
    bound: str = ""


def worth(
    errors: tuple[float, float], costs: tuple[float, float], ladder: Sequence[Known], cost: str
) -> Worth:
    """How many times faster a run is than the nominal settings would be at its error.

    errors, costs: of the nominal settings and of the run, at one resolution; ladder: the nominal
    ones at all, coarse to fine by their cost, between which it is interpolated; beyond their
    errors there is only a bound. Where they don't fall, errors within their scatter are equal.
    """
    good = sorted((run for run in ladder if run.good), key=lambda run: float(getattr(run, cost)))
    own = [float(getattr(run, cost)) for run in good]
    if flat(ladder, cost):
        within = errors[1] <= max(run.error for run in good)
        return Worth(costs[0] / costs[1]) if within else Worth(own[0] / costs[1], "<")
    found = price([run.error for run in good], own, errors[1])
    return Worth(found.gain / costs[1], found.bound)


def price(errors: Sequence[float], costs: Sequence[float], error: float) -> Worth:
    """What a sweep of resolutions costs at an error, on log scales; bound as of the cost.

    errors, costs: coarse first. An error counts as much as those of finer runs.
    """
    worst = np.maximum.accumulate(np.asarray(errors, float)[::-1])[::-1]
    if error >= worst[0] * (1 - ROUNDING):
        return Worth(costs[0], "<" if error > worst[0] * (1 + ROUNDING) else "")
    reached = np.flatnonzero(worst <= error * (1 + ROUNDING))
    if not len(reached):
        return Worth(costs[-1], ">")
    k = int(reached[0])
    share = math.log(worst[k - 1] / error) / math.log(worst[k - 1] / worst[k])
    return Worth(costs[k - 1] * (costs[k] / costs[k - 1]) ** min(share, 1.0))


def elasticity(runs: Sequence[Known], cost: str) -> float:
    """d log error / d log cost over the values of one knob; NaN where the cost hardly changes."""
    good = [run for run in runs if run.good]
    costs = [float(getattr(run, cost)) for run in good]
    if len(good) < 2 or max(costs) < NOTICED * min(costs):
        return math.nan
    return fit(costs, [run.error for run in good]).slope
