"""Cost of backends: a sweep of runs of a second each, on this machine or on a cluster.

A run waits and does nothing else, so that what is above n / workers seconds is the backend's own.
"""

import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from sph_gym.studies import BACKENDS
from sph_gym.studies.backends import Backend
from sph_gym.studies.jobs import run_jobs
from sph_gym.studies.results import Results
from sph_gym.studies.table import Row

SECONDS = 1.0
# Workers of a backend that isn't told how many; runs, and those of a quick study.
WORKERS = 2
RUNS, QUICK_RUNS = 60, 12


def measure(quick: bool = False, backend: Backend | None = None) -> Iterator[Row]:
    """Yield the cost of a backend, by default of all three.

    Raises ValueError for the address of a cluster: its start counts, too, so it has to be new.
    """
    if backend is not None and backend.address is not None:
        raise ValueError(f"address: expected none, got {backend.address!r}")
    for each in map(Backend, BACKENDS) if backend is None else (backend,):
        yield from _sweep(each, QUICK_RUNS if quick else RUNS)


def _wait(number: int) -> float:
    time.sleep(SECONDS)
    return time.time()


def _sweep(backend: Backend, n_runs: int) -> list[Row]:
    """Return the time until the first results, which includes the start, and that from then on."""
    workers = backend.workers or WORKERS
    case, began = f"{backend.name}, {n_runs} runs, {workers} workers", time.time()
    with TemporaryDirectory() as folder:
        keys, store = list(range(n_runs)), Results(Path(folder))
        place = Backend(backend.name, workers=workers)
        ends = sorted(run_jobs(_wait, [(k,) for k in keys], keys, store, backend.name, place))
        over = time.time()
    # the first result of each worker comes with its start
    first = ends[workers - 1]
    ideal = SECONDS * (n_runs - workers) / workers
    return [
        Row("until the first results", case, first - began, "s"),
        Row("from then on", case, over - first, "s"),
        Row("more than the runs themselves", case, 100 * ((ends[-1] - first) / ideal - 1), "%"),
    ]
