"""The result of an `advance`, and its plan while it is under way."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from sph_gym.solver.checks import positive

MAX_SUBSTEPS = 10**12


class Report(NamedTuple):
    """The result of one `advance`.

    n_substeps: steps taken (the one that failed included); dt: their length [s]; diverged: x, v,
    rho or p no longer finite, a speed above 5000 m/s, a particle inside of boundary particles or
    between those of a thin wall (`tunnelling`), or more spurious energy, or more of it at
    once, than the ledger tolerates (`energy.Ledger`); cause: "" | "cfl" | "stiffness" |
    "clumping" | "tunnelling" | "energy" | "nan"; link: the link of the chain where it first
    showed, "" | "neighbours" | "density" | "pressure" | "force" | "integration" | "walls";
    bad_particle: its public index, or -1.
    """

    n_substeps: int
    dt: float
    diverged: bool = False
    cause: str = ""
    link: str = ""
    bad_particle: int = -1


@dataclass
class Underway:
    """An `advance` that is under way: its plan, and how far it came.

    seconds, dt, began: [s]; n_substeps: of all; longest: chunk, in substeps; done: substeps.
    """

    seconds: float
    n_substeps: int
    dt: float
    began: float
    longest: int
    done: int = 0

    def time(self, steps: int) -> float:
        """Return the time [s] after so many substeps."""
        return self.began + steps * self.dt


def count_substeps(seconds: float, dt: float) -> int:
    """Return how many steps of at most dt [s] make `seconds` [s]; ValueError for too many."""
    ratio = positive("seconds", seconds) / dt - 1e-9
    if not ratio < MAX_SUBSTEPS:
        raise ValueError(
            f"seconds: {seconds:g} s in steps of {dt:g} s are more than {MAX_SUBSTEPS:g} substeps"
        )
    return max(math.ceil(ratio), 1)
