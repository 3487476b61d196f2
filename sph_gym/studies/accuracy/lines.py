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
from sph_gym.studies.accuracy.trust import counted, doubt, falls, mush

Array = NDArray[np.float64]


class Line(NamedTuple):
    """One choice of the knobs at several resolutions.

    across, error, promised, effort, compression, mach: (n,) particles across, coarse first, the
    largest error that was measured there or at finer ones, what is promised, the effort, and how
    far the fluid is from an incompressible one. exact: particles across, and the error of what was
    run itself, which is promised without any doubt.
    """

    setting: Setting
    across: Array
    error: Array
    promised: Array
    effort: Array
    compression: Array
    mach: Array
    exact: tuple[tuple[int, float], ...] = ()

    def at(self, across: int) -> "Choice":
        """Between the measured resolutions, on logarithmic scales."""
        x, known_at = math.log(across), np.log(self.across)
        error, promised, effort = (
            math.exp(float(np.interp(x, known_at, np.log(y))))
            for y in (self.error, self.promised, self.effort)
        )
        promised = dict(self.exact).get(across, promised)
        soft = (float(np.interp(x, known_at, y)) for y in (self.compression, self.mach))
        return Choice(self.setting._replace(across=across), error, promised, effort, *soft)

    def choices(self) -> "list[Choice]":
        """At every whole number of particles across."""
        return [self.at(n) for n in range(int(self.across[0]), int(self.across[-1]) + 1)]


class Choice(NamedTuple):
    """A setting, the error to expect, the one that is promised (at most), and the effort.

    compression, mach: to expect, as of an `Outcome`.
    """

    setting: Setting
    error: float
    promised: float
    effort: float
    compression: float = 0.0
    mach: float = 0.0


def fit(samples: Iterable[Sample]) -> list[Line]:
    """The lines of one scene that may be offered: known up to its finest resolution.

    None on which a run blew up, that needs an agent, whose steps are near the limit, whose fluid
    is mush, or whose errors don't fall with dx. Where the scene's own errors don't fall, no line
    promises or expects less than their scatter.
    """
    samples = list(samples)
    grouped: dict[Setting, list[Sample]] = {}
    for sample in samples:
        grouped.setdefault(sample.setting.line, []).append(sample)
    finest = max((s.setting.across for group in grouped.values() for s in group), default=0)
    floor = scatter(samples)
    ordered = [sorted(group, key=lambda s: s.setting.across) for group in grouped.values()]
    found = [_line(group) for group in ordered if _offered(group, finest, floor > 0)]
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


def _offered(group: Sequence[Sample], finest: int, flat: bool) -> bool:
    """Whether a line may be; flat: whether the errors of its scene don't fall anyway."""
    setting = group[0].setting
    safe = setting.controller in (FIXED, *RULES) and setting.step <= LONGEST
    known_up = whole([sample.setting for sample in group], finest)
    if not (safe and known_up and all(sample.error > 0 for sample in group)):
        return False
    return not mush(group) and (flat or falls(*_errors(group)))


def _errors(group: Sequence[Sample]) -> tuple[Array, Array]:
    """(n,) particles across and errors."""
    across = np.array([sample.setting.across for sample in group], float)
    return across, np.array([sample.error for sample in group])


def _line(group: Sequence[Sample]) -> Line:
    across, errors = _errors(group)
    worst = counted(across, errors)
    effort, compression, mach = (
        np.array([getattr(sample, name) for sample in group])
        for name in ("effort", "compression", "mach")
    )
    promised = doubt(across, errors) * worst
    return Line(group[0].setting.line, across, worst, promised, effort, compression, mach)
