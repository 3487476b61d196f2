"""Files that are whole or not there at all, whatever stops the writer."""

import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

# Seconds after which nobody is at work on a draft any more: its writer was killed.
ABANDONED = 3600.0


def write(path: Path, fill: Callable[[IO[bytes]], Any]) -> None:
    """Write in one go, so that neither a kill nor a second process can leave half a file.

    fill: writes the content to an open file. Raises OSError that names the file.
    """
    draft = path.with_name(f"{path.name}.{os.getpid()}.{threading.get_ident()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _sweep(path)
        with draft.open("wb") as file:
            fill(file)
        os.replace(draft, path)
    except OSError as error:
        reason = f"can't be written: {error.strerror or error}"
        raise OSError(error.errno, reason, str(path)) from None
    finally:
        # what is left of it on a full disk or after Ctrl-C
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def _sweep(path: Path) -> None:
    """Remove drafts of this file whose writers were killed."""
    for draft in path.parent.glob(f"{path.name}.*.tmp"):
        with suppress(OSError):
            if time.time() - draft.stat().st_mtime > ABANDONED:
                draft.unlink()
