"""How long a user waits: process start to the first step of an environment, cold and warm."""

import os
import statistics
import subprocess
import sys
import tempfile
import time

from sph_gym.env import env_id
from sph_gym.env.registration import SCENES
from sph_gym.studies.table import Row

COLD, WARM = 15.0, 1.5
REPEATS = 3

_FIRST_STEP = """
import gymnasium, sph_gym
env = gymnasium.make({id!r})
env.reset(seed=0)
env.step(env.action_space.sample())
"""


def _seconds(id_: str, cache: str) -> float:
    began = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", _FIRST_STEP.format(id=id_)],
        env=os.environ | {"SPH_GYM_CACHE": cache},
        check=True,
    )
    return time.perf_counter() - began


def measure(quick: bool) -> list[Row]:
    """Cold: nothing compiled, no reference run on disk. Warm: the median of three runs after it."""
    rows = []
    for scene in SCENES[: 1 if quick else None]:
        with tempfile.TemporaryDirectory() as cache:
            cold = _seconds(env_id(scene), cache)
            warm = statistics.median(_seconds(env_id(scene), cache) for _ in range(REPEATS))
        rows.append(Row("cold start to first step", scene, cold, "s", COLD))
        rows.append(Row("warm start to first step", scene, warm, "s", WARM))
    return rows
