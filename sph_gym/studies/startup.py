"""The wait of a user: starts of new processes with nothing compiled, and with all of it."""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

from sph_gym.env import env_id
from sph_gym.env.registration import SCENES
from sph_gym.studies.table import Row, measure_parts

COLD, WARM = 15.0, 1.5
REPEATS = 3

_FIRST_STEP = """
import gymnasium, sph_gym
env = gymnasium.make({id!r})
env.reset(seed=0)
env.step(env.action_space.sample())
"""
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


def measure(quick: bool) -> Iterator[Row]:
    """Yield the waits of every scene, with a progress bar; quick: of the first scene only."""
    return measure_parts([(name, partial(wait, name)) for name in SCENES[: 1 if quick else None]])


def wait(scene: str) -> Iterator[Row]:
    """Yield the wait with nothing compiled and no reference kept, and the median of later ones."""
    with tempfile.TemporaryDirectory() as cache:
        cold = _seconds(env_id(scene), cache)
        warm = statistics.median(_seconds(env_id(scene), cache) for _ in range(REPEATS))
    yield Row("cold start to first step", scene, cold, "s", COLD)
    yield Row("warm start to first step", scene, warm, "s", WARM)


def compiling() -> Iterator[Row]:
    """Yield times of the dam break in float64, and of every function that is compiled."""
    case = "dam_break, float64"
    with tempfile.TemporaryDirectory() as cache:
        cold, warm = _first_advance(cache), _first_advance(cache)
    for name, found in (("cold", cold), ("warm", warm)):
        yield Row(f"import, {name}", case, found["import"], "s")
        yield Row(f"first simulation and advance, {name}", case, found["advance"], "s")
    for function, seconds in cold["compiled"].items():
        yield Row("compile", f"{function}, float64", seconds, "s")


def _seconds(id_: str, cache: str) -> float:
    began = time.perf_counter()
    _run(_FIRST_STEP.format(id=id_), cache)
    return time.perf_counter() - began


def _first_advance(cache: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(_run(_FIRST_ADVANCE, cache).splitlines()[-1])
    return found


def _run(code: str, cache: str) -> str:
    """Run Python code in a new process with a compile cache, and return what it prints."""
    environment = os.environ | {"SPH_GYM_CACHE": cache}
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, text=True, check=True
    ).stdout
