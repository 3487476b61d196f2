"""What of the points counts: lines of runs instead of single ones, at the machine's usual speed."""

import math
from collections.abc import Sequence

import numpy as np

from sph_gym.studies.accuracy import fronts, gains, trust
from sph_gym.studies.accuracy.plan import knobs, rungs
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.accuracy.problems import problem
from sph_gym.studies.accuracy.samples import whole
from sph_gym.studies.accuracy.settings import Setting


def sober(points: Sequence[Point]) -> list[Point]:
    """Those of a scene on lines, and no error smaller than that of finer runs of the same line.

    A line is one setting at several resolutions up to the finest of all, at none of which it blew
    up or was mush, and whose errors fall with dx. An error that crosses zero is tiny for a moment,
    which says nothing of its neighbours; hence the finest counts at least as what the others lead
    to expect. Where the scene's own errors don't fall, none counts less than the largest of them.
    """
    lines: dict[Setting, list[Point]] = {}
    for found in points:
        lines.setdefault(found.setting.line, []).append(found)
    finest = max((found.setting.across for found in points), default=0)
    floor = scatter(points)
    kept = {line: _errors(runs) for line, runs in lines.items() if _counts(runs, finest, floor > 0)}
    return [
        p._replace(error=max(kept[p.setting.line][p.setting.across], floor))
        for p in points
        if p.setting.line in kept
    ]


def scatter(points: Sequence[Point]) -> float:
    """The largest of a scene's own errors where they don't fall with dx, else 0."""
    own = [found for found in rungs(points) if found.good]
    return max(p.error for p in own) if len(own) > 1 and fronts.flat(own, "cost") else 0.0


def _counts(runs: Sequence[Point], finest: int, flat: bool) -> bool:
    if not whole([found.setting for found in runs], finest) or trust.mush(runs):
        return False
    return all(found.good for found in runs) and (flat or trust.falls(*_sorted(runs)))


def _sorted(runs: Sequence[Point]) -> tuple[trust.Array, trust.Array]:
    """(n,) particles across, coarse first, and errors."""
    found = np.array(sorted((run.setting.across, run.error) for run in runs), float)
    return found[:, 0], found[:, 1]


def _errors(runs: Sequence[Point]) -> dict[int, float]:
    """By particles across, what the errors of a line count as."""
    across, errors = _sorted(runs)
    counts = trust.counted(across, errors)
    return {int(n): float(error) for n, error in zip(across, counts, strict=True)}


def front(points: Sequence[Point], cost: str) -> list[Point]:
    """What no other setting beats in error and cost, luck apart, the cheapest first.

    None where the scene's own errors differ by chance: the least of them would win.
    """
    return [] if chance(points) else fronts.front(sober(points), cost)


def chance(points: Sequence[Point]) -> str:
    """What chance has to do with a scene's errors; nothing where they fall steadily with dx."""
    scene = problem(points[0].scene)
    if fronts.flat(rungs(points), "cost"):
        return "errors within scatter"
    return "errors partly chance" if scene.erratic or scene.order is None else ""


def headline(points: Sequence[Point], cost: str) -> fronts.Worth:
    """How many times faster the best setting is at equal error; NaN where chance decides.

    Of all lines and of single knobs, by the same measure; what is at most so doesn't count.
    """
    if chance(points):
        return fronts.Worth(math.nan)
    ladder = rungs(points)
    lines: dict[Setting, list[Point]] = {}
    for found in sober(points):
        lines.setdefault(found.setting.line, []).append(found)
    every = [gains.bounded(ladder, runs, cost) for runs in lines.values()]
    for knob in (name for name in knobs(points) if name != "resolution"):
        best = gains.best(points, knob, cost)
        every += [fronts.Worth(best.gain, best.bound)] if best is not None else []
    known = [worth for worth in every if math.isfinite(worth.gain) and worth.bound != "<"]
    return max(known, default=fronts.Worth(math.nan))


def at_usual_speed(points: Sequence[Point]) -> list[Point]:
    """The same with times as if the machine had always been as fast as it was in the median.

    Its speed is that of the benchmark beside each run; a machine that is shared changes it.
    """
    rates = [found.rate for found in points if math.isfinite(found.rate)]
    speed = float(np.median(rates)) if rates else math.nan
    return [found._replace(speed=speed) for found in points]
