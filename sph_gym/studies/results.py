"""The one store of finished runs: a JSON file each, named by a hash of what it depends on.

A result is complete or absent. What is damaged, or is the result of something else, is computed
again, with a warning. Studies are resumable because they look here first.
"""

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, get_origin

import numpy as np

from sph_gym.files import atomic_write, write_text
from sph_gym.provenance import content_hash, source_hash
from sph_gym.solver import jit

Result = TypeVar("Result")

# Every result depends on these parts of the package.
COMMON = ("solver", "scenes", "env", "controllers")


def _as_it_is(stored: Any) -> Any:
    return stored


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

    def load(self, key: Any, make: Callable[[Any], Any] = _as_it_is) -> Any:
        """Return what `make` makes of the stored result, which is as JSON has it.

        None if there is none, or if it is none that `make` takes.
        """
        path = self.path(key)
        try:
            stored = json.loads(path.read_text(encoding="utf-8"))
            if not isinstance(stored, dict) or stored.get("key") != _as_json(key):
                raise ValueError(f"it is no result of {key}")
            return make(stored["result"])
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError, ArithmeticError) as error:
            warnings.warn(f"{path} can't be read and is computed again: {error}", stacklevel=2)
            return None

    def save(self, key: Any, result: Any) -> Any:
        """Store a result and return it as JSON has it. Raises OSError that names the file."""
        stored = _as_json({"key": key, "result": result})
        write_text(self.path(key), json.dumps(stored))
        return stored["result"]

    def get(
        self,
        key: Any,
        compute: Callable[[], Any],
        make: Callable[[Any], Result] = _as_it_is,
        again: bool = False,
    ) -> Result:
        """Return the result of `key` as `load` does; `compute` it if there is none, or `again`."""
        stored: Result | None = None if again else self.load(key, make)
        return make(self.save(key, compute())) if stored is None else stored

    def check_writable(self) -> None:
        """Raise OSError that names the folder if nothing can be written into it."""
        try:
            with atomic_write(self.folder / "writable") as draft:
                draft.touch()
            (self.folder / "writable").unlink(missing_ok=True)
        except OSError as error:
            reason = f"can't be written to: {error.strerror or error}"
            raise OSError(error.errno, reason, str(self.folder)) from None


def as_record(kind: type[Result]) -> Callable[[Any], Result]:
    """Return what makes a `kind`, a NamedTuple, of its fields as JSON has them, or ValueError."""
    # JSON writes some floats as whole numbers, and takes True for a number of neither kind
    legal: dict[Any, set[Any]] = {float: {int, float}}
    types = [legal.get(own, {get_origin(own) or own}) for own in kind.__annotations__.values()]

    def make(stored: Any) -> Result:
        if not all(type(item) in own for item, own in zip(stored, types, strict=True)):
            raise ValueError(f"expected the fields of {kind.__name__}, got {stored}")
        return kind(*stored)

    return make


def _as_json(value: Any) -> Any:
    """Return what JSON gives back of a value; arrays are lists there."""
    return json.loads(json.dumps(value, default=np.ndarray.tolist))
