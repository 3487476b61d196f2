"""Independent jobs on a backend, with a progress bar; finished ones are kept and not repeated."""

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from typing import Any

from sph_gym.extras import progress_bar
from sph_gym.studies.backends import LOCAL, Backend, open_pool
from sph_gym.studies.results import Results

# Exit status of a program that Ctrl-C has ended.
INTERRUPTED = 130


def run_jobs(
    function: Callable[..., Any],
    jobs: Sequence[tuple[Any, ...]],
    keys: Sequence[Any],
    results: Results,
    title: str,
    backend: Backend = LOCAL,
) -> list[Any]:
    """Return `function(*job)` of every job, in their order, as JSON has it.

    keys: what identifies the result of each job; a result that is stored under its key is
    taken instead of running the job again, and each is stored as soon as it is there.
    Ctrl-C loses only what is in hand, and exits.
    """
    done = [results.load(key) for key in keys]
    missing = [k for k, result in enumerate(done) if result is None]
    if not missing:
        return done
    results.check_writable()
    try:
        with (
            progress_bar(len(jobs), title) as bar,
            open_pool(backend, len(missing)) as submit,
        ):
            bar.update(len(jobs) - len(missing))
            futures = {submit(function, *jobs[k]): k for k in missing}
            for future in as_completed(futures):
                k = futures[future]
                done[k] = results.save(keys[k], future.result())
                bar.update()
    except KeyboardInterrupt:
        print(f"\ninterrupted; what is done is kept in {results.folder}", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
    return done
