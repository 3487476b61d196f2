"""The folder of the cache, and files that are complete or absent, whatever stops the writer."""

import csv
import os
import shutil
import stat
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

# Seconds after which a draft counts as abandoned by a writer that was killed.
ABANDONED = 3600.0
# Name of the folder of the cache. Python imports any folder whose name is an identifier, and one
# that is called sph_gym would hide the package.
CACHE = "sph-gym"


def cache_home() -> Path:
    """Return the folder for all that can be recomputed.

    It is `SPH_GYM_CACHE`, else `sph-gym` in `XDG_CACHE_HOME` (`LOCALAPPDATA` on Windows), else
    `sph-gym` in ~/.cache (~/AppData/Local). Where that can't be written, it is a folder of the
    user's own among the temporary files, with a warning. Variables that are empty or hold a
    relative path count as unset.

    Source: XDG Base Directory Specification 0.8, "Environment variables".
    """
    if chosen := os.environ.get("SPH_GYM_CACHE"):
        if Path(chosen).is_absolute() and Path(chosen).name != __package__:
            return Path(chosen)
        warnings.warn(
            "SPH_GYM_CACHE: expected an absolute path that doesn't end with sph_gym, since Python "
            f"may take other folders for packages, got {chosen!r}; the usual folder is used",
            stacklevel=2,
        )
    on_windows = sys.platform == "win32"
    base = Path(os.environ.get("LOCALAPPDATA" if on_windows else "XDG_CACHE_HOME", ""))
    if not base.is_absolute():
        base = _home() / ("AppData/Local" if on_windows else ".cache")
    return base / CACHE if _can_be_written(base) else _temporary_cache()


def _home() -> Path:
    """Return the user's folder, a relative path if there is none."""
    if sys.platform != "win32" and not Path(os.environ.get("HOME", "")).is_absolute():
        import pwd

        with suppress(KeyError):
            return Path(pwd.getpwuid(os.getuid()).pw_dir)
    return Path(os.path.expanduser("~"))


def _can_be_written(folder: Path) -> bool:
    """Return whether files can be put into an absolute folder, which may be missing."""
    if not folder.is_absolute():
        return False
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)


@cache
def _temporary_cache() -> Path:
    """Return a folder of the user's own among the temporary files, and warn."""
    user = str(os.getuid()) if hasattr(os, "getuid") else "user"
    folder = Path(tempfile.gettempdir()) / f"{CACHE}-{user}"
    with suppress(OSError):
        folder.mkdir(mode=0o700)
    # the cache holds machine code: nobody else may have put it there
    if not _is_private(folder):
        folder = Path(tempfile.mkdtemp(prefix=f"{CACHE}-"))
    warnings.warn(
        f"the user's folder can't be written, the cache is in {folder}: set SPH_GYM_CACHE to a "
        "folder that stays, or the solver is compiled again when that is gone",
        stacklevel=3,
    )
    return folder


def _is_private(folder: Path) -> bool:
    """Return whether a folder is this user's, who alone can write it."""
    if not hasattr(os, "getuid"):
        return folder.is_dir()
    try:
        found = folder.lstat()
    except OSError:
        return False
    return (
        stat.S_ISDIR(found.st_mode)
        and found.st_uid == os.getuid()
        and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )


def target_path(
    name: str, path: str | os.PathLike[str], endings: Collection[str] | None = None
) -> Path:
    """Return the path of a file that is to be written; name: of the argument, for messages.

    Raises ValueError if it has none of the endings, FileNotFoundError if its folder is missing.
    """
    target = Path(path)
    if endings is not None and target.suffix.lower() not in endings:
        known = " or ".join(endings)
        raise ValueError(f"{name}: expected a name ending in {known}, got {str(path)!r}")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{name}: there is no directory {str(target.parent)!r}")
    return target


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


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file in UTF-8; make the folder if need be."""
    with atomic_write(path) as draft:
        draft.write_text(text, encoding="utf-8")


def write_csv(
    path: str | os.PathLike[str],
    columns: Sequence[str],
    rows: Iterable[Sequence[Any]],
    comment: str = "",
) -> None:
    """Write a table, with a comment above it if there is one; make the folder if need be."""
    with atomic_write(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        file.write(f"# {comment}\n" if comment else "")
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(rows)


def _remove_abandoned_drafts(target: Path) -> None:
    for folder in target.parent.glob(f".{target.name}.*.tmp"):
        with suppress(OSError):
            if time.time() - folder.stat().st_mtime > ABANDONED:
                shutil.rmtree(folder, ignore_errors=True)
