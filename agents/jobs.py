"""Many independent runs over processes: with a progress bar, on disk as they come, resumable."""

import csv
import hashlib
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd
from tqdm import tqdm

import sph_gym

Row = dict[str, Any]
INTERRUPTED = 130


# What decides how an episode goes and what its row says, besides the package itself.
OWN_SOURCES = ("evaluate.py", "policies.py")
PACKAGE_SOURCES = ("**/*.py", "env/manifests/*", "scenes/data/*")


@cache
def code_version() -> str:
    """Hash of all that rows depend on: those that other code or other flows made are not reused."""
    digest = hashlib.sha256()
    for path in sources():
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def sources() -> list[Path]:
    """The files of the package, its manifests and references among them, and of the agents."""
    package, own = Path(sph_gym.__file__).parent, Path(__file__).parent
    found = [path for part in PACKAGE_SOURCES for path in package.glob(part) if path.is_file()]
    return sorted(found) + [own / name for name in OWN_SOURCES]


def cpu_count() -> int:
    """CPUs that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_jobs(
    function: Callable[..., Row],
    jobs: Sequence[tuple[Any, ...]],
    keys: Sequence[Row],
    path: Path,
    title: str,
    workers: int | None = None,
) -> pd.DataFrame:
    """Call `function(*job)` for every job and collect the rows, which also go to a CSV file.

    keys: for each job the columns that identify it; a row of the file with the same key and the
    same code version is taken instead of running the job again. Ctrl-C loses only what is in
    hand. Returns one row a job, in the order of the jobs.
    """
    done = _read(path)
    names = [_name(key) for key in keys]
    missing = [k for k, name in enumerate(names) if name not in done]
    if missing:
        _write(path, list(done.values()))
    context = multiprocessing.get_context("spawn")
    n_workers = min(workers or cpu_count(), max(len(missing), 1))
    with (
        tqdm(total=len(jobs), initial=len(jobs) - len(missing), desc=title, unit="run") as bar,
        ProcessPoolExecutor(n_workers, mp_context=context, initializer=_ignore_ctrl_c) as pool,
    ):
        futures = {pool.submit(function, *jobs[k]): k for k in missing}
        try:
            for future in as_completed(futures):
                k = futures[future]
                row = {"key": names[k], **keys[k], **future.result(), "code": code_version()}
                done[names[k]] = row
                _append(path, row)
                bar.update()
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            tqdm.write(f"interrupted; finished runs are kept in {path}", file=sys.stderr)
            raise SystemExit(INTERRUPTED) from None
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return pd.DataFrame([done[name] for name in names])


def _ignore_ctrl_c() -> None:
    """A worker ends the run in hand; the main process decides what comes after."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _name(key: Row) -> str:
    return "|".join(f"{name}={value}" for name, value in sorted(key.items()))


def _read(path: Path) -> dict[str, Row]:
    """Finished rows of this code version, by the name of their key."""
    if not path.exists():
        return {}
    with path.open(newline="", errors="replace") as file:
        lines = list(csv.DictReader(line.replace("\0", "") for line in file))
    # a line that was torn by a kill has no code version at its end
    current = (line for line in lines if line.get("code") == code_version() and "key" in line)
    return {line["key"]: {k: _value(text) for k, text in line.items()} for line in current}


def _value(text: str) -> int | float | str:
    """A cell as what it was before it was written; repr of a float is exact."""
    for kind in (int, float):
        try:
            return kind(text)
        except (TypeError, ValueError):
            continue
    return text


def _write(path: Path, rows: list[Row]) -> None:
    """Start the file anew with the rows that are still good."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_suffix(f".{os.getpid()}.tmp")
    draft.touch()
    for row in rows:
        _append(draft, row)
    os.replace(draft, path)


def _append(path: Path, row: Row) -> None:
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(row))
        if file.tell() == 0:
            writer.writeheader()
        writer.writerow(row)
