"""Memory over many steps: it must not grow."""

import itertools
import math
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import gymnasium as gym

from sph_gym.env.registration import env_id
from sph_gym.extras import progress
from sph_gym.solver.simulation import Simulation
from sph_gym.studies.results import Results
from sph_gym.studies.stability import tanks
from sph_gym.studies.stability.case import stable_step
from sph_gym.studies.table import Row

STEPS, QUICK_STEPS = 1_000_000, 20_000
# What may come and go with Python's own pools [MB], and what a step may leave [MB]: 3 bytes.
FLOOR, RATE = 1.0, 3e-6
# Looks at the memory in each of the runs.
LOOKS = 100
SCENE, ENVS = "dam_break", 4


def bound(steps: int) -> float:
    """Return the growth [MB] over so many steps that counts as none."""
    return FLOOR + RATE * steps


def resident() -> float:
    """Return the memory of this process [MB], or its peak, or nan: what the system tells."""
    try:
        import resource
    except ImportError:
        return math.nan
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        # kilobytes, but bytes on macOS
        unit = 2**20 if sys.platform == "darwin" else 2**10
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
    return pages * resource.getpagesize() / 2**20


def solver() -> Iterator[int]:
    """Yield the substeps of every frame of a small dam break, with all that programs do between."""
    sim = Simulation(tanks.dam(0.1), threads=1)
    for frame in itertools.count():
        sim.controls = stable_step(sim, frame)._replace(dt=sim.nominal_controls.dt)
        report = sim.advance(tanks.FRAME * sim.controls.dt)
        sim.diagnostics()
        sim.restore(sim.snapshot())
        yield report.n_substeps


def environment() -> Iterator[int]:
    """Yield the substeps of every step: random actions, a new instance after the last."""
    env = gym.make(env_id(SCENE), instances="train")
    env.reset(seed=0)
    env.action_space.seed(0)
    while True:
        _, _, terminated, truncated, info = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
        yield int(info["n_substeps"])


def vector() -> Iterator[int]:
    """Yield the substeps of some environments at once, which begin anew by themselves."""
    envs = gym.make_vec(env_id(SCENE), num_envs=ENVS, instances="train", threads=1)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    while True:
        *_, infos = envs.step(envs.action_space.sample())
        yield int(infos["n_substeps"].sum())


WAYS: dict[str, Callable[[], Iterator[int]]] = {
    "the solver": solver,
    "an environment": environment,
    "a vector of environments": vector,
}


def growth(way: str, steps: int) -> float:
    """Return the memory gained [MB] over the last nine tenths of so many steps."""
    play, before = WAYS[way](), math.nan
    for share in progress(range(LOOKS), f"memory of {way}", "look"):
        done = 0
        while done < steps / LOOKS:
            done += next(play)
        if share == LOOKS // 10 - 1:
            before = resident()
    return resident() - before


def rows(quick: bool, results: Results) -> Iterator[Row]:
    """Yield the growth over 10^6 steps, or over some thousand."""
    steps = QUICK_STEPS if quick else STEPS
    for way in WAYS:
        compute = partial(growth, way, steps)
        gained = results.get(["memory", way, steps], compute, float)
        known = math.isfinite(gained)
        label = f"{way}, {steps:,} steps" + ("" if known else ", which this system doesn't tell")
        yield Row("memory gained", label, gained, "MB", bound(steps) if known else None)
