"""Independent jobs over processes, with a progress bar; finished ones are kept and not repeated."""

import multiprocessing
import signal
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any

from sph_gym.extras import progress_bar
from sph_gym.solver.jit import announce_compilation
from sph_gym.solver.teams import most_threads
from sph_gym.studies.results import Results

# Exit status of a program that Ctrl-C has ended.
INTERRUPTED = 130


def run_jobs(
    function: Callable[..., Any],
    jobs: Sequence[tuple[Any, ...]],
    keys: Sequence[Any],
    results: Results,
    title: str,
) -> list[Any]:
    """Return `function(*job)` of every job, in their order, as JSON has it.

    keys: what identifies the result of each job; a result that is stored under its key is
    taken instead of running the job again, and each is stored as soon as it is there.
    Ctrl-C loses only what is in hand, and exits.
    """
    done = [results.load(key) for key in keys]
    missing = [k for k, result in enumerate(done) if result is None]
    n_workers = min(most_threads(), max(len(missing), 1))
    context = multiprocessing.get_context("spawn")
    with (
        progress_bar(len(jobs), title) as bar,
        ProcessPoolExecutor(n_workers, context, initializer=_begin_worker) as pool,
    ):
        bar.update(len(jobs) - len(missing))
        futures = {pool.submit(function, *jobs[k]): k for k in missing}
        try:
            for future in as_completed(futures):
                k = futures[future]
                done[k] = results.save(keys[k], future.result())
                bar.update()
        except BaseException as error:
            pool.shutdown(wait=False, cancel_futures=True)
            if isinstance(error, KeyboardInterrupt):
                print(f"\ninterrupted; what is done is kept in {results.folder}", file=sys.stderr)
                raise SystemExit(INTERRUPTED) from None
            raise
    return done


def _begin_worker() -> None:
    """Let a worker finish its job on Ctrl-C, and say when it compiles."""
    announce_compilation()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
