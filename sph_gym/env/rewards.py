"""Reward: as little work as possible, as long as the flow stays what it is.

Every error is measured in multiples of its tolerance, and e is the largest of them. Within
tolerance (e <= 1) only work counts, 1 for an eighth of the tuned CFL rule's work, 0.5 for as
much, 0 for eight times as much; beyond it nothing is paid and a penalty from 0.5 to 1.5 is booked
to the term that sets e. A blow-up costs the largest penalty for every step that is left, so that
no early death can pay.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.env.reference import Reference
from sph_gym.solver.checks import number
from sph_gym.solver.scene import Scene

TERMS = ("density", "clumping", "fidelity", "work", "blowup")
WORST = 1.5
WORK_RANGE = math.log(64)
# Steps over which the drift away from the reference is taken; an error over the whole past would
# punish the rest of an episode for one bad frame.
WINDOW = 8


class Tolerances(NamedTuple):
    """What counts as an error of 1.

    compression, compression_p99: mean and 99th percentile of max(rho/rho0 - 1, 0); clumping: share
    of particles closer than 0.6 dx beyond the reference's share; com_drift: of the centre of mass
    within WINDOW steps [dx]; kinetic_drift: of the kinetic energy [share of its maximum]. The last
    three are widened by the spread between equally fine references, times `spread`, and the very
    last never falls below `kinetic_floor` times the energy of the whole fluid at c0 / 10: in a
    fluid at rest there is no flow to be faithful to.
    """

    compression: float = 0.01
    compression_p99: float = 0.04
    clumping: float = 0.15
    com_drift: float = 1.0
    kinetic_drift: float = 0.05
    kinetic_floor: float = 1e-3
    spread: float = 2.0


class Errors(NamedTuple):
    """Errors in multiples of their tolerances."""

    density: float
    clumping: float
    fidelity: float


class Judge:
    """Follows one episode and measures it against its reference."""

    def __init__(
        self, reference: Reference, scene: Scene, fluid_mass: float, tolerances: Tolerances
    ) -> None:
        self._fine = reference.fine
        self._tolerances = tolerances
        self._dx = scene.dx
        whole = fluid_mass * (scene.fluid.c0 / 10) ** 2 / 2
        self._kinetic_scale = max(
            tolerances.kinetic_drift * float(self._fine.kinetic.max()),
            tolerances.kinetic_floor * whole,
        )
        self._com_spread = np.zeros(len(self._fine.kinetic))
        self._kinetic_spread = np.zeros_like(self._com_spread)
        self._clumping_spread = np.zeros_like(self._com_spread)
        for twin in reference.twins:
            com = np.hypot(*_drift(twin.com - self._fine.com).T)
            kinetic = np.abs(_drift(twin.kinetic - self._fine.kinetic))
            clumping = np.abs(twin.clumping - self._fine.clumping)
            self._com_spread = np.maximum(self._com_spread, com)
            self._kinetic_spread = np.maximum(self._kinetic_spread, kinetic)
            self._clumping_spread = np.maximum(self._clumping_spread, clumping)
        self._past = [(np.zeros(2), 0.0)]

    def errors(self, frame: int, numbers: dict[str, float]) -> Errors:
        """The errors at the end of step `frame` (from 1); to be called once a step, in order."""
        t, fine = self._tolerances, self._fine
        com = np.array([numbers["com_x"], numbers["com_y"]]) - fine.com[frame]
        kinetic = numbers["kinetic_energy"] - float(fine.kinetic[frame])
        self._past.append((com, kinetic))
        com_then, kinetic_then = self._past[max(frame - WINDOW, 0)]
        com_limit = t.com_drift * self._dx + t.spread * self._com_spread[frame]
        kinetic_limit = self._kinetic_scale + t.spread * self._kinetic_spread[frame]
        excess = max(numbers["clumping"] - float(fine.clumping[frame]), 0.0)
        return Errors(
            max(
                numbers["density_error"] / t.compression,
                numbers["density_error_p99"] / t.compression_p99,
            ),
            float(excess / (t.clumping + t.spread * self._clumping_spread[frame])),
            max(
                float(np.hypot(*(com - com_then)) / com_limit),
                float(abs(kinetic - kinetic_then) / kinetic_limit),
            ),
        )


def _drift(error: NDArray[np.float64]) -> NDArray[np.float64]:
    """error(t) - error(t - WINDOW), with error(0) before the start."""
    then = np.maximum(np.arange(len(error)) - WINDOW, 0)
    return error - error[then]


def check_weights(weights: dict[str, float] | None) -> dict[str, float]:
    """One weight a term, 1 where none is given. Raises ValueError for unknown terms."""
    given = {} if weights is None else weights
    if not isinstance(given, dict):
        raise ValueError(f"reward_weights: expected a dictionary, got {weights!r}")
    for term, weight in given.items():
        if term not in TERMS:
            raise ValueError(f"reward_weights: expected terms {', '.join(TERMS)}, got {term!r}")
        number(f"reward_weights[{term!r}]", weight)
    return {term: float(given.get(term, 1.0)) for term in TERMS}


def terms(errors: Errors, work: float) -> dict[str, float]:
    """The named terms of a step that didn't blow up, before weights."""
    result = dict.fromkeys(TERMS, 0.0)
    worst = max(errors)
    if worst <= 1.0:
        result["work"] = min(max(0.5 - math.log(work) / WORK_RANGE, 0.0), 1.0)
    else:
        culprit = TERMS[errors.index(worst)]
        result[culprit] = -min(0.5 + math.log10(worst), WORST)
    return result


def blowup_terms(steps_left: int) -> dict[str, float]:
    """The named terms of the step that blew up; `steps_left` includes it."""
    return dict.fromkeys(TERMS, 0.0) | {"blowup": -WORST * steps_left}
