"""Arguments of compiled calls as records: taken apart once, and not again in every call.

To take nested tuples of arrays apart costs as much as a step of some hundred particles, and no
other thread can do the same meanwhile. So they are written to records, rows of bytes, from which
compiled code reads them, one or many. Without compiling, a record is the value itself.
"""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from sph_gym.solver.jit import jit
from sph_gym.solver.lanes import Shape, pack, record_size


@jit
def _record_size(value):
    return record_size(value)


@jit
def _pack(record, value):
    pack(record, value)


def _numbers(values: Any, dtype: Any) -> Any:
    """(n,) in that precision, infinite where they are beyond it."""
    if dtype is np.float64:
        return np.array(values)
    with np.errstate(over="ignore"):
        return np.array(values, dtype)


class Kept:
    """The record of what a value is at present.

    rows: (1, n_bytes), good as long as the arrays that the value was made of live; shape: what
    compiled code has to know to read it. All values must be of one type.
    """

    def __init__(self) -> None:
        self._value: Any = None
        self.rows: Any = None
        self.shape: Any = None
        self._size = 0
        self._places: Any = None

    def __reduce__(self) -> Any:
        # a record holds addresses of arrays, and a copy has arrays of its own
        return Kept, ()

    def follow(self, value: Any) -> "Kept":
        """Make sure that it is the record of `value`."""
        if value is not self._value:
            self._write(value)
            self._value = value
        return self

    def follow_numbers(self, numbers: Any, dtype: Any, value: Callable[[Any], Any]) -> "Kept":
        """Make sure that it is the record of `value(numbers)`.

        numbers: a named tuple; nothing else of the value may ever change. They are written over
        the last ones, each to its place, which costs a tenth of packing the value again.
        """
        if numbers == self._value:
            return self
        if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
            self._write(value(numbers))
        else:
            if self._places is None:
                self._find(type(numbers), dtype, value)
            used, places = self._places
            # another array every time, see `_write`
            self.rows = self.rows.copy()
            self.rows[0, places] = _numbers([numbers[k] for k in used], dtype).view(np.uint8)
        self._value = numbers
        return self

    def _find(self, kind: Any, dtype: Any, value: Callable[[Any], Any]) -> None:
        """Which numbers are in the record, and which bytes they are."""
        n = len(kind._fields)
        # all of its bytes differ from those of 0
        mark = np.frombuffer(b"\x3f" * np.dtype(dtype).itemsize, dtype)[0]
        self._write(value(kind(*[dtype(0.0)] * n)))
        usual, used, places = self.rows, [], []
        for k in range(n):
            marked = [dtype(0.0)] * n
            marked[k] = mark
            self._write(value(kind(*marked)))
            changed = np.flatnonzero(self.rows[0] != usual[0])
            if changed.size:
                used.append(k)
                places.append(changed)
        self._places = used, np.concatenate(places)

    def _write(self, value: Any) -> None:
        if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
            self.rows = np.empty(1, object)
            self.rows[0] = value
            return
        if self.shape is None:
            self.shape, self._size = Shape(value), _record_size(value)
        # another array every time: a call on another thread may still read the last one
        self.rows = np.zeros((1, self._size), np.uint8)
        _pack(self.rows[0], value)
