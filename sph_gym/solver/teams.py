"""Threads that run the same compiled call side by side and meet between its phases.

Every thread of a team works on its own share of the particles, and what a particle receives does
not depend on who computes it: results are bitwise the same for any number of threads. The extra
threads sleep while no call is running. Inside a call they wait busily for each other, since a
phase takes microseconds, but hand the processor over when it is needed elsewhere.
"""

import math
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

import numba
import numpy as np

from sph_gym.solver.jit import jitable
from sph_gym.solver.lanes import atomic_add, atomic_load, give_way

# Places in the array of a team, each in a cache line of its own.
ARRIVED, GENERATION, STOP = 0, 8, 16
# Looks at a flag before the processor is offered to others; a microsecond or so.
PATIENCE = 2000


@jitable
def share(n, rank, n_threads):
    """First and last-plus-one of the n things that are one thread's part."""
    return n * rank // n_threads, n * (rank + 1) // n_threads


@jitable
def meet(team, n_threads):
    """Wait until all threads of the team are here; False if they have been told to stop."""
    if n_threads == 1:
        return True
    generation = atomic_load(team, GENERATION)
    if atomic_add(team, ARRIVED, 1) == n_threads - 1:
        atomic_add(team, ARRIVED, -n_threads)
        atomic_add(team, GENERATION, 1)
        return True
    looks = 0
    while atomic_load(team, GENERATION) == generation:
        if atomic_load(team, STOP) != 0:
            return False
        looks += 1
        if looks > PATIENCE:
            give_way()
    return True


def make_team() -> Any:
    """The flags that a team shares."""
    return np.zeros(24, np.int64)


def most_threads() -> int:
    """CPUs that this process may use, and no more than NUMBA_NUM_THREADS."""
    config: Any = numba.config
    if config.DISABLE_JIT:
        return 1
    affinity = getattr(os, "sched_getaffinity", None)
    cpus = len(affinity(0)) if affinity else os.cpu_count() or 1
    return max(min(cpus, int(config.NUMBA_NUM_THREADS)), 1)


class Pace:
    """A judge of whether a team pays: on a busy machine its threads wait for a processor in turns.

    The number of threads changes no result, so it may follow the clock. The first call is made
    alone; when a team turns out slower, so are the next 1, 2, 4 ... calls.
    """

    LONGEST = 64

    def __init__(self) -> None:
        self._alone = math.inf
        self._penalty = self._left = 1

    def choose(self, most: int) -> int:
        """Number of threads for the next call."""
        if most > 1 and self._left == 0:
            return most
        return 1

    def note(self, n_threads: int, work: int, seconds: float) -> None:
        """Enter how long a call of so many particle-steps took."""
        if work == 0:
            return
        pace = seconds / work
        if n_threads == 1:
            self._alone = pace if self._left else min(pace, self._alone)
            self._left = max(self._left - 1, 0)
        elif pace > self._alone:
            self._left, self._penalty = self._penalty, min(2 * self._penalty, self.LONGEST)
        else:
            self._penalty = 1


class _Pool:
    """Sleeping threads, for one team at a time."""

    def __init__(self) -> None:
        self.free = threading.Lock()
        self._threads: ThreadPoolExecutor | None = None
        self._size = 0

    def submit(self, n: int, function: Callable[[int], None]) -> list[Any]:
        """Start function(rank) for the ranks 1 to n."""
        if self._threads is None or self._size < n:
            self._threads, self._size = ThreadPoolExecutor(n, "sph_gym"), n
        return [self._threads.submit(function, rank) for rank in range(1, n + 1)]


_pool = _Pool()


def _forget() -> None:
    global _pool
    _pool = _Pool()


if hasattr(os, "register_at_fork"):
    # a forked process inherits the pool, but none of its threads
    os.register_at_fork(after_in_child=_forget)


# For callers that want one thread: entered in every step of an environment.
_ALONE = nullcontext(1)


def borrow(n_threads: int) -> AbstractContextManager[int]:
    """Return the number of threads: n_threads, or one if another thread has the pool."""
    return _ALONE if n_threads == 1 else _borrow(n_threads)


@contextmanager
def _borrow(n_threads: int) -> Iterator[int]:
    if not _pool.free.acquire(blocking=False):
        yield 1
        return
    try:
        yield n_threads
    finally:
        _pool.free.release()


def run(function: Callable[..., Any], n_threads: int, team: Any, *arguments: Any) -> None:
    """function(rank, n_threads, *arguments) for all ranks, rank 0 in this thread.

    When one of them fails, or this thread is interrupted before it could begin, the others are
    told to stop.
    """
    if n_threads == 1:
        function(0, 1, *arguments)
        return

    def part(rank: int) -> None:
        try:
            function(rank, n_threads, *arguments)
        except BaseException:
            team[STOP] = 1
            raise

    team[:] = 0
    others = []
    try:
        others = _pool.submit(n_threads - 1, part)
        part(0)
    except BaseException:
        team[STOP] = 1
        raise
    finally:
        wait(others)
    for other in others:
        other.result()
