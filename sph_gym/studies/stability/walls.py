"""What boundary particles hold alone: users who need more give them a box or plates."""

from collections.abc import Callable, Iterator
from typing import Any

from sph_gym.solver.simulation import Simulation
from sph_gym.studies.stability import streams
from sph_gym.studies.stability.case import VARIANTS, Case, Variant, article
from sph_gym.studies.table import Row

# What is tried, and what must hold: twice the speed that a sound speed is chosen for.
MACH = (0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2)
HELD = 0.2
FRAMES = 60
CASE = Case("shower", streams.shower, streams.DX, behind=streams.below, sizes=MACH)


def passed(variant: Variant, mach: float) -> int:
    """How many of thirty strays get behind the first layer of three, ever."""
    sim = Simulation(CASE.scene(variant, mach), variant.dtype, threads=1)
    most = 0
    for frame in range(FRAMES):
        sim.controls = article(sim, frame)
        if sim.advance(sim.scene.frame).diverged:
            return sim.n_fluid
        most = max(most, CASE.passed(sim))
    return most


def rows(look: Callable[[], Any]) -> Iterator[Row]:
    """The largest Mach number up to which nobody passes; look: called after every variant."""
    for variant in VARIANTS:
        held = 0.0
        for mach in MACH:
            if passed(variant, mach):
                break
            held = mach
        look()
        quantity = "Mach number that boundary particles stop alone"
        yield Row(quantity, variant.name, held, "", HELD, at_least=True)
