"""Does XSPH bring displacements nearer to those of the neighbours, and leave velocities alone?"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor.case import C0, DX, Array, Case, case, lattice
from sph_gym.doctor.checks.viscosity import middle_first
from sph_gym.doctor.diagnosis import (
    Ends,
    Measured,
    Result,
    failed,
    inconclusive,
    need,
    passed,
    skipped,
)
from sph_gym.doctor.lab import Lab, once
from sph_gym.doctor.registry import check

EPSILON = 0.5
# Largest velocity in a direction, and speed of sound [m/s]: so soft a fluid that its pressure
# moves little, even where it is wrong.
SPEED, SOFT = 0.2, 0.1 * C0
# Steps, short enough that velocities hardly change, long enough that 32 bits see displacements:
# their length [h / C0], the number that is left out first, and the number that counts.
STEP, BEFORE, COUNTED = 0.01, 2, 4
# A share of epsilon below which there is no XSPH.
NONE = 2e-3
# Velocities that pressure changes by more than this share meanwhile tell nothing of XSPH.
CALM = 0.2


class Drift(NamedTuple):
    """Motion of particles in some steps of a solver.

    moved: displacement a time (n, 2) [m/s]; mean: of the velocities before and after (n, 2) [m/s];
    v: velocities (n, 2) [m/s] after BEFORE and after all steps.
    """

    moved: Array
    mean: Array
    v: tuple[Array, Array]


def drift(lab: Lab, start: Case, epsilon: float, step: float = STEP) -> Drift:
    """Return how particles are moved with this epsilon, in steps of `step` h / C0."""
    dt = step * start.h / C0
    subject = lab.make(replace(start, xsph=epsilon)).step(dt, BEFORE)
    x, v = subject.x, subject.v
    subject.step(dt, COUNTED)
    after = subject.v
    return Drift((subject.x - x) / (COUNTED * dt), (v + after) / 2, (v, after))


def added(lab: Lab, start: Case, epsilon: float = EPSILON, step: float = STEP) -> Array:
    """Return the velocities (n, 2) [m/s] that XSPH adds to displacements."""
    return drift(lab, start, epsilon, step).moved - drift(lab, start, 0.0, step).moved


def added_by_motion(lab: Lab, start: Case) -> Array:
    """Return the same, less what it is without velocities: edges that fly off are smoothed too."""
    return added(lab, start) - added(lab, replace(start, v=np.zeros_like(start.v)))


def share(velocity: Array, start: Case) -> float:
    """Return how much of its own velocity a particle inside loses by `velocity` (n, 2) [m/s].

    With random velocities, the mean of the neighbours is about 0, and XSPH takes a share of
    epsilon times the weight of all neighbours: 0.6 to 0.9 epsilon.
    """
    inside = _inside(start)
    v = start.v[inside]
    return float(-(velocity[inside] * v).sum() / (v * v).sum())


def _inside(start: Case) -> NDArray[np.bool_]:
    return np.asarray(np.abs(start.x).max(axis=1) < 2.5 * DX)


@once
def random_motion(lab: Lab) -> Case:
    """Return a lattice of 9 x 9 at rest spacing with random velocities."""
    return case(lattice(9, 9), SPEED * lab.rng.uniform(-1, 1, (81, 2)), c0=SOFT)


def uniform_motion() -> Case:
    """Return the same lattice with one velocity for all."""
    return case(lattice(9, 9), SPEED * np.array([1.0, -0.7]), c0=SOFT)


@once
def smooths(lab: Lab) -> float:
    """Return the share that XSPH of EPSILON takes from random velocities."""
    start = random_motion(lab)
    return share(added(lab, start), start)


@once
def carried(lab: Lab) -> float:
    """Return what share of a uniform velocity moves particles, without XSPH; 1 if all is well."""
    start = uniform_motion()
    u = start.v[0]
    return float(drift(lab, start, 0.0).moved.mean(axis=0) @ u / (u @ u))


def need_calm(lab: Lab) -> None:
    """End the check where displacements tell nothing of XSPH."""
    share = carried(lab)
    need(abs(share - 1) < 0.02, f"particles move by {share:.3g} of their velocities: integration")
    start = random_motion(lab)
    before, after = drift(lab, start, 0.0).v
    calm = np.abs(after - before)[_inside(start)].max() < CALM * np.abs(start.v).max()
    need(calm, "a lattice at rest spacing doesn't keep calm: density, pressure or force")


def need_xsph(lab: Lab) -> None:
    """End the check where XSPH can't be judged."""
    need_calm(lab)
    if abs(smooths(lab)) < NONE * EPSILON:
        raise Ends(skipped("particles move the same with case.xsph and without: shows none"))


# Shares of epsilon by which random velocities are smoothed: normal for all kernels; impossible.
NORMAL, IMPOSSIBLE = (0.3, 1.15), 2.0
_FORMULA = "The formula: x += dt (v_i + eps sum_j m_j / rho_j (v_j - v_i) W)"


@check("xsph", step=7, needs=("order",))
def xsph_off(lab: Lab) -> Result:
    """Give a lattice random velocities, epsilon = 0: does every particle move by its own?"""
    need_calm(lab)
    start = random_motion(lab)
    unasked = drift(lab, start, 0.0)
    lost = share(unasked.moved - unasked.mean, start)
    need(np.isfinite(lost), "a lattice in motion: positions are not finite")
    numbers = Measured(lost, 0.0, tolerance="0.05 of the velocities")
    if lost > 0.05:
        return failed(
            "a lattice of 81 with random velocities, epsilon = 0: particles move by "
            f"{100 * lost:.2g} % less than by their velocities: smoothed",
            "Take epsilon from case.xsph; 0 switches XSPH off.",
            numbers,
        )
    return passed("with epsilon = 0, particles move by their velocities", numbers)


@check("xsph", step=7, needs=("xsph_off",))
def xsph_smooths(lab: Lab) -> Result:
    """Give a lattice random velocities: does XSPH bring displacements nearer to each other?"""
    need_xsph(lab)
    taken = smooths(lab) / EPSILON
    text = f"a lattice of 81 with random velocities: XSPH takes {taken:.3g} epsilon of them away"
    numbers = Measured(taken, 0.75, unit="epsilon", tolerance=f"{NORMAL[0]} to {NORMAL[1]}")
    if taken < 0:
        return failed(
            f"{text}: it moves particles away from what their neighbours do",
            f"Turn the sign. {_FORMULA}, v_j - v_i and not v_i - v_j.",
            numbers,
        )
    if taken > IMPOSSIBLE:
        return _too_much(lab, taken, text)
    need(NORMAL[0] < taken < NORMAL[1], text, numbers)
    return passed(text, numbers)


def _too_much(lab: Lab, taken: float, text: str) -> Result:
    start = random_motion(lab)
    halved = share(added(lab, start, step=STEP / 2), start) / EPSILON
    cause = "Divide by the density: m_j / rho_j is the volume of a particle, about dx^2. "
    if 1.7 < halved / taken < 2.3:
        cause = "Multiply by the time step: what XSPH adds is a velocity. "
    return failed(
        f"{text}, more than all",
        f"{cause}{_FORMULA}.",
        Measured(taken, 0.75, unit="epsilon", tolerance=f"{NORMAL[0]} to {NORMAL[1]}"),
    )


@check("xsph", step=7, needs=("xsph_smooths",))
def xsph_epsilon(lab: Lab) -> Result:
    """Halve epsilon: does XSPH do half as much?"""
    need_xsph(lab)
    full = smooths(lab)
    start = random_motion(lab)
    ratio = share(added(lab, start, EPSILON / 2), start) / full
    numbers = Measured(ratio, 0.5, tolerance="0.1")
    if abs(ratio - 1) < 0.1:
        return failed(
            f"XSPH does as much with epsilon = {EPSILON / 2} as with {EPSILON}",
            "Take epsilon from case.xsph, not a constant.",
            numbers,
        )
    need(abs(ratio - 0.5) < 0.1, "XSPH is not proportional to epsilon", numbers)
    return passed("half of epsilon does half as much", numbers)


@check("xsph", step=7, needs=("xsph_smooths",))
def xsph_relative(lab: Lab) -> Result:
    """Give all particles the same velocity: XSPH has nothing to smooth."""
    need_xsph(lab)
    start = uniform_motion()
    more = float(np.abs(added_by_motion(lab, start)).max())
    left = more / (EPSILON * float(np.hypot(*start.v[0])))
    need(np.isfinite(left), "a lattice in motion: positions are not finite")
    numbers = Measured(left, 0.0, tolerance="0.05 of epsilon times the velocity")
    if left > 0.05:
        return failed(
            "a lattice of 81 with one velocity: XSPH changes displacements by "
            f"{left:.3g} epsilon times the velocity",
            f"Sum differences of velocities. {_FORMULA}.",
            numbers,
        )
    return passed("one velocity for all stays as it is", numbers)


@check("xsph", step=7, needs=("xsph_smooths", "xsph_relative"))
def xsph_momentum(lab: Lab) -> Result:
    """Move one particle in a lattice: what XSPH takes from it, its neighbours must get."""
    need_xsph(lab)
    more = added_by_motion(lab, case(*middle_first(SPEED), h=2 * DX, c0=SOFT))
    left = float(np.hypot(*more.sum(axis=0))) / max(float(np.hypot(*more[0])), 1e-300)
    numbers = Measured(left, 0.0, tolerance="0.3 of what the one loses")
    if left > 0.3:
        return failed(
            "one particle moves in a lattice of 81 at rest: what XSPH adds to all doesn't add up "
            f"to 0, but to {100 * left:.2g} % of what the one loses",
            "What j does to i, i must do to j: give both of a pair their share, divided by "
            "(rho_i + rho_j) / 2.",
            numbers,
        )
    need(left < 0.1, "XSPH does not quite keep the momentum", numbers)
    return passed("XSPH keeps the momentum", numbers)


@check("xsph", step=7, needs=("xsph_smooths",))
def xsph_moves_only(lab: Lab) -> Result:
    """Compare velocities with XSPH and without: it must not change them."""
    need_xsph(lab)
    start = random_motion(lab)
    with_it, without = drift(lab, start, EPSILON).v, drift(lab, start, 0.0).v
    early, late = (share(one - other, start) for one, other in zip(with_it, without, strict=True))
    need(np.isfinite(late), "a lattice in motion: velocities are not finite")
    numbers = Measured(late, 0.0, tolerance="0.1 of the velocities")
    if abs(late) > 0.1 and abs(late) > 1.2 * abs(early):
        return failed(
            f"a lattice of 81 with random velocities: in 6 short steps, XSPH takes "
            f"{100 * late:.2g} % from the velocities themselves",
            "XSPH is for moving particles only: keep the smoothed velocity apart from v, which "
            "accelerations alone change.",
            numbers,
        )
    if abs(late) > 0.1:
        return inconclusive("v may be the smoothed velocity", numbers)
    return passed("XSPH leaves velocities alone", numbers)
