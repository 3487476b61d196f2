"""The ways in which the solver can be compiled here: numbers of lanes and older processors."""

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from llvmlite import binding
from numba.core import config

from sph_gym.solver.target import WIDTHS

TESTS = Path(__file__).parent
X86 = platform.machine().lower() in ("x86_64", "amd64")

AVX2 = "+avx,+avx2,+fma,+sse4.2,+ssse3,+popcnt,+bmi,+bmi2,+f16c"
PROCESSORS = {
    "avx2": {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": AVX2},
    "sse2": {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": "+sse2"},
}
# name: what the environment says of it
PATHS = {f"{n} lanes": {"SPH_GYM_LANES": str(n)} for n in WIDTHS} | PROCESSORS


def _runs_avx2() -> bool:
    return X86 and bool(binding.get_host_cpu_features().get("avx2"))


RUNNABLE = {"avx2": _runs_avx2(), "sse2": X86}

every_path = pytest.mark.parametrize(
    "path",
    [
        pytest.param(
            name,
            marks=[
                pytest.mark.skipif(not RUNNABLE.get(name, True), reason="another processor"),
                pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled"),
            ],
        )
        for name in PATHS
    ],
)


def run_tests(path, cache, file, *options):
    """Pytest on `file` in another interpreter that compiles for `path` and keeps it in `cache`."""
    named = {"SPH_GYM_LANES", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"}
    environment = {name: text for name, text in os.environ.items() if name not in named}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "0", *options, file],
        cwd=TESTS.parent,
        env=environment | PATHS[path] | {"SPH_GYM_CACHE": str(cache)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-2000:]
