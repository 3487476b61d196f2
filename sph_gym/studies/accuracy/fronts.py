"""What runs say together: Pareto fronts, elasticities, orders, and what a knob buys."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

# Of d log cost / d log error along a resolution sweep. Errors that hardly fall (or not at all)
# are traded as if they fell with the square root of dx, where the cost goes as dx^-3.
STEEPEST, FLATTEST = -6.0, -1.0
# A knob that changes the time by less than this factor has no elasticity.
NOTICED = 1.2
# Of convergence: below it, errors differ by chance rather than by resolution.
LEAST_ORDER = 0.3
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


def trade(ladder: Sequence[Known], cost: str) -> float:
    """d log cost / d log error along a sweep of resolutions, within what is credible."""
    good = [run for run in ladder if run.good]
    slope = 1 / fit([getattr(run, cost) for run in good], [run.error for run in good]).slope
    if not slope < 0:
        return STEEPEST
    return min(max(slope, STEEPEST), FLATTEST)


def flat(ladder: Sequence[Known], cost: str) -> bool:
    """Whether errors hardly fall along a sweep of resolutions, the cost going as dx^-3."""
    good = [run for run in ladder if run.good]
    return is_flat([getattr(run, cost) for run in good], [run.error for run in good])


def is_flat(costs: Sequence[float], errors: Sequence[float]) -> bool:
    """The same of costs and errors."""
    return not -3 * fit(costs, errors).slope >= LEAST_ORDER


def worth(
    errors: tuple[float, float], costs: tuple[float, float], ladder: Sequence[Known], cost: str
) -> float:
    """How many times faster a run is than the nominal settings would be at its error.

    errors, costs: of the nominal settings and of the run, at one resolution; ladder: the nominal
    ones at all, which tell what the difference of the errors would have cost. Where they don't
    fall, errors within their scatter are equal.
    """
    ratio = errors[1] / errors[0]
    if flat(ladder, cost):
        ratio = max(errors[1] / max(run.error for run in ladder if run.good), 1.0)
    return float(ratio ** trade(ladder, cost) * costs[0] / costs[1])


def elasticity(runs: Sequence[Known], cost: str) -> float:
    """d log error / d log cost over the values of one knob; NaN where the cost hardly changes."""
    good = [run for run in runs if run.good]
    costs = [float(getattr(run, cost)) for run in good]
    if len(good) < 2 or max(costs) < NOTICED * min(costs):
        return math.nan
    return fit(costs, [run.error for run in good]).slope


def gain(start: Known, runs: Iterable[Known], cost: str) -> float:
    """Cost of a run / the least of those with at most its error; NaN without one."""
    if not start.good:
        return math.nan
    found = cheapest(runs, start.error, cost)
    return math.nan if found is None else float(getattr(start, cost) / getattr(found, cost))
