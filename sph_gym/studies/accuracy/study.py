"""The study: all points of all scenes, and what they say, as rows."""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path

import numpy as np

from sph_gym.extras import progress_bar
from sph_gym.recommend.series import slope
from sph_gym.recommend.settings import Setting, is_agent, nominal
from sph_gym.scenes.shared.refinement import Refinement, refinement
from sph_gym.solver.checks import known
from sph_gym.studies.accuracy import analysis, figures, promises, pysph, tables
from sph_gym.studies.accuracy import plan as planning
from sph_gym.studies.accuracy.analysis import TIME
from sph_gym.studies.accuracy.plan import FULL, QUICK, StudyPlan
from sph_gym.studies.accuracy.points import Point, Sampling, key_of, measure_apart, measure_point
from sph_gym.studies.backends import Backend
from sph_gym.studies.jobs import run_jobs
from sph_gym.studies.peers import Peers
from sph_gym.studies.results import Results
from sph_gym.studies.table import Row

# Bounds of the spread of a point's times over their median: at the 90th of a hundred points, and at
# the one in the middle.
NOISE, USUAL_NOISE = 0.2, 0.1
# Seconds by the clock that a quick and a whole study may take.
PATIENCE = {True: 120.0, False: 5400.0}
# Runs of a point of which it isn't known yet whether it counts.
BRIEFLY = 2
# Series that are usually run at all resolutions.
USUAL_SERIES = 8

# Knob and setting of a point, and how it is measured.
Wanted = tuple[str, Setting, Sampling]


def measure(
    quick: bool,
    folder: Path,
    chosen: Sequence[str] | None = None,
    again: bool = False,
    peers: Peers | None = None,
    backend: Backend | None = None,
) -> Iterator[Row]:
    """Yield rows of every scene; tables and pictures are written scene by scene.

    chosen: only these scenes; again: take all times anew (errors stay); peers: the folder of the
    script for PySPH and the Python that runs it; backend: where most runs go, None for this
    process, whose times are the quietest. Finished runs are kept in `folder`/accuracy.
    Raises ImportError that names the extra to install, ValueError for unknown scenes, and OSError,
    before anything is run, for folders that can't be written to.
    """
    began = time.perf_counter()
    plan = QUICK if quick else FULL
    for name in chosen or ():
        known("scenes", name, plan.scenes)
    if peers is not None:
        peers.check(pysph.SCRIPT)
    sampling = Sampling(folder / "accuracy", plan.repeats, again)
    output = folder / ("accuracy_quick" if quick else "accuracy")
    for place in (sampling.folder, output):
        Results(place).check_writable()
    every, trials = list[Point](), list[promises.TriedRecommendation]()
    wanted = list(chosen or plan.scenes)
    if backend is not None:
        measure_ahead([refinement(name) for name in wanted], plan, sampling, backend)
    for k, name in enumerate(wanted, 1):
        case = refinement(name)
        points = collect(case, plan, sampling, f"{name}, scene {k} of {len(wanted)}")
        every += points
        yield from rows(case, points)
        if not case.erratic:
            new = promises.try_out(case, points, sampling)
            trials += new
            yield from promises.rows(case, new)
        tables.write_scene(points, output)
        tables.write_all(every, trials, output)
        print(f"plot: {figures.draw_scene(case, points, output / f'{name}.png')}")
        print(f"plot: {figures.draw_summary(every, output / 'summary.png')}")
    if peers is not None:
        yield from pysph.rows(peers, every, sampling.folder, again)
    seconds = time.perf_counter() - began
    yield Row("duration of the study", "what was still to be run", seconds, "s", PATIENCE[quick])


def collect(case: Refinement, plan: StudyPlan, sampling: Sampling, title: str = "") -> list[Point]:
    """Return all points of a scene: the nominal one first, then its sweeps, then combined ones."""
    n_turned, n_sizes = len(list(planning.sweeps(plan, case))), len(planning.sizes(plan, case))
    points: dict[Setting, Point] = {}
    with progress_bar(n_turned + USUAL_SERIES * n_sizes, title) as bar:
        for batch in batches(case, plan, sampling, points):
            for knob, setting, how in batch:
                if setting not in points:
                    points[setting] = measure_point(case, knob, setting, how)
                    bar.total = max(bar.total, len(points))
                    bar.update()
        return analysis.at_usual_speed(repeat_counted(case, list(points.values()), sampling))


def batches(
    case: Refinement, plan: StudyPlan, sampling: Sampling, points: Mapping[Setting, Point]
) -> Iterator[list[Wanted]]:
    """Yield the points of a scene, in batches that depend only on those before.

    points: to which those of a batch have been added when the next one is asked for.
    """
    # whether they count is only known afterwards
    once = sampling._replace(repeats=min(sampling.repeats, BRIEFLY))
    yield [(knob, setting, once) for knob, setting in planning.sweeps(plan, case)]
    for series in planning.combined(plan, case, points):
        at_sizes = planning.at_all_sizes(plan, case, series)
        yield [(analysis.COMBINED, setting, sampling) for setting in at_sizes]
    yield [
        (analysis.COMBINED, setting, once)
        for series in planning.alone(plan, case, points)
        for setting in planning.at_all_sizes(plan, case, series)
    ]


def measure_ahead(
    cases: Sequence[Refinement], plan: StudyPlan, sampling: Sampling, backend: Backend
) -> None:
    """Measure points of all scenes side by side on a backend, so that `collect` finds them.

    Points of agents, which play before anything is timed, are left to it; so are times that are
    taken anew.
    """
    kept = sampling._replace(again=False)
    store = kept.results("points", nominal(cases[0]))
    found = [(case, dict[Setting, Point]()) for case in cases]
    for step in zip_longest(*(batches(case, plan, kept, own) for case, own in found), fillvalue=[]):
        wanted = [
            (case, own, knob, setting, how)
            for (case, own), batch in zip(found, step, strict=True)
            for knob, setting, how in batch
            if not is_agent(setting.controller)
        ]
        jobs = [(case, setting, kept.repeats) for case, _, _, setting, _ in wanted]
        keys = [key_of(case, setting, 0) for case, setting, _ in jobs]
        run_jobs(measure_apart, jobs, keys, store, "points", backend)
        for case, own, knob, setting, how in wanted:
            own[setting] = measure_point(case, knob, setting, how)


def repeat_counted(case: Refinement, points: Sequence[Point], sampling: Sampling) -> list[Point]:
    """Return the points of a scene, with as many runs of all that count as make a median."""
    counted = {found.key for found in (*analysis.count(points), *analysis.nominal_series(points))}
    kept = sampling._replace(again=False)
    return [
        measure_point(case, p.knob, p.setting, kept)
        if p.key in counted and p.runs < sampling.repeats
        else p
        for p in points
    ]


def rows(case: Refinement, points: Sequence[Point]) -> Iterator[Row]:
    """Yield how the error converges, the gain of each knob, and the cheapest settings."""
    name = case.scene
    yield Row("runs", name, len(points), "")
    yield Row("runs that blew up", name, sum(bool(p.cause) for p in points), "")
    differing = float(sum(found.differing for found in points))
    yield Row("runs that differed when repeated", name, differing, "", 0.0)
    yield from _times(name, points)
    last = case.until or case.sizes[-1]
    good = [p for p in analysis.nominal_series(points) if p.good and p.setting.across <= last]
    order = slope([found.dx for found in good], [found.error for found in good])
    yield Row("order of convergence", name, order, "", case.order, case.order is not None)
    for knob in analysis.knobs(points):
        yield from _gains(name, knob, points)
    for target in analysis.TARGETS:
        found = analysis.cheapest(analysis.count(points), target)
        # infinite: it was not reached
        seconds = math.inf if found is None else found.time
        yield Row(f"cheapest with {100 * target:g} %, processor time", name, seconds, "s")


def _times(name: str, points: Sequence[Point]) -> Iterator[Row]:
    """Yield how steady the times are; a run that blew up has none."""
    timed = [found for found in points if found.runs > 1 and not found.cause]
    if not timed:
        return
    for share, bound in ((0.5, USUAL_NOISE), (0.9, NOISE)):
        case = f"{name}, {100 * share:g} of 100 points"
        spread = float(np.quantile([found.spread for found in timed], share))
        yield Row("spread of repeated times / median", case, spread, "", bound)
    share = float(np.median([found.own / found.wall for found in timed]))
    yield Row("processor time / wall clock", name, share, "")
    yield Row("benchmark, median", name, timed[0].speed, "particle-steps/s")


def _gains(name: str, knob: str, points: Sequence[Point]) -> Iterator[Row]:
    for cost, title in ((TIME, "time"), ("interactions", "pairs")):
        slope_of = analysis.knob_elasticity(points, knob, cost)
        if math.isfinite(slope_of):
            yield Row(f"elasticity over {title}: {knob}", name, slope_of, "")
    best = None if knob == "resolution" else analysis.best_value(points, knob, TIME)
    if best is not None:
        case = f"{name}, {best.value}"
        yield Row(f"best gain at equal error: {knob}", case, best.gain, "times")
        yield Row(f"its error / nominal: {knob}", case, best.error_factor, "")
        yield Row(f"its time / nominal: {knob}", case, best.time_factor, "")
