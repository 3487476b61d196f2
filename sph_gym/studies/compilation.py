"""The time of compiling: from nothing, from the cache, and of every compiled function."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from typing import Any

from sph_gym.studies.table import Row

_FIRST_ADVANCE = """
import json, time
began = time.perf_counter()
from numba.core import event
with event.install_recorder("numba:compile") as recorder:
    from sph_gym import Simulation, scenes
    imported = time.perf_counter()
    sim = Simulation(scenes.make("dam_break"), threads=1)
    sim.advance(sim.controls.dt)
    ended = time.perf_counter()
compiled, depth = {}, 0
for moment, record in recorder.buffer:
    depth += 1 if record.is_start else -1
    if record.is_start and depth == 1:
        first = moment
    if not record.is_start and depth == 0:
        name = record.data["dispatcher"].py_func.__name__
        compiled[name] = compiled.get(name, 0.0) + moment - first
print(json.dumps({"import": imported - began, "advance": ended - imported, "compiled": compiled}))
"""


def measure() -> Iterator[Row]:
    """Yield times of the dam break in float64 in new processes: the cache empty, then filled."""
    case = "dam_break, float64"
    with tempfile.TemporaryDirectory() as cache:
        cold, warm = _first_advance(cache), _first_advance(cache)
    for name, found in (("cold", cold), ("warm", warm)):
        yield Row(f"import, {name}", case, found["import"], "s")
        yield Row(f"first simulation and advance, {name}", case, found["advance"], "s")
    for function, seconds in cold["compiled"].items():
        yield Row("compile", f"{function}, float64", seconds, "s")


def _first_advance(cache: str) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-c", _FIRST_ADVANCE],
        env=os.environ | {"SPH_GYM_CACHE": cache},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found
