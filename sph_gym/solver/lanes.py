"""The few functions beside + - * / < that a pair term may use.

A term written with them says nothing of how many particles it works on at once, nor in which
precision: `like` turns a literal into the type of its first argument, so that a float32 sum is
never widened by a constant.
"""

from typing import Any

import numpy as np
from numba.core import types
from numba.extending import overload

from sph_gym.solver.jit import OPTIONS, jit


def like(x: Any, value: float) -> Any:
    """`value` in the type of `x`."""
    return type(x)(value)


@overload(like, strict=False, jit_options=OPTIONS)
def _like(x: Any, value: float) -> Any:
    if x == types.float32:
        return lambda x, value: np.float32(value)
    if x == types.float64:
        return lambda x, value: np.float64(value)
    return None


@jit
def select(condition, a, b):
    """`a` where the condition holds, else `b`."""
    return a if condition else b


@jit
def minimum(a, b):
    """The smaller of the two; `b` where `a` is not a number."""
    return a if a < b else b


@jit
def maximum(a, b):
    """The larger of the two; `b` where `a` is not a number."""
    return a if a > b else b


@jit
def reciprocal(x):
    """1 / x."""
    return like(x, 1.0) / x


@jit
def rsqrt(x):
    """1 / sqrt(x)."""
    return like(x, 1.0) / np.sqrt(x)
