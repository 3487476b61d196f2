"""Reward: as little work as possible, as long as the flow stays what it is.

Every error is measured in multiples of its tolerance, and e is the largest of them. Within
tolerance (e <= 1) only work counts: 1 for none, 0.5 for as much as the tuned CFL rule spends on
average, -1 for four times as much and more. The scale is linear, so that a faithful episode earns
what its total work says, and moving work from one step to another earns nothing; a logarithm would
pay for uneven work. Beyond tolerance a penalty from 1 to 2 is booked to the term that sets e: never
less than the most expensive faithful step costs, so that infidelity saves nothing. A blow-up costs
the largest penalty for every step that is left, so that an early end never pays.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from sph_gym.env.reference import WINDOW, ReferenceRun, recent
from sph_gym.solver.checks import in_range
from sph_gym.solver.scene import Scene

MEANINGS = {
    "density": "the fluid is compressed: the mean or the 99th percentile of max(rho/rho0 - 1, 0)",
    "clumping": "more particles are closer than 0.6 dx than in the reference",
    "noise": "velocities differ from one particle to the next more than in the reference",
    "fidelity": "the flow drifts away from the reference: centre of mass, extent, kinetic energy",
    "work": "what the step cost: substeps / mean substeps a step of the tuned CFL rule",
    "blowup": "the solver blew up, for every step that is left",
}
TERMS = tuple(MEANINGS)
# Penalties of a step.
MILDEST, WORST = 1.0, 2.0
# From so many times the tuned rule's mean work on, a faithful step pays as little as the mildest
# unfaithful one.
MOST_WORK = 4.0
# Smallest tolerance: divided by it, any error of a fluid that hasn't blown up is a finite number.
SMALLEST = 1e-9
# Largest weight: times the penalty of any episode, it stays within float32.
HEAVIEST = 1e6


class Tolerances(NamedTuple):
    """Errors that count as 1.

    - `compression`: mean of max(rho/rho0 - 1, 0)
    - `compression_p99`: 99th percentile of the same
    - `clumping`: share of particles closer than 0.6 dx beyond the reference's share
    - `noise`: mean squared velocity noise (`sph_gym.solver.noise`) beyond the reference's, both as
      means of the last WINDOW steps [(c0 / 10)^2]
    - `com_drift`: of the centre of mass within WINDOW steps [dx]
    - `extent_drift`: of the standard deviations of x and y within WINDOW steps [dx]
    - `kinetic_drift`: of the kinetic energy within WINDOW steps [share of its maximum]
    - `kinetic_floor`: what the last never falls below [energy of the whole fluid at c0 / 10], for
      in a fluid at rest there is no flow to be faithful to
    - `spread`: how many times the spread between equally fine references is added to the
      tolerances of clumping, of noise and of the three drifts
    """

    compression: float = 0.01
    compression_p99: float = 0.04
    clumping: float = 0.04
    noise: float = 0.02
    com_drift: float = 1.0
    extent_drift: float = 1.0
    kinetic_drift: float = 0.05
    kinetic_floor: float = 1e-3
    spread: float = 2.0


class Errors(NamedTuple):
    """Errors in multiples of their tolerances."""

    density: float
    clumping: float
    noise: float
    fidelity: float


# Gaps to the reference in the centre of mass, the extent and the kinetic energy; and the noise.
Past = tuple[float, float, float, float, float, float]


class Judge:
    """Errors of one episode against its reference."""

    def __init__(
        self, reference: ReferenceRun, scene: Scene, fluid_mass: float, tolerances: Tolerances
    ) -> None:
        fine, self._tolerances, t = reference.fine, tolerances, tolerances
        columns = (*fine.com.T, *fine.extent.T, fine.kinetic)
        # plain numbers: an episode looks at one row at a time
        self._fine = np.stack(columns, axis=-1).tolist()
        whole = fluid_mass * (scene.fluid.c0 / 10) ** 2 / 2
        kinetic = max(t.kinetic_drift * float(fine.kinetic.max()), t.kinetic_floor * whole)
        base = (t.com_drift * scene.dx, t.extent_drift * scene.dx, kinetic)
        self._limits = (np.array(base) + t.spread * reference.spread[:, :3]).tolist()
        least = (t.clumping, t.noise * (scene.fluid.c0 / 10) ** 2)
        room = np.array(least) + t.spread * reference.spread[:, 3:]
        usual = np.stack([fine.clumping, recent(fine.noise)], axis=-1)
        self._usual = np.concatenate([usual, room], axis=-1).tolist()
        self.past: list[Past] = [(0.0, 0.0, 0.0, 0.0, 0.0, float(fine.noise[0]))]

    def errors(self, frame: int, numbers: Mapping[str, float]) -> Errors:
        """Return the errors at the end of step `frame` (from 1); to be called once a step."""
        t, fine = self._tolerances, self._fine[frame]
        now = (
            numbers["com_x"] - fine[0], numbers["com_y"] - fine[1],
            numbers["extent_x"] - fine[2], numbers["extent_y"] - fine[3],
            numbers["kinetic_energy"] - fine[4], numbers["velocity_noise"],
        )  # fmt: skip
        self.past.append(now)
        then = self.past[max(frame - WINDOW, 0)]
        com, extent, kinetic = self._limits[frame]
        last = self.past[-WINDOW:]
        noise = sum([each[5] for each in last]) / len(last)
        clumped, noisy, clumping_room, noise_room = self._usual[frame]
        return Errors(
            max(
                numbers["density_error"] / t.compression,
                numbers["density_error_p99"] / t.compression_p99,
            ),
            max(numbers["clumping"] - clumped, 0.0) / clumping_room,
            max(noise - noisy, 0.0) / noise_room,
            max(
                math.hypot(now[0] - then[0], now[1] - then[1]) / com,
                math.hypot(now[2] - then[2], now[3] - then[3]) / extent,
                abs(now[4] - then[4]) / kinetic,
            ),
        )


def check_weights(weights: Mapping[str, float] | None) -> dict[str, float]:
    """Return one weight a term, 1 where none is given.

    Raises ValueError for unknown terms and for weights beyond HEAVIEST.
    """
    given = {} if weights is None else weights
    if not isinstance(given, Mapping):
        raise ValueError(f"reward_weights: expected a dictionary, got {weights!r}")
    for term, weight in given.items():
        if term not in TERMS:
            raise ValueError(f"reward_weights: expected terms {', '.join(TERMS)}, got {term!r}")
        in_range(f"reward_weights[{term!r}]", weight, -HEAVIEST, HEAVIEST)
    return {term: float(given.get(term, 1.0)) for term in TERMS}


def check_tolerances(tolerances: Mapping[str, float] | None) -> Tolerances:
    """Return the usual tolerances, replaced where others are given.

    Raises ValueError for unknown names and for what isn't positive, except a spread of 0.
    """
    given = {} if tolerances is None else tolerances
    if not isinstance(given, Mapping):
        raise ValueError(f"tolerances: expected a dictionary, got {tolerances!r}")
    for name in given:
        if name not in Tolerances._fields:
            known = ", ".join(Tolerances._fields)
            raise ValueError(f"tolerances: expected names {known}, got {name!r}")
    checked = {
        name: in_range(f"tolerances[{name!r}]", value, 0.0 if name == "spread" else SMALLEST)
        for name, value in given.items()
    }
    return Tolerances(**checked)


def terms(errors: Errors, work: float) -> dict[str, float]:
    """Return the named terms of a step that didn't blow up, before weights."""
    result = dict.fromkeys(TERMS, 0.0)
    worst = max(errors)
    if worst <= 1.0:
        result["work"] = 1.0 - min(work, MOST_WORK) / 2
    else:
        culprit = TERMS[errors.index(worst)]
        result[culprit] = -min(MILDEST + math.log10(worst), WORST)
    return result


def blowup_terms(steps_left: int) -> dict[str, float]:
    """Return the named terms of the step that blew up; `steps_left` includes it."""
    return dict.fromkeys(TERMS, 0.0) | {"blowup": -WORST * steps_left}
