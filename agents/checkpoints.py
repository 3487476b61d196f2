"""Checkpoints of Stable-Baselines3 that were written to their end."""

import sys
import zipfile
import zlib
from pathlib import Path


def newest_checkpoint(folder: Path) -> Path:
    """Return the newest checkpoint that was written to its end.

    Raises FileNotFoundError if there is none.
    """
    found = sorted((folder / "checkpoints").glob("*.zip"), key=lambda file: file.stat().st_mtime)
    for file in reversed(found):
        if _is_complete(file):
            return file
        print(f"damaged, and left out: {file}", file=sys.stderr)
    raise FileNotFoundError(f"nothing to resume: no checkpoints in {folder / 'checkpoints'}")


def _is_complete(path: Path) -> bool:
    """Return whether the file of a model was written to its end; nothing in it is unpickled."""
    try:
        with zipfile.ZipFile(path) as archive:
            # torn within one of the archives that it holds, it ends like a complete one
            return "data" in archive.namelist() and archive.testzip() is None
    except (OSError, zipfile.BadZipFile, zlib.error):
        return False
