"""Parameters as plain data for JSON and back: dataclasses are objects with their "class"."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Called with the place of an array within the data, such as "scene/x", and the array.
Keep = Callable[[str, NDArray[Any]], Any]


def to_plain(value: Any, place: str, keep: Keep | None = None) -> Any:
    """Return nested parameters in the types of JSON.

    place: of `value` within the data; keep: returns what stands for an array, by default its
    numbers in nested lists, where infinity is the text "inf".
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        value = {"class": type(value).__name__} | parts
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    elif isinstance(value, np.ndarray) and value.dtype.kind in "biufc" and keep is not None:
        return keep(place, value)
    elif isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): to_plain(part, f"{place}/{key}", keep) for key, part in value.items()}
    if isinstance(value, (tuple, list)):
        return [to_plain(part, f"{place}/{k}", keep) for k, part in enumerate(value)]
    if isinstance(value, float) and keep is None and not math.isfinite(value):
        return str(value)
    return value if isinstance(value, (bool, int, float, str, type(None))) else repr(value)


def from_plain(name: str, data: Any, kinds: Mapping[str, type]) -> Any:
    """Return the dataclasses that `to_plain` made `data` from.

    name: of `data` in messages; kinds: dataclasses that may occur, by their names. Raises
    ValueError for objects of other classes, and for those with other fields.
    """
    if not isinstance(data, Mapping):
        return data
    kind = kinds.get(str(data.get("class")))
    if kind is None:
        raise ValueError(
            f"{name}.class: expected one of {', '.join(kinds)}, got {data.get('class')!r}"
        )
    wanted = [field.name for field in dataclasses.fields(kind)]
    wrong = {"class", *wanted} ^ set(data)
    if wrong:
        raise ValueError(
            f"{name}: expected a {kind.__name__} with {', '.join(wanted)}; missing or unknown: "
            f"{', '.join(sorted(map(str, wrong)))}"
        )
    return kind(**{part: from_plain(f"{name}.{part}", data[part], kinds) for part in wanted})
