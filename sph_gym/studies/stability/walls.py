"""What boundary particles hold alone: users who need more give them a box or plates."""

from collections.abc import Callable, Iterator
from typing import Any

from sph_gym.solver.simulation import Simulation
from sph_gym.studies.stability import streams
from sph_gym.studies.stability.case import VARIANTS, Case, Variant, article
from sph_gym.studies.table import Row

# What is tried, and what must hold: twice the speed that a sound speed is chosen for.
MACH = (0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 2.0, 5.0)
HELD = 0.2
FRAMES = 60
CASE = Case("shower", streams.shower, streams.DX, behind=streams.below, sizes=MACH)


def passed(variant: Variant, mach: float) -> tuple[int, bool]:
    """How many of thirty strays get behind the first layer of three, and whether that is told."""
    sim = Simulation(CASE.scene(variant, mach), variant.dtype, threads=1)
    most = 0
    for frame in range(FRAMES):
        sim.controls = article(sim, frame)
        told = sim.advance(sim.scene.frame).diverged
        most = max(most, CASE.passed(sim))
        if told:
            return most, True
    return most, False


def rows(look: Callable[[], Any]) -> Iterator[Row]:
    """Up to which Mach number nobody passes, and how many pass in silence at any.

    look: called after every variant.
    """
    for variant in VARIANTS:
        outcomes = {mach: passed(variant, mach) for mach in MACH}
        held = 0.0
        for mach, (n_passed, told) in outcomes.items():
            if n_passed or told:
                break
            held = mach
        silent = sum(n_passed for n_passed, told in outcomes.values() if not told)
        look()
        quantity = "Mach number that boundary particles stop alone"
        yield Row(quantity, variant.name, held, "", HELD, at_least=True)
        yield Row("particles that pass them in silence", variant.name, silent, "", 0.0)
