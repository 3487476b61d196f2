"""Many small simulations at once: one compiled call per thread goes through a chunk of them."""

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver import stepping, teams
from sph_gym.solver.checks import whole
from sph_gym.solver.engine import Engine
from sph_gym.solver.model import DT
from sph_gym.solver.simulation import Report, Simulation


def advance_all(
    simulations: Iterable[Simulation], seconds: float, threads: int | None = None
) -> list[Report]:
    """Advance every simulation by `seconds`; the same as one after the other, to the last bit.

    threads: the most to use, by default the CPUs that the process may use. Returns the reports.
    Raises ValueError if one is no `Simulation` or is there twice, and for what `advance` refuses;
    after Ctrl-C each is left in a state to go on from.
    """
    sims = _checked(simulations)
    most = teams.most_threads() if threads is None else whole("threads", threads, at_least=1)
    for sim in sims:
        sim.begin(seconds)
    waiting = sorted(sims, key=_kind)
    while waiting:
        for _, alike in groupby(waiting, key=_kind):
            _run_chunks(list(alike), most)
        waiting = [sim for sim in waiting if sim.is_underway]
    return [sim.last_report for sim in sims]


def _checked(simulations: Iterable[Simulation]) -> list[Simulation]:
    # something else than a list counts as its only element, which is refused
    sims = list(simulations) if isinstance(simulations, Iterable) else [simulations]
    for sim in sims:
        if not isinstance(sim, Simulation):
            raise ValueError(f"simulations: expected Simulation objects, got {sim!r}")
    if len({id(sim) for sim in sims}) < len(sims):
        raise ValueError("simulations: expected every simulation once, got one of them twice")
    return sims


def _kind(sim: Simulation) -> str:
    return sim.engine.kind


def _run_chunks(sims: Sequence[Simulation], most: int) -> None:
    """Run one chunk of every simulation."""
    engines, chunks = [sim.engine for sim in sims], [sim.next_chunk() for sim in sims]
    try:
        _call(engines, chunks, most)
        done = [engine.finish(*chunk) for engine, chunk in zip(engines, chunks, strict=True)]
    except KeyboardInterrupt:
        for sim in sims:
            sim.interrupt()
        raise
    for sim, (steps, bad) in zip(sims, done, strict=True):
        sim.finish_chunk(steps, bad)


def _call(engines: Sequence[Engine], chunks: Sequence[tuple[float, float, int]], most: int) -> None:
    rows = np.array(
        [(engine.begin(1), time, n) for engine, (time, _, n) in zip(engines, chunks, strict=True)]
    )
    controls = np.concatenate([engine.controls for engine in engines])
    controls[:, DT] = [dt for _, dt, _ in chunks]
    worlds, models, *shapes = zip(*(engine.records() for engine in engines), strict=True)
    work = np.array([engine.n for engine in engines]) * rows[:, 2]
    with teams.borrow(min(most, len(engines))) as n_threads:
        teams.run(
            stepping.advance, n_threads, teams.make_team(), _bounds(work, n_threads),
            np.concatenate(worlds), np.concatenate(models), *(shape[0] for shape in shapes),
            rows, controls,
        )  # fmt: skip


def _bounds(work: NDArray[Any], n_threads: int) -> NDArray[np.int64]:
    """(n_threads + 1,) where each thread's simulations begin and end; work: (n,) of each.

    A simulation belongs to the thread in whose share of the work its middle lies.
    """
    middles = np.cumsum(work) - work / 2
    shares = np.arange(1, n_threads) * work.sum() / n_threads
    return np.array([0, *np.searchsorted(middles, shares), len(work)])
