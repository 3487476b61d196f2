"""The one store of finished runs: a JSON file each, named by a hash of what it depends on.

A result is complete or absent. What is damaged, or is the result of something else, is computed
again, with a warning. Studies are resumable because they look here first.
"""

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_origin

import numpy as np

from sph_gym.files import atomic_write
from sph_gym.provenance import content_hash, source_hash
from sph_gym.solver import jit

# Every result depends on these parts of the package.
COMMON = ("solver", "scenes", "env", "controllers")


class Results:
    """Results of one study.

    folder: where the files are; sources: files or folders of the package that the results depend
    on besides the solver, scenes, environments and controllers, as "studies/soak.py".
    """

    def __init__(self, folder: Path, *sources: str, common: tuple[str, ...] = COMMON) -> None:
        self.folder = folder
        self._version = [jit.source_hash(), source_hash(*common, *sources)]

    def path(self, key: Any) -> Path:
        """Return the file of the result of `key`, any value that JSON can hold."""
        return self.folder / f"{content_hash(self._version, key)}.json"

    def load(self, key: Any, is_valid: Callable[[Any], bool] = lambda result: True) -> Any:
        """Return the stored result as JSON has it; None if there is none that is valid."""
        path = self.path(key)
        try:
            stored = json.loads(path.read_text())
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            warnings.warn(f"{path} can't be read and is computed again: {error}", stacklevel=2)
            return None
        is_result = isinstance(stored, dict) and stored.keys() == {"key", "result"}
        if not (is_result and stored["key"] == _as_json(key) and is_valid(stored["result"])):
            warnings.warn(f"{path} is no result of {key} and is computed again", stacklevel=2)
            return None
        return stored["result"]

    def save(self, key: Any, result: Any) -> Any:
        """Store a result and return it as JSON has it. Raises OSError that names the file."""
        stored = _as_json({"key": key, "result": result})
        with atomic_write(self.path(key)) as draft:
            draft.write_text(json.dumps(stored))
        return stored["result"]

    def get(
        self,
        key: Any,
        compute: Callable[[], Any],
        is_valid: Callable[[Any], bool] = lambda result: True,
    ) -> Any:
        """Return the result of `key`, as JSON has it; `compute` it if it is not stored."""
        stored = self.load(key, is_valid)
        return self.save(key, compute()) if stored is None else stored

    def check_writable(self) -> None:
        """Raise OSError that names the folder if nothing can be written into it."""
        try:
            with atomic_write(self.folder / "writable") as draft:
                draft.touch()
            (self.folder / "writable").unlink(missing_ok=True)
        except OSError as error:
            reason = f"can't be written to: {error.strerror or error}"
            raise OSError(error.errno, reason, str(self.folder)) from None


def is_record(kind: Any) -> Callable[[Any], bool]:
    """Return a check of whether stored JSON is the fields of `kind`, a NamedTuple, as a list."""
    # JSON writes some floats as whole numbers, and takes True for a number of neither kind
    legal: dict[Any, set[Any]] = {float: {int, float}}
    types = [legal.get(own, {get_origin(own) or own}) for own in kind.__annotations__.values()]

    def fits(result: Any) -> bool:
        if not isinstance(result, list) or len(result) != len(types):
            return False
        return all(type(item) in own for item, own in zip(result, types, strict=True))

    return fits


def _as_json(value: Any) -> Any:
    """Return what JSON gives back of a value; arrays are lists there."""
    return json.loads(json.dumps(value, default=np.ndarray.tolist))
