"""The wait of a user: process start to the first step of an environment, cold and warm."""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial

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


def _seconds(id_: str, cache: str) -> float:
    began = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", _FIRST_STEP.format(id=id_)],
        env=os.environ | {"SPH_GYM_CACHE": cache},
        check=True,
    )
    return time.perf_counter() - began
