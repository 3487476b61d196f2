"""Refinement series: one setting at several resolutions, and what its errors are worth.

Between two resolutions error and effort are interpolated on logarithmic scales. An error counts as
much as the largest at this and all finer resolutions, and that of the finest run at least as much
as the others lead to expect: an error that crosses zero is tiny for a moment, which says nothing of
its neighbours. What is promised is that, times what the series would have been wrong by about any
of its inner errors had that one been missing. Where a scene's own errors don't fall with dx, they
are noise, and nothing counts less than the largest of them: the noise floor.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from sph_gym.recommend.settings import LONGEST, Setting, is_agent

Array = NDArray[np.float64]

# An error above this is none: 1000 %.
ABSURD = 10.0
# Resolutions that a series has at least.
FEWEST = 3
# Least order of convergence in dx: below it, errors differ by chance rather than by resolution.
LEAST_ORDER = 0.3
# Least order over the finest few sizes: below it, errors have come to rest or begin to grow.
STILL_FALLING = 0.1
# Highest order of convergence in dx with which errors are expected to go on falling.
MOST_ORDER = 2.0
# Resolutions at the fine end that tell how errors go on there.
RECENT = 3
# Bounds of the compression and the Mach number of a `RunOutcome`: a fluid that is squeezed or
# hurried more is another one, whatever its error.
MOST_COMPRESSION, MOST_MACH = 0.02, 0.35


@dataclass(frozen=True)
class MeasuredRun:
    """One run of a series.

    error: a share, NaN after a blow-up; effort: particle-steps of the benchmark that take as long;
    compression, mach: as of a `RunOutcome`.
    """

    scene: str
    setting: Setting
    error: float
    effort: float
    compression: float = 0.0
    mach: float = 0.0

    @property
    def good(self) -> bool:
        """Return whether it came to its end with an error worth the name."""
        return 0 < self.error < ABSURD


AnyRun = TypeVar("AnyRun", bound=MeasuredRun)


# --- Errors over resolutions ----------------------------------------------------------------


def slope(x: Array | Sequence[float], y: Array | Sequence[float]) -> float:
    """Return d log y / d log x by least squares; NaN for less than two different x."""
    a, b = np.log(np.asarray(x, float)), np.log(np.asarray(y, float))
    if len(a) < 2 or np.ptp(a) < 1e-9:
        return math.nan
    return float(np.polyfit(a, b, 1)[0])


def envelope(errors: Array | Sequence[float]) -> Array:
    """Return (n,) the largest error here and at all finer resolutions; coarse first."""
    return np.maximum.accumulate(np.asarray(errors, float)[::-1])[::-1]


def raised(across: Array, errors: Array) -> Array:
    """Return (n,) the errors, the finest raised to what the others lead to expect there.

    That is their power law over the finest few, of an order between 0 and `MOST_ORDER`.
    """
    found = np.array(errors, float)
    if len(found) > 1:
        recent = slice(-RECENT - 1, -1)
        x, y = np.log(across[recent]), np.log(found[recent])
        fitted = slope(across[recent], found[recent]) if len(x) > 1 else 0.0
        steep = min(max(fitted, -MOST_ORDER), 0.0)
        expected = float(np.exp(y.mean() + steep * (np.log(float(across[-1])) - x.mean())))
        found[-1] = max(found[-1], expected)
    return found


def doubt(across: Array, errors: Array) -> float:
    """Return the worst ratio of an inner error to what the others promise there; at least 1."""
    worst, x, known = 1.0, np.log(across), raised(across, errors)
    for k in range(1, len(known) - 1):
        others = np.arange(len(known)) != k
        promised = np.interp(x[k], x[others], np.log(envelope(known[others])))
        worst = max(worst, float(known[k] / np.exp(promised)))
    return worst


def falls(across: Array, errors: Array) -> bool:
    """Return whether errors fall with dx, over all resolutions and still over the finest few.

    Each counts as much as those of finer runs, so that a lucky one doesn't tilt the rest.
    """
    worst, fine = envelope(errors), slice(-RECENT, None)
    return (
        slope(across, worst) <= -LEAST_ORDER and slope(across[fine], worst[fine]) <= -STILL_FALLING
    )


def is_flat(costs: Sequence[float], errors: Sequence[float]) -> bool:
    """Return whether errors hardly fall over resolutions, the cost going as dx^-3."""
    return not -3 * slope(costs, errors) >= LEAST_ORDER


def noise_floor(own: Iterable[MeasuredRun]) -> float:
    """Return the largest error of a scene's own settings where they don't fall with dx, else 0."""
    good = [run for run in own if run.good]
    errors = [run.error for run in good]
    flat = len(good) > 1 and is_flat([run.effort for run in good], errors)
    return max(errors) if flat else 0.0


# --- Series ---------------------------------------------------------------------------------


class Choice(NamedTuple):
    """A setting, the error to expect, the one that is promised (at most), and the effort.

    compression, mach: to expect, as of a `RunOutcome`.
    """

    setting: Setting
    error: float
    promised: float
    effort: float
    compression: float = 0.0
    mach: float = 0.0


class Series(NamedTuple):
    """One setting at several resolutions.

    across, error, promised, effort, compression, mach: (n,) particles across, coarse first, what
    the error counts as, what is promised, the effort, and how far the fluid is from an
    incompressible one. exact: particles across, and the error of runs of the very case, which is
    promised without any doubt.
    """

    setting: Setting
    across: Array
    error: Array
    promised: Array
    effort: Array
    compression: Array
    mach: Array
    exact: tuple[tuple[int, float], ...] = ()

    def at(self, across: int) -> Choice:
        """Return what to expect between the measured resolutions."""
        x, known_at = math.log(across), np.log(self.across)
        error, promised, effort = (
            math.exp(float(np.interp(x, known_at, np.log(y))))
            for y in (self.error, self.promised, self.effort)
        )
        promised = dict(self.exact).get(across, promised)
        soft = (float(np.interp(x, known_at, y)) for y in (self.compression, self.mach))
        return Choice(self.setting._replace(across=across), error, promised, effort, *soft)

    def choices(self) -> list[Choice]:
        """Return what to expect at every whole number of particles across."""
        return [self.at(n) for n in range(int(self.across[0]), int(self.across[-1]) + 1)]

    @property
    def safe(self) -> bool:
        """Return whether it may be recommended: no agent, and no step near the limit."""
        return not is_agent(self.setting.controller) and self.setting.step <= LONGEST


def group(runs: Iterable[AnyRun]) -> dict[Setting, list[AnyRun]]:
    """Return the runs of each series, coarse first, under its setting at no resolution."""
    found: dict[Setting, list[AnyRun]] = {}
    for run in runs:
        found.setdefault(run.setting.series, []).append(run)
    return {own: sorted(s, key=lambda run: run.setting.across) for own, s in found.items()}


def fit(runs: Iterable[MeasuredRun], floor: float) -> dict[Setting, Series]:
    """Return the series of one scene that count, under their settings at no resolution.

    None on which a run failed, that ends before the finest resolution of the scene, whose fluid is
    too soft, or whose errors don't fall with dx, unless the scene's own don't either.
    floor: the scene's `noise_floor`, below which no error counts.
    """
    grouped = group(runs)
    finest = max((s[-1].setting.across for s in grouped.values()), default=0)
    return {
        own: _series(own, s, floor)
        for own, s in grouped.items()
        if s[-1].setting.across >= finest
        and len(s) >= FEWEST
        and all(run.good for run in s)
        and not too_soft(s)
        and (floor > 0 or falls(*errors_of(s)))
    }


def too_soft(runs: Iterable[MeasuredRun]) -> bool:
    """Return whether the fluid of any run is too compressible for what happens to it."""
    return any(run.compression > MOST_COMPRESSION or run.mach > MOST_MACH for run in runs)


def errors_of(runs: Iterable[MeasuredRun]) -> tuple[Array, Array]:
    """Return (n,) particles across, coarse first, and errors."""
    found = np.array(sorted((run.setting.across, run.error) for run in runs), float)
    return found[:, 0], found[:, 1]


def _series(own: Setting, runs: Sequence[MeasuredRun], floor: float) -> Series:
    across, errors = errors_of(runs)
    counted = envelope(raised(across, errors))
    promised = doubt(across, errors) * counted
    effort, compression, mach = (
        np.array([getattr(run, name) for run in runs]) for name in ("effort", "compression", "mach")
    )
    counted, promised = np.maximum(counted, floor), np.maximum(promised, floor)
    return Series(own, across, counted, promised, effort, compression, mach)
