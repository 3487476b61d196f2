"""What boundary particles hold alone: users who need more give them a box or plates."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from sph_gym.solver.simulation import Simulation
from sph_gym.studies import store
from sph_gym.studies.stability import streams
from sph_gym.studies.stability.case import VARIANTS, Case, Variant, overstepping
from sph_gym.studies.stability.events import turned
from sph_gym.studies.table import Row

# What is tried, and what must hold: four times the speed that a sound speed is chosen for.
MACH = (0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 2.0, 5.0)
HELD = 0.4
# In multiples of the stable one; above it, nobody may pass in silence either.
STEPS = (1.0, 2.0, 4.0)
FRAMES = 60
CASE = Case(
    "shower", streams.shower, turned(0.0, 0.0), streams.DX, behind=streams.below, sizes=MACH
)
# Looks in which all is done.
N_RUNS = len(VARIANTS) * len(STEPS)
OWN = tuple(Path(__file__).with_name(f"{name}.py") for name in ("walls", "case", "streams"))


class Strays(NamedTuple):
    """How many of thirty strays get behind the first layer of three before that is told, if it is.

    A blow-up is told of at the end of the step in which it happens, and ends the run.
    """

    n_passed: int
    told: int


def passed(variant: Variant, mach: float, step: float = 1.0) -> Strays:
    """Strays at a Mach number, with so many times the stable step."""
    sim = Simulation(CASE.scene(variant, mach), variant.dtype, threads=1)
    steer, most = overstepping(step), 0
    for frame in range(FRAMES):
        sim.controls = steer(sim, frame)
        if sim.advance(sim.scene.frame).diverged:
            return Strays(most, 1)
        most = max(most, CASE.passed(sim))
    return Strays(most, 0)


def rows(folder: Path, look: Callable[[], Any]) -> Iterator[Row]:
    """Up to which Mach number nobody passes, and how many pass in silence at any.

    Finished runs are kept in the folder. look: called after every variant and step.
    """
    for variant in VARIANTS:
        for step in STEPS:
            outcomes = {mach: _kept(variant, mach, step, folder) for mach in MACH}
            look()
            yield from _rows(f"{variant.name}, dt x {step:g}", step, outcomes)


def _kept(variant: Variant, mach: float, step: float, folder: Path) -> Strays:
    key = ["boundary particles", variant.name, mach, step]
    path = folder / store.name(key, *OWN)
    compute = partial(passed, variant, mach, step)
    return Strays(*store.kept(path, key, compute, store.is_record(Strays)))


def _rows(label: str, step: float, outcomes: dict[float, Strays]) -> Iterator[Row]:
    held = 0.0
    for mach, strays in outcomes.items():
        if strays.n_passed or strays.told:
            break
        held = mach
    silent = float(sum(strays.n_passed for strays in outcomes.values()))
    quantity = "Mach number that boundary particles stop alone"
    yield Row(quantity, label, held, "", HELD if step <= 1 else None, at_least=True)
    yield Row("particles that pass them in silence", label, silent, "", 0.0)
    faster = [strays.told for mach, strays in outcomes.items() if mach > HELD]
    title = f"runs of strays beyond Mach {HELD:g} that blow up, all reported"
    yield Row(title, label, float(sum(faster)), f"of {len(faster)}")
