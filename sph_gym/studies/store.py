"""Finished runs on disk: whole or not there at all, and done again where they can't be read."""

import hashlib
import json
import os
import threading
import warnings
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import sph_gym


def digest(sources: Iterable[Path], key: Any) -> str:
    """Name of a result: a hash of the sources that it depends on and of what was computed."""
    found = hashlib.sha256()
    for path in sources:
        found.update(path.name.encode() + path.read_bytes())
    found.update(json.dumps(key).encode())
    return found.hexdigest()[:24]


@cache
def sources(*more: Path) -> tuple[Path, ...]:
    """The files that any run depends on, and some `more`."""
    root = Path(sph_gym.__file__).parent
    parts = ("solver", "scenes", "env", "controllers")
    found = [path for part in parts for path in sorted((root / part).glob("*.py"))]
    return (*found, *more)


def kept(path: Path, key: Any, compute: Callable[[], Any]) -> Any:
    """What `compute` returns, as JSON has it; from `path` if it was computed before.

    key: what was computed, for people who look into the file. Raises OSError that names the file
    if it can't be written.
    """
    stored = read(path)
    if stored is None:
        stored = json.loads(json.dumps({"key": key, "result": compute()}))
        write(path, stored)
    return stored["result"]


def read(path: Path) -> Any:
    """A stored object with a "result"; None if there is none or it is damaged."""
    try:
        stored = json.loads(path.read_text())
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        warnings.warn(f"{path} can't be read and is made anew: {error}", stacklevel=2)
        return None
    if not isinstance(stored, dict) or "result" not in stored:
        warnings.warn(f"{path} is no finished run and is made anew", stacklevel=2)
        return None
    return stored


def write(path: Path, stored: Any) -> None:
    """Store in one go, so that neither a kill nor a second process can leave half of it.

    Raises OSError that names the file.
    """
    draft = path.with_name(f"{path.name}.{os.getpid()}.{threading.get_ident()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft.write_text(json.dumps(stored))
        os.replace(draft, path)
    except OSError as error:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
        raise OSError(error.errno, f"can't be written: {error.strerror}", str(path)) from None
