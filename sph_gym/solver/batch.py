"""Many small simulations at once: one compiled call per thread goes through a chunk of them.

A call from Python costs about as much as a step of some hundred particles, and while its arguments
are taken apart no other thread can do the same. So the arguments of all simulations are written
to records once, and the compiled loop reads them from there.
"""

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Any

import numba
import numpy as np

from sph_gym.solver import teams
from sph_gym.solver.checks import whole
from sph_gym.solver.engine import Engine
from sph_gym.solver.jit import jit
from sph_gym.solver.lanes import pack, record_size, unpack
from sph_gym.solver.simulation import Journey, Report, Simulation
from sph_gym.solver.stepping import advance


@jit
def _record_size(value):
    return record_size(value)


@jit
def _pack(record, value):
    pack(record, value)


@jit
def _advance_chunk(
    rank, n_threads, bounds, worlds, models, world, model, stale, time, dt, n_substeps
):
    """`stepping.advance` for the simulations bounds[rank] to bounds[rank + 1]."""
    for i in range(bounds[rank], bounds[rank + 1]):
        advance(
            0, 1, unpack(worlds, i, world), unpack(models, i, model),
            stale[i], time[i], dt[i], 0, n_substeps[i],
        )  # fmt: skip


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
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return [sim.advance(seconds) for sim in sims]
    waiting = [Journey(sim, seconds) for sim in sims]
    while waiting:
        waiting.sort(key=_kind)
        for _, alike in groupby(waiting, key=_kind):
            _legs(list(alike), most)
        waiting = [journey for journey in waiting if not journey.over]
    return [sim.last_report for sim in sims]


def _checked(simulations: Iterable[Simulation]) -> list[Simulation]:
    sims = list(simulations)
    for sim in sims:
        if not isinstance(sim, Simulation):
            raise ValueError(f"simulations: expected Simulation objects, got {sim!r}")
    if len({id(sim) for sim in sims}) < len(sims):
        raise ValueError("simulations: expected every simulation once, got one of them twice")
    return sims


def _kind(journey: Journey) -> str:
    return journey.sim.engine.kind


def _legs(journeys: Sequence[Journey], most: int) -> None:
    """One leg of every journey."""
    engines = [journey.sim.engine for journey in journeys]
    legs = [journey.next_leg() for journey in journeys]
    try:
        _run(engines, legs, most)
        done = [engine.finish(*leg) for engine, leg in zip(engines, legs, strict=True)]
    except KeyboardInterrupt:
        for journey in journeys:
            journey.interrupt()
        raise
    for journey, (steps, bad) in zip(journeys, done, strict=True):
        journey.book(steps, bad)


def _run(engines: Sequence[Engine], legs: Sequence[tuple[float, float, int]], most: int) -> None:
    stale = np.array([engine.begin(1) for engine in engines])
    worlds = np.stack([engine.record("world", _record) for engine in engines])
    models = np.stack([engine.record("model", _record) for engine in engines])
    time, dt, n_substeps = (np.array(column) for column in zip(*legs, strict=True))
    work = np.cumsum([len(engine.fluid.id) for engine in engines] * n_substeps)
    with teams.borrow(min(most, len(engines))) as n_threads:
        shares = np.arange(1, n_threads) * work[-1] / n_threads
        bounds = np.array([0, *np.searchsorted(work, shares), len(engines)])
        teams.run(
            _advance_chunk, n_threads, teams.make_team(), bounds, worlds, models,
            engines[0].world, engines[0].model,
            stale, time, dt.astype(engines[0].dtype), n_substeps,
        )  # fmt: skip


def _record(value: Any) -> Any:
    """`value` as bytes."""
    record = np.zeros(_record_size(value), np.uint8)
    _pack(record, value)
    return record
