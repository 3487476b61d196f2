"""The study: all points of all scenes, and what they say, as rows."""

import math
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.checks import known
from sph_gym.studies import store
from sph_gym.studies.accuracy import fronts, gains, peer, promises, tables
from sph_gym.studies.accuracy.luck import at_usual_speed, sober
from sph_gym.studies.accuracy.plan import (
    COMBINED,
    FULL,
    NUMBERS,
    QUICK,
    Plan,
    alone,
    knobs,
    ladder,
    lines,
    rungs,
    sizes,
    sweeps,
)
from sph_gym.studies.accuracy.points import Point, point
from sph_gym.studies.accuracy.problems import Problem, problem
from sph_gym.studies.accuracy.settings import Setting
from sph_gym.studies.peers import Peers
from sph_gym.studies.table import Row

FOLDER = Path("runs/studies")
TIME = "cost"
# Of the times of a point, over their median: the 90th of a hundred points, and the one between.
NOISE, USUAL_NOISE = 0.2, 0.1
# Seconds on the wall that a quick and a whole study may take.
PATIENCE = {True: 120.0, False: 5400.0}
# Runs of a point of which it isn't known yet whether it counts.
BRIEFLY = 2
# Lines that are run at all resolutions, usually.
USUAL_LINES = 8


class Shop(NamedTuple):
    """Where points come from: the folder, how often they are run, whether times are taken anew."""

    folder: Path
    repeats: int
    again: bool

    def buy(self, scene: Problem, knob: str, setting: Setting) -> Point:
        """A point."""
        return point(scene, knob, setting, self.folder, self.repeats, self.again)


def measure(
    quick: bool,
    folder: Path = FOLDER,
    chosen: Sequence[str] | None = None,
    again: bool = False,
    peers: Peers | None = None,
) -> Iterator[Row]:
    """Rows of every scene, with a progress bar; tables and pictures are written scene by scene.

    chosen: only these scenes; again: take all times anew (errors stay); peers: the folder of the
    script for PySPH and the Python that runs it. Finished runs are kept in `folder`/accuracy.
    Raises ImportError that names the extra to install, ValueError for unknown scenes, and OSError,
    before anything is run, for folders that can't be written to.
    """
    began = time.perf_counter()
    plan = QUICK if quick else FULL
    for name in chosen or ():
        known("scenes", name, plan.scenes)
    if peers is not None:
        peer.check(peers)
    shop = Shop(folder / "accuracy", plan.repeats, again)
    output = folder / ("accuracy_quick" if quick else "accuracy")
    for place in (shop.folder, output):
        store.probe(place)
    every, trials = list[Point](), list[promises.Trial]()
    wanted = list(chosen or plan.scenes)
    for k, name in enumerate(wanted, 1):
        scene = problem(name)
        points = collect(scene, plan, shop, f"{name}, scene {k} of {len(wanted)}")
        every += points
        yield from rows(scene, points)
        if plan.promises and not scene.erratic:
            trials += promises.tried(scene, points, shop.folder, again)
            yield from promises.rows(scene, [t for t in trials if t.found.scene == name])
        tables.write_scene(scene, points, output)
        tables.write_all(every, trials, output)
    if peers is not None:
        yield from peer.rows(peers, every, shop.folder, again)
    seconds = time.perf_counter() - began
    yield Row("duration of the study", "what was still to be run", seconds, "s", PATIENCE[quick])


def collect(scene: Problem, plan: Plan, shop: Shop, title: str = "") -> list[Point]:
    """All points of a scene: the nominal one first, then its sweeps, then combined settings."""
    turned = list(sweeps(plan, scene))
    with bar(title or scene.scene, len(turned) + USUAL_LINES * len(sizes(plan, scene))) as progress:

        def get(knob: str, setting: Setting, seller: Shop = shop) -> Point:
            found = seller.buy(scene, knob, setting)
            progress.update()
            return found

        # whether they count is only known afterwards
        once = shop._replace(repeats=min(shop.repeats, BRIEFLY))
        points = [get(knob, setting, once) for knob, setting in turned]
        have = {found.setting: found for found in points}

        def climb(line: Setting, seller: Shop) -> None:
            new = [setting for setting in ladder(plan, scene, line) if setting not in have]
            progress.total = max(progress.total, len(points) + len(new))
            for setting in new:
                have[setting] = get(COMBINED, setting, seller)
                points.append(have[setting])

        for line in lines(plan, scene, have):
            climb(line, shop)
        for line in alone(plan, scene, have):
            climb(line, once)
        return at_usual_speed(topped_up(scene, points, shop))


def topped_up(scene: Problem, points: Sequence[Point], shop: Shop) -> list[Point]:
    """The points of a scene, with as many runs of all that count as make a median."""
    counted = {found.key for found in (*sober(points), *rungs(points))}
    seller = shop._replace(again=False)
    return [
        seller.buy(scene, p.knob, p.setting) if p.key in counted and p.runs < shop.repeats else p
        for p in points
    ]


def bar(title: str, total: int) -> Any:
    """A progress bar. Raises ImportError that names the extra to install."""
    try:
        from tqdm import tqdm
    except ImportError:
        raise ImportError('studies need more: pip install "sph_gym[studies]"') from None
    return tqdm(total=total, desc=title, unit="run", file=sys.stderr, leave=False)


# --- What the points say --------------------------------------------------------------------


def rows(scene: Problem, points: Sequence[Point]) -> Iterator[Row]:
    """How the error converges, what each knob buys, and the cheapest settings."""
    yield Row("runs", scene.scene, len(points), "")
    yield Row("runs that blew up", scene.scene, sum(bool(p.cause) for p in points), "")
    yield Row("runs that differed when repeated", scene.scene, _differing(points), "", 0.0)
    yield from _times(scene, points)
    yield _order(scene, points)
    for knob in knobs(points):
        yield from _gains(scene, knob, points)
    for target in fronts.TARGETS:
        found = fronts.cheapest(sober(points), target, TIME)
        # infinite: it was not reached
        seconds = math.inf if found is None else found.time
        yield Row(f"cheapest with {100 * target:g} %, processor time", scene.scene, seconds, "s")


def _times(scene: Problem, points: Sequence[Point]) -> Iterator[Row]:
    """How steady the times are; a run that blew up has none."""
    timed = [found for found in points if found.runs > 1 and not found.cause]
    if not timed:
        return
    spreads = [found.spread for found in timed]
    for share, bound in ((0.5, USUAL_NOISE), (0.9, NOISE)):
        case = f"{scene.scene}, {100 * share:g} of 100 points"
        spread = float(np.quantile(spreads, share))
        yield Row("spread of repeated times / median", case, spread, "", bound)
    share = float(np.median([found.own / found.wall for found in timed]))
    yield Row("processor time / wall clock", scene.scene, share, "")
    yield Row("benchmark, median", scene.scene, timed[0].speed, "particle-steps/s")


def _differing(points: Sequence[Point]) -> float:
    return float(sum(found.differing for found in points))


def _order(scene: Problem, points: Sequence[Point]) -> Row:
    last = scene.until or scene.sizes[-1]
    good = [found for found in rungs(points) if found.good and found.setting.across <= last]
    value = fronts.order([found.dx for found in good], [found.error for found in good])
    return Row("order of convergence", scene.scene, value, "", scene.order, scene.order is not None)


def _gains(scene: Problem, knob: str, points: Sequence[Point]) -> Iterator[Row]:
    for cost, name in ((TIME, "time"), ("interactions", "pairs")) if knob in NUMBERS else ():
        value = gains.elasticity(points, knob, cost)
        if math.isfinite(value):
            yield Row(f"elasticity over {name}: {knob}", scene.scene, value, "")
    best = None if knob == "resolution" else gains.best(points, knob, TIME)
    if best is not None:
        case = f"{scene.scene}, {best.value}"
        yield Row(f"best gain at equal error: {knob}", case, best.gain, "times")
        yield Row(f"its error / nominal: {knob}", case, best.error_factor, "")
        yield Row(f"its time / nominal: {knob}", case, best.time_factor, "")
