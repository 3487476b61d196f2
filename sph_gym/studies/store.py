"""Finished runs on disk: whole or not there at all, and done again where they can't be read."""

import hashlib
import json
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import sph_gym
from sph_gym.files import atomic_write
from sph_gym.solver.jit import source_hash


def name(key: Any, *own: Path) -> str:
    """File name of a result: a hash of what was computed and of all sources that it depends on.

    own: the files of the study; those of the solver, of scenes and environments always count.
    """
    found = hashlib.sha256(_sources(own) + json.dumps(key).encode())
    return f"{found.hexdigest()[:24]}.json"


@cache
def _sources(own: tuple[Path, ...]) -> bytes:
    root = Path(sph_gym.__file__).parent
    parts = ("solver", "scenes", "env", "controllers")
    found = [path for part in parts for path in sorted((root / part).glob("*.py"))]
    everything = b"".join(path.name.encode() + path.read_bytes() for path in (*found, *own))
    # of the compiler, the interpreter and the processor
    return source_hash().encode() + hashlib.sha256(everything).digest()


def kept(
    path: Path,
    key: Any,
    compute: Callable[[], Any],
    fits: Callable[[Any], bool] = lambda result: True,
) -> Any:
    """What `compute` returns, as JSON has it; from `path` if it was computed before.

    key: what was computed, which a file must be of; fits: whether a result, as JSON has it, is
    one. What isn't is computed again, with a warning. Raises OSError that names the file if it
    can't be written.
    """
    stored = read(path)
    if stored is not None and not (_same(stored.get("key"), key) and fits(stored["result"])):
        warnings.warn(f"{path} is no run of {key} and is made anew", stacklevel=2)
        stored = None
    if stored is None:
        stored = json.loads(json.dumps({"key": key, "result": compute()}))
        write(path, stored)
    return stored["result"]


def _same(stored: Any, key: Any) -> bool:
    return bool(json.dumps(stored) == json.dumps(key))


def is_record(kind: Any) -> Callable[[Any], bool]:
    """Whether a result is a list of the fields of a NamedTuple of numbers and words."""
    # JSON writes some floats as whole numbers, and takes True for a number of neither kind
    legal: dict[Any, set[Any]] = {int: {int}, float: {int, float}, str: {str}}
    types = [legal[own] for own in kind.__annotations__.values()]

    def fits(result: Any) -> bool:
        if not isinstance(result, list) or len(result) != len(types):
            return False
        return all(type(item) in own for item, own in zip(result, types, strict=True))

    return fits


def probe(folder: Path) -> None:
    """Raise OSError that names the folder if nothing can be written into it."""
    try:
        write(folder / "writable.json", {})
        (folder / "writable.json").unlink(missing_ok=True)
    except OSError as error:
        raise OSError(error.errno, f"can't be written to: {error.strerror}", str(folder)) from None


def read(path: Path) -> Any:
    """A stored object with a "result"; None if there is none or it is damaged."""
    return content(path, lambda stored: "result" in stored)


def content(path: Path, fits: Callable[[dict[str, Any]], bool]) -> Any:
    """A stored object that fits; None if there is none or it is damaged, with a warning."""
    try:
        stored = json.loads(path.read_text())
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        warnings.warn(f"{path} can't be read and is made anew: {error}", stacklevel=3)
        return None
    if not isinstance(stored, dict) or not fits(stored):
        warnings.warn(f"{path} is no finished run and is made anew", stacklevel=3)
        return None
    return stored


def write(path: Path, stored: Any) -> None:
    """Store in one go, so that neither a kill nor a second process can leave half of it.

    Raises OSError that names the file.
    """
    with atomic_write(path) as draft:
        draft.write_text(json.dumps(stored))
