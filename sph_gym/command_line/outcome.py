"""Outcome of a command: an exit status, and data that a program can read."""

import json
import math
from typing import Any, NamedTuple

from sph_gym.files import atomic_write, target_path


class Outcome(NamedTuple):
    """Exit status, and what --json writes: dicts, lists, texts and numbers."""

    status: int = 0
    data: Any = None


def check_place(path: str) -> None:
    """Raise OSError that names --json if no file can be at a path; "-" is the standard output."""
    if target_path("--json", path).is_dir():
        raise IsADirectoryError(f"--json: expected a file, got the directory {path!r}")


def write_json(path: str, data: Any) -> None:
    """Write data as JSON to a file, or to the standard output if the path is "-".

    JSON has no numbers that aren't finite: they become null. Raises OSError that names the file.
    """
    text = json.dumps(_finite(data), indent=2)
    if path == "-":
        print(text)
        return
    with atomic_write(path, make_folder=False) as draft:
        draft.write_text(text + "\n", encoding="utf-8")


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {name: _finite(value) for name, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data
