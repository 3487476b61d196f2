"""Write files atomically: a file is complete or absent, whatever stops the writer."""

import csv
import os
import shutil
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

# Seconds after which a draft counts as abandoned by a writer that was killed.
ABANDONED = 3600.0


@contextmanager
def atomic_write(path: str | os.PathLike[str], make_folder: bool = True) -> Iterator[Path]:
    """Yield the path of a draft, which replaces `path` when the block ends without an error.

    The draft has the name of `path`, in a hidden folder beside it, so that writers which choose a
    format by the suffix work, and nothing that looks for such files finds it. Neither a kill nor
    a second process can leave half a file; an error leaves what was there. make_folder: whether a
    missing folder is created. Raises OSError that names the file if it cannot be written.
    """
    target = Path(path)
    folder = target.with_name(f".{target.name}.{os.getpid()}.{threading.get_ident()}.tmp")
    try:
        if make_folder:
            target.parent.mkdir(parents=True, exist_ok=True)
        _remove_abandoned_drafts(target)
        folder.mkdir()
        yield folder / target.name
        os.replace(folder / target.name, target)
    except OSError as error:
        reason = f"can't be written: {error.strerror or error}"
        raise OSError(error.errno, reason, str(target)) from None
    finally:
        # a full disk or Ctrl-C may leave a draft behind
        shutil.rmtree(folder, ignore_errors=True)


def write_csv(
    path: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]], comment: str = ""
) -> None:
    """Write a table, with a comment above it if there is one; make the folder if need be."""
    with atomic_write(path) as draft, draft.open("w", newline="") as file:
        file.write(f"# {comment}\n" if comment else "")
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(rows)


def _remove_abandoned_drafts(target: Path) -> None:
    for folder in target.parent.glob(f".{target.name}.*.tmp"):
        with suppress(OSError):
            if time.time() - folder.stat().st_mtime > ABANDONED:
                shutil.rmtree(folder, ignore_errors=True)
