"""The solver is plain Python too: the tests marked `without_jit` once more, uncompiled."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core import config

TESTS = Path(__file__).parent


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled anyway")
def test_the_solver_runs_uncompiled():
    command = [sys.executable, "-m", "pytest", "-m", "without_jit"]
    command += [TESTS / "solver", TESTS / "test_fuzz.py"]
    done = subprocess.run(
        command,
        cwd=TESTS.parent,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-2000:]
