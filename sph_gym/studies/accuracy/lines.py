"""The lines that recommendations are made of: one choice of all knobs at several resolutions."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.studies.accuracy.fronts import is_flat
from sph_gym.studies.accuracy.gains import LONGEST
from sph_gym.studies.accuracy.policies import RULES
from sph_gym.studies.accuracy.problems import problem
from sph_gym.studies.accuracy.samples import Sample, whole
from sph_gym.studies.accuracy.settings import FIXED, Setting, nominal

Array = NDArray[np.float64]


class Line(NamedTuple):
    """One choice of the knobs at several resolutions.

    across, error, promised, effort: (n,) particles across, coarse first, the largest error that
    was measured there or at finer ones, what is promised, and the effort.
    """

    setting: Setting
    across: Array
    error: Array
    promised: Array
    effort: Array

    def at(self, across: int) -> "Choice":
        """Between the measured resolutions, on logarithmic scales."""
        x, known_at = math.log(across), np.log(self.across)
        error, promised, effort = (
            math.exp(float(np.interp(x, known_at, np.log(y))))
            for y in (self.error, self.promised, self.effort)
        )
        return Choice(self.setting._replace(across=across), error, promised, effort)

    def choices(self) -> "list[Choice]":
        """At every whole number of particles across."""
        return [self.at(n) for n in range(int(self.across[0]), int(self.across[-1]) + 1)]


class Choice(NamedTuple):
    """A setting, the error to expect, the one that is promised (at most), and the effort."""

    setting: Setting
    error: float
    promised: float
    effort: float


def fit(samples: Iterable[Sample]) -> list[Line]:
    """The lines of one scene that may be offered: known up to its finest resolution.

    None on which a run blew up, that needs an agent, or whose steps are near the limit. Where
    errors don't fall with dx, none promises or expects less than their scatter.
    """
    samples = list(samples)
    grouped: dict[Setting, list[Sample]] = {}
    for sample in samples:
        grouped.setdefault(sample.setting.line, []).append(sample)
    finest = max((s.setting.across for group in grouped.values() for s in group), default=0)
    found = [_line(group) for group in grouped.values() if _offered(group, finest)]
    floor = scatter(samples)
    return [
        line._replace(
            error=np.maximum(line.error, floor), promised=np.maximum(line.promised, floor)
        )
        for line in found
    ]


def scatter(samples: Sequence[Sample]) -> float:
    """Below which errors are chance, if they don't fall with dx: the largest nominal one; else 0.

    Also 0 without at least two nominal samples.
    """
    if not samples:
        return 0.0
    own = nominal(problem(samples[0].scene)).line
    errors, efforts = [], []
    for sample in samples:
        if sample.setting.line == own and sample.error > 0:
            errors.append(sample.error)
            efforts.append(sample.effort)
    return max(errors) if len(errors) > 1 and is_flat(efforts, errors) else 0.0


def _offered(group: Sequence[Sample], finest: int) -> bool:
    setting = group[0].setting
    safe = setting.controller in (FIXED, *RULES) and setting.step <= LONGEST
    known_up = whole([sample.setting for sample in group], finest)
    return safe and known_up and all(sample.error > 0 for sample in group)


def _line(group: Sequence[Sample]) -> Line:
    group = sorted(group, key=lambda sample: sample.setting.across)
    across = np.array([sample.setting.across for sample in group], float)
    errors = np.array([sample.error for sample in group])
    effort = np.array([sample.effort for sample in group])
    worst = envelope(errors)
    return Line(group[0].setting.line, across, worst, doubt(across, errors) * worst, effort)


def envelope(errors: Array) -> Array:
    """(n,) the largest error here and at all finer resolutions; coarse first."""
    return np.maximum.accumulate(errors[::-1])[::-1]


def doubt(across: Array, errors: Array) -> float:
    """The worst ratio of an inner error to what the others promise at its place; at least 1."""
    worst, x = 1.0, np.log(across)
    for k in range(1, len(errors) - 1):
        others = np.arange(len(errors)) != k
        expected = np.interp(x[k], x[others], np.log(envelope(errors[others])))
        worst = max(worst, float(errors[k] / math.exp(expected)))
    return worst
