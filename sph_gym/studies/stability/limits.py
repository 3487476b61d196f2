"""Known limits: bounds that a case is known to miss, by how much, and why.

Each is still measured. It is shown as a known limit, and the study fails if it gets worse than
its documented value by more than the margin. `docs/stability.md` lists them.
"""

from typing import NamedTuple

from sph_gym.studies.stability.checks import BY_NAME
from sph_gym.studies.table import Row

LABEL = "known limit"
# The check of a map: the largest stable step over the article's rule.
STEP = "limit / article's rule"


class KnownLimit(NamedTuple):
    """A bound that is missed, in one case, one variant and by one check, of the full version.

    value: what was measured; margin: by how much it may get worse, since such flows are chaotic
    and another processor rounds otherwise; reason: why it misses the bound. Of a map: the scene,
    its sound speed [c0], at any epsilon, and `STEP`.
    """

    case: str
    variant: str
    check: str
    value: float
    margin: float
    reason: str

    @property
    def bound(self) -> float:
        """The bound that it must keep instead."""
        at_least = self.check == STEP or BY_NAME[self.check].at_least
        return self.value + (-self.margin if at_least else self.margin)


_CLUMPS = (
    "The force of cubic splines vanishes as two particles come together, so that close pairs stay "
    "close, and XSPH, the only damping here, moves both alike"
)
_HEATS = (
    "XSPH moves particles with a velocity that is not the one they keep, so that pairs do work "
    "that the kinetic energy does not see, and nothing else takes this heat out"
)
_SPLASHES = (
    "The splash is thrown apart for a moment, so that half of the particles have fewer "
    "neighbours; seen once, in a chaotic flow that another processor rounds to another splash"
)
_THROWS = (
    "The fluid becomes 25 times as stiff or as soft in every frame, which throws it apart: for a "
    "moment most of the finer particles have few neighbours, and kernels that are no pair make "
    "energy of the disorder; a chaotic flow, which another processor rounds to another one"
)
_PARTS = (
    "Two particles at one place stay together only while both are rounded alike: once they are one "
    "digit apart, they have a direction and part. Grid and brute force add neighbours in another "
    "order, and here two of 18 pairs part on the grid alone; another processor rounds otherwise"
)
_SWITCHED = "stiffness switched every frame"
_SOME, _MUCH = (f"epsilon = {epsilon}, no other viscosity" for epsilon in ("0.6", "1"))
KNOWN_LIMITS = (
    KnownLimit(_SOME, "other kernels", "clumped", 0.16, 0.02, _CLUMPS),
    KnownLimit(_MUCH, "other kernels", "excess", 0.025, 0.003, _HEATS),
    KnownLimit(_MUCH, "other kernels", "rise", 0.025, 0.003, _HEATS),
    KnownLimit(_SWITCHED, "finer", "rise", 0.1701, 0.01, _THROWS),
    KnownLimit(_SWITCHED, "finer", "typical", 0.32, 0.03, _THROWS),
    KnownLimit("dt x 3", "float32", "typical", 0.89, 0.01, _SPLASHES),
    KnownLimit("a coincident row", "finer", "observables", 1.33e-6, 1.9e-7, _PARTS),
)
_SOFT = (
    "The weight of the water compresses so soft a fluid by 7 to 24 % (by Tait's law), so that "
    "sound at the floor is 1.2 to 1.9 times as fast as the rule assumes; the rest of the gap is "
    "not explained"
)
MAP_LIMITS = (
    KnownLimit("hydrostatic_tank", "0.1", STEP, 0.30, 0.03, _SOFT),
    KnownLimit("hydrostatic_tank", "0.16", STEP, 0.476, 0.05, _SOFT),
    KnownLimit("hydrostatic_tank", "0.25", STEP, 0.755, 0.07, _SOFT),
)


class LimitRow(Row):
    """A row that misses its usual bound and is held to that of a known limit instead."""

    __slots__ = ()

    @property
    def verdict(self) -> str:
        """The verdict in words, for the terminal."""
        return LABEL if self.holds else super().verdict


def as_limit(row: Row, limit: KnownLimit) -> LimitRow:
    """Return a row that misses its bound as one that is held to a known limit."""
    return LimitRow(*row)._replace(case=f"{row.case} ({LABEL})", bound=limit.bound)


def known_limit(case: str, variant: str, check: str) -> KnownLimit | None:
    """Return the known limit of a check of a case in a variant; None if there is none."""
    key = case, variant, check
    return next((limit for limit in (*KNOWN_LIMITS, *MAP_LIMITS) if limit[:3] == key), None)
