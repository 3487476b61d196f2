"""Where independent jobs run: processes of this machine, or a cluster of Ray or Dask.

On all of them a job whose worker dies runs again, on another worker, and nothing else is lost.
"""

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from sph_gym.extras import needs_extra
from sph_gym.solver.checks import known, whole
from sph_gym.solver.jit import announce_compilation
from sph_gym.solver.teams import most_threads
from sph_gym.studies import BACKENDS

# A job that has killed so many workers is given up.
ATTEMPTS = 3
# How long a scheduler of Dask may take to write its file [s].
PATIENCE = 60.0
# Ray's store of objects [bytes]: jobs and their results are small.
OBJECT_STORE = 80 * 2**20

# Ray reports its use to its makers, and makes its workers so nice that on a machine with other work
# they come to nothing.
RAY_SETTINGS = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_worker_niceness": "0"}

# (function, *arguments) -> the future of what it returns
Submit = Callable[..., "Future[Any]"]


class Backend(NamedTuple):
    """Where jobs run.

    name: one of BACKENDS; address: of a running cluster of Ray or Dask, or the .json file that a
    scheduler of Dask has written; None to start one on this machine for as long as the jobs take;
    workers: of what is started, None for one a processor.
    """

    name: str = "local"
    address: str | None = None
    workers: int | None = None

    def checked(self) -> "Backend":
        """Return this backend. Raises ValueError for an unknown name and for wrong options."""
        known("backend", self.name, BACKENDS)
        if self.address is not None and self.name == "local":
            raise ValueError(
                f"address: expected none with the backend 'local', got {self.address!r}"
            )
        if self.workers is not None:
            whole("workers", self.workers, at_least=1)
            if self.address is not None:
                raise ValueError(
                    f"workers: a cluster with an address has workers of its own, got {self.workers}"
                )
        return self


LOCAL = Backend()


@contextmanager
def open_pool(backend: Backend, most: int) -> Iterator[Submit]:
    """Yield a function that submits a job; what is not done when the block fails is dropped.

    most: how many workers can have something to do.
    Raises ValueError for wrong options, ImportError that names the extra to install, and OSError
    if there is no cluster at the address.
    """
    backend.checked()
    n_workers = max(min(backend.workers or most_threads(), most), 1)
    pool = dict(zip(BACKENDS, (_local, _ray, _dask), strict=True))[backend.name]
    with pool(backend.address, n_workers) as submit:
        yield submit


# --- Processes of this machine --------------------------------------------------------------


@contextmanager
def _local(address: str | None, n_workers: int) -> Iterator[Submit]:
    """Start one thread a worker, each with a process of its own.

    So a process that is killed takes no other with it: another one takes its place.
    """
    threads, own = ThreadPoolExecutor(n_workers), threading.local()
    context = multiprocessing.get_context("spawn")
    started: list[tuple[int, ProcessPoolExecutor]] = []
    closing = threading.Event()

    def run(function: Callable[..., Any], *arguments: Any) -> Any:
        for _ in range(ATTEMPTS):
            try:
                if getattr(own, "process", None) is None:
                    own.process = ProcessPoolExecutor(1, context, initializer=_begin_worker)
                    started.append((own.process.submit(os.getpid).result(), own.process))
                return own.process.submit(function, *arguments).result()
            except BrokenProcessPool as error:
                own.process, broken = None, error
                if closing.is_set():
                    # no crash: the process was ended below
                    break
        raise RuntimeError(f"a job has ended {ATTEMPTS} workers: {arguments!r}") from broken

    try:
        yield lambda *job: threads.submit(run, *job)
    finally:
        # what waits is dropped, and processes end whatever they do
        closing.set()
        threads.shutdown(wait=False, cancel_futures=True)
        for number, process in started:
            with suppress(ProcessLookupError):
                os.kill(number, signal.SIGTERM)
            process.shutdown(wait=True, cancel_futures=True)


def _begin_worker() -> None:
    """Leave Ctrl-C to the process that has started this one, and end when that has ended."""

    def follow_parent() -> None:
        parent = multiprocessing.parent_process()
        assert parent is not None
        parent.join()
        os._exit(1)

    announce_compilation()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=follow_parent, daemon=True).start()


# --- Clusters -------------------------------------------------------------------------------


@contextmanager
def _dask(address: str | None, n_workers: int) -> Iterator[Submit]:
    with needs_extra("cluster"):
        from distributed import Client
    if address is not None:
        is_file = address.endswith(".json")
        if is_file:
            _wait_for(Path(address))
        options: dict[str, Any] = {"scheduler_file" if is_file else "address": address}
    else:
        # without a page of its state, and without a limit of memory that none of our jobs reaches
        options = {"n_workers": n_workers, "threads_per_worker": 1, "memory_limit": 0}
        options |= {"dashboard_address": None}
    with Client(**options) as client:
        executor = client.get_executor(pure=False)
        try:
            yield executor.submit
        finally:
            # as a context manager it would wait for all that was submitted
            executor.shutdown(wait=False)


def _wait_for(file: Path) -> None:
    """Wait until a scheduler that is being started has written its file. OSError if it doesn't."""
    end = time.monotonic() + PATIENCE
    if not file.exists():
        print(f"waiting for the scheduler file {file}", file=sys.stderr, flush=True)
    while not file.exists():
        if time.monotonic() > end:
            raise FileNotFoundError(f"address: expected a file that a scheduler wrote, got {file}")
        time.sleep(0.1)


@contextmanager
def _ray(address: str | None, n_workers: int) -> Iterator[Submit]:
    for name, value in RAY_SETTINGS.items():
        os.environ.setdefault(name, value)
    with needs_extra("cluster"):
        import ray
    if address is not None:
        options: dict[str, Any] = {"address": address}
    else:
        options = {"address": "local", "num_cpus": n_workers, "include_dashboard": False}
        options |= {"object_store_memory": OBJECT_STORE}
    ray.init(**options, configure_logging=False, log_to_driver=False)
    job = ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1)(_call)
    try:
        yield lambda function, *arguments: job.remote(function, *arguments).future()
    finally:
        ray.shutdown()


def _call(function: Callable[..., Any], *arguments: Any) -> Any:
    return function(*arguments)
