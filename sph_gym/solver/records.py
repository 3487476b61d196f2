"""Arguments of compiled calls as records: taken apart once, and not again in every call.

To take nested tuples of arrays apart costs as much as a step of some hundred particles, and no
other thread can do the same meanwhile. So they are written to records, rows of bytes, from which
compiled code reads them, one or many. Without compiling, a record is the value itself.
"""

from typing import Any

import numba
import numpy as np

from sph_gym.solver.jit import jit
from sph_gym.solver.lanes import Shape, pack, record_size


@jit
def _pack(record, value):
    pack(record, value)


class Record:
    """The record of a value that may be replaced by another of the same type.

    rows: (1, n_bytes), good as long as the arrays that the value was made of live; shape: what
    compiled code has to know to read it. All values must be of one type.
    """

    def __init__(self) -> None:
        self._value: Any = None
        self.rows: Any = None
        self.shape: Any = None
        self._size = 0

    def __reduce__(self) -> Any:
        # a record holds addresses of arrays, and a copy has arrays of its own
        return Record, ()

    def follow(self, value: Any) -> "Record":
        """Make sure that it is the record of `value`."""
        if value is not self._value:
            self._write(value)
            self._value = value
        return self

    def _write(self, value: Any) -> None:
        if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
            self.rows = np.empty(1, object)
            self.rows[0] = value
            return
        if self.shape is None:
            self.shape, self._size = Shape(value), record_size(value)
        # another array every time: a call on another thread may still read the last one
        self.rows = np.zeros((1, self._size), np.uint8)
        _pack(self.rows[0], value)
