"""Cost of backends: `python -m sph_gym.studies.overhead` times a sweep of runs of a second each.

A run waits and does nothing else, so that what is above n / workers seconds is the backend's own.
"""

import argparse
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from sph_gym.studies.backends import NAMES, Backend
from sph_gym.studies.jobs import run_jobs
from sph_gym.studies.results import Results
from sph_gym.studies.table import Row, show

SECONDS = 1.0


def wait(number: int) -> float:
    """Wait, and return when that was over [s]."""
    time.sleep(SECONDS)
    return time.time()


def measure(name: str, n_jobs: int, workers: int) -> list[Row]:
    """Return the seconds until the first results, which include the start, and from then on."""
    case, began = f"{name}, {n_jobs} runs, {workers} workers", time.time()
    with TemporaryDirectory() as folder:
        jobs, keys = [(k,) for k in range(n_jobs)], list(range(n_jobs))
        ends = sorted(
            run_jobs(wait, jobs, keys, Results(Path(folder)), name, Backend(name, workers=workers))
        )
        over = time.time()
    # the first result of each worker comes with its start
    first = ends[workers - 1]
    ideal = SECONDS * (n_jobs - workers) / workers
    return [
        Row("until the first results", case, first - began, "s"),
        Row("from then on", case, over - first, "s"),
        Row("more than the runs themselves", case, 100 * ((ends[-1] - first) / ideal - 1), "%"),
    ]


def main() -> None:
    """Measure the backends that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--backends", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--output", type=Path, default=Path("runs/studies/overhead.csv"))
    options = parser.parse_args()
    rows = [
        row for name in options.backends for row in measure(name, options.runs, options.workers)
    ]
    show("overhead", rows, options.output)


if __name__ == "__main__":
    main()
