"""What of the points counts: lines of runs instead of single ones, at the machine's usual speed."""

import math
from collections.abc import Sequence

import numpy as np

from sph_gym.studies.accuracy import fronts, gains
from sph_gym.studies.accuracy.plan import knobs, rungs
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.accuracy.problems import problem
from sph_gym.studies.accuracy.samples import whole
from sph_gym.studies.accuracy.settings import Setting


def sober(points: Sequence[Point]) -> list[Point]:
    """Those of a scene on lines, and no error smaller than that of finer runs of the same line.

    A line is one setting at several resolutions up to the finest of all, at none of which it blew
    up. An error that crosses zero is tiny for a moment, which says nothing of its neighbours; a
    run with nothing finer beside it can't be told from such a moment.
    """
    lines: dict[Setting, list[Point]] = {}
    for found in points:
        lines.setdefault(found.setting.line, []).append(found)
    finest = max((found.setting.across for found in points), default=0)
    kept = {line for line, runs in lines.items() if _counts(runs, finest)}
    return [_no_better(p, lines[p.setting.line]) for p in points if p.setting.line in kept]


def _counts(runs: Sequence[Point], finest: int) -> bool:
    return whole([found.setting for found in runs], finest) and all(found.good for found in runs)


def _no_better(found: Point, alike: Sequence[Point]) -> Point:
    finer = [other.error for other in alike if other.setting.across >= found.setting.across]
    return found._replace(error=max(finer))


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
