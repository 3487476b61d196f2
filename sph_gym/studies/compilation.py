"""How long compiling takes: from nothing, from the cache, and for every compiled function."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator

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


def _first_advance(cache: str) -> dict[str, object]:
    done = subprocess.run(
        [sys.executable, "-c", _FIRST_ADVANCE],
        env=os.environ | {"SPH_GYM_CACHE": cache},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout.splitlines()[-1])
    assert isinstance(found, dict)
    return found


def measure() -> Iterator[Row]:
    """The dam break in float64 in a new process: nothing compiled yet, then everything."""
    case = "dam_break, float64"
    with tempfile.TemporaryDirectory() as cache:
        cold, warm = _first_advance(cache), _first_advance(cache)
    for name, found in (("cold", cold), ("warm", warm)):
        yield Row(f"import, {name}", case, _seconds(found["import"]), "s")
        yield Row(f"first simulation and advance, {name}", case, _seconds(found["advance"]), "s")
    compiled = cold["compiled"]
    assert isinstance(compiled, dict)
    for function, seconds in compiled.items():
        yield Row("compile", f"{function}, float64", _seconds(seconds), "s")


def _seconds(value: object) -> float:
    assert isinstance(value, float)
    return value
