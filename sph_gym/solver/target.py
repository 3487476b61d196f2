"""The target of machine code: the processor's vector instructions and the number of lanes.

`SPH_GYM_LANES` (1, 2, 4, 8 or 16) overrides the number of lanes, so that one machine can run
every path; `NUMBA_CPU_FEATURES` and `NUMBA_CPU_NAME` count as they do for numba itself.
"""

import os
from typing import Any

import numba
import numpy as np
from llvmlite import binding

WIDTHS = (1, 2, 4, 8, 16)
MOST_LANES = max(WIDTHS)
# Every 64-bit processor that numba knows has vectors of at least this many bits.
LEAST_BITS = 128


def _features() -> frozenset[str]:
    """Names of the instruction sets that numba will compile for."""
    config: Any = numba.config
    text = config.CPU_FEATURES
    if text is None:
        try:
            text = binding.get_host_cpu_features().flatten()
        except RuntimeError:
            text = ""
    named = frozenset(word[1:] for word in text.split(",") if word.startswith("+"))
    return named if config.ENABLE_AVX else frozenset(w for w in named if not w.startswith("avx"))


def _chosen_lanes() -> int | None:
    text = os.environ.get("SPH_GYM_LANES", "")
    if not text:
        return None
    if text not in map(str, WIDTHS):
        expected = ", ".join(map(str, WIDTHS))
        raise ValueError(f"SPH_GYM_LANES: expected one of {expected}, got {text!r}")
    return int(text)


FEATURES = _features()
# vl: the same instructions for the shorter vectors that some widths need
HAS_AVX512 = {"avx512f", "avx512vl"} <= FEATURES
BITS = 512 if HAS_AVX512 else 256 if "avx2" in FEATURES else LEAST_BITS
CHOSEN_LANES = _chosen_lanes()
# Machine code for another key is of no use; numba itself looks only at the processor.
KEY = f"{BITS} {HAS_AVX512} {CHOSEN_LANES}"


def n_lanes(dtype: Any) -> int:
    """Lanes of a vector of float32 or float64."""
    if getattr(numba.config, "DISABLE_JIT", False):
        return 1
    return CHOSEN_LANES or BITS // (8 * np.dtype(dtype).itemsize)


def description() -> str:
    """The target in a few characters, as in `512-bit, 8 x float64, 16 x float32`."""
    lanes = ", ".join(f"{n_lanes(t)} x {np.dtype(t).name}" for t in (np.float64, np.float32))
    return f"{BITS}-bit vectors, {lanes}"
