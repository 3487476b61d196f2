"""Time that can be compared: runs side by side, in turns, on one core."""

import ctypes
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation

# Steps before anything is timed: lists have grown, the caches are filled.
WARM_UP = 30
# Particle-steps of one timed call: long against the clock and against the call itself.
WORK = 400_000


@contextmanager
def pinned(threads: int = 1, here: bool = False) -> Iterator[None]:
    """Keep this thread, and what it starts, on one core, where the system lets it; 1 thread only.

    here: on the core where it is, so that processes side by side are not all kept on the first one.
    The core is put back afterwards. With several threads nothing is done.
    """
    if threads > 1 or not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    core = ctypes.CDLL(None).sched_getcpu() if here else min(before)
    os.sched_setaffinity(0, {core})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


class Runner:
    """A simulation that can be timed, a call of the compiled step at a time.

    work: particle-steps of one call. `home` is a state of the engine from which every timed call
    sets out, so that fluids which move differently can be compared; None: each goes on.
    """

    def __init__(
        self, scene: Scene, dtype: str = "float64", threads: int = 1, work: int = WORK
    ) -> None:
        self.sim = Simulation(scene, dtype, threads=threads)
        self.threads = threads
        self.n_steps = max(work // self.sim.n_fluid, 4)
        self.home: dict[str, Any] | None = None
        self._now = 0.0
        # not pinned: threads that the pool starts now would stay on this one's core for ever
        self._run(max(WARM_UP, self.n_steps))

    def _run(self, n_steps: int) -> None:
        dt = self.sim.controls.dt
        steps, bad = self.sim.engine.run(self._now, dt, n_steps)
        if bad >= 0:
            raise RuntimeError(f"{self.sim.scene.name} blew up in step {steps} of a measurement")
        self._now += n_steps * dt

    def seconds(self, clock: Callable[[], float] = time.perf_counter) -> float:
        """Time of one step [s], the mean of a call; one thread is kept on one core."""
        with pinned(self.threads):
            if self.home is not None:
                self.sim.engine.set_state(self.home, 0.0)
            return clocked(lambda: self._run(self.n_steps), clock) / self.n_steps

    def bytes(self) -> int:
        """Size of all arrays that the running simulation holds."""
        return _size(self.sim.engine.world)


def _size(part: Any) -> int:
    if isinstance(part, np.ndarray):
        return part.nbytes
    return sum(map(_size, part)) if isinstance(part, tuple) else 0


def same_home(runners: Sequence[Runner]) -> None:
    """Let all set out from the present state of the first."""
    for runner in runners:
        runner.home = runners[0].sim.engine.state()


def in_turns(runs: Sequence[Callable[[], float]], rounds: int) -> NDArray[np.float64]:
    """(rounds, n_runs) what the runs give, one after the other in every round, to and fro."""
    results = np.empty((rounds, len(runs)))
    for k in range(rounds):
        order = range(len(runs)) if k % 2 == 0 else reversed(range(len(runs)))
        for run in order:
            results[k, run] = runs[run]()
    return results


def clocked(
    function: Callable[[], object], clock: Callable[[], float] = time.perf_counter
) -> float:
    """Return how long a call takes [s]."""
    began = clock()
    function()
    return clock() - began


def own_clock() -> Callable[[], float]:
    """Seconds that this thread has had a core for, where the system counts them finely enough.

    For small differences: what else the machine does meanwhile doesn't count.
    """
    fine = time.get_clock_info("thread_time").resolution <= 1e-6
    return time.thread_time if fine else time.perf_counter


def nanoseconds(seconds: Any, n: int) -> float:
    """Median of times [s] for n particles as ns for one."""
    return float(np.median(seconds)) / n * 1e9
