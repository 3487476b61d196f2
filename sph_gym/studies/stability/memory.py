"""Memory over many steps: it must not grow."""

import math
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from sph_gym.solver.simulation import Simulation
from sph_gym.studies import store
from sph_gym.studies.stability import tanks
from sph_gym.studies.stability.case import article
from sph_gym.studies.table import Row

STEPS, QUICK_STEPS = 1_000_000, 5_000
# What may come and go, with Python's own pools [MB].
BOUND = 4.0
# Looks in which the run is done.
LOOKS = 100


def resident() -> float:
    """Memory of this process [MB]; where the system tells only its peak, that; else nan."""
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


def growth(steps: int, look: Callable[[], Any] = lambda: None) -> float:
    """Memory gained [MB] over the last nine tenths of so many steps of a small dam break.

    With all that an agent does in between: controls, diagnostics, snapshots. look: called a
    hundred times.
    """
    sim, before = Simulation(tanks.dam(0.1), threads=1), math.nan
    n_frames = math.ceil(steps / tanks.FRAME / LOOKS)
    for share in range(LOOKS):
        for frame in range(n_frames):
            sim.controls = article(sim, frame)._replace(dt=sim.nominal_controls.dt)
            sim.advance(tanks.FRAME * sim.controls.dt)
            sim.diagnostics()
        sim.restore(sim.snapshot())
        if share == LOOKS // 10 - 1:
            before = resident()
        look()
    return resident() - before


def rows(quick: bool, folder: Path, look: Callable[[], Any]) -> Iterator[Row]:
    """Growth over 10^6 steps, or over some thousand; the finished run is kept in the folder."""
    steps = QUICK_STEPS if quick else STEPS
    key = ["memory", steps]
    path = folder / store.name(key, Path(__file__), Path(tanks.__file__))
    compute = partial(growth, steps, look)
    gained = float(store.kept(path, key, compute, lambda kept: type(kept) in (int, float)))
    told = math.isfinite(gained)
    case = f"{steps:,} steps" + ("" if told else ", which this system doesn't tell")
    yield Row("memory gained", case, gained, "MB", BOUND if told else None)
