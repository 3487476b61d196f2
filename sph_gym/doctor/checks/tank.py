"""A dam break, after everything else: what is wrong shows, and may be traced."""

from dataclasses import replace

import numpy as np

from sph_gym.doctor.case import DX, Array, Case, case, lattice
from sph_gym.doctor.checks.whole import QUARTER, STEPS, RunEnd, follow
from sph_gym.doctor.findings import Finding, failed, inconclusive, passed
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import check

# A dam break that has less kinetic energy [g H] hardly moves: measured are 0.09 to 0.3.
_STIFF = 0.01


@check("walls", needs=("free_fall",), last=True)
def dam_break(lab: Lab) -> Finding:
    """Let a column of 10 x 10 particles fall apart in a box: a tenth of what a dam break is."""
    x = lattice(10, 10)
    # a spacing from the sides: walls whose first particles are on the side need as much
    x += DX - x.min(axis=0)
    start = case(x, gravity=(0.0, -9.81), box=(0.0, 20 * DX, 0.0, 16 * DX))
    run = follow(lab, start, 2 * start.dt, STEPS)
    told = f"a column of 10 x 10 in a box, {STEPS} steps"
    if not run.finite:
        return _not_finite(lab, start, told)
    unit = 9.81 * 10 * DX
    fallen = 9.81 * float((x - run.x)[:, 1].mean()) / unit
    energy, front = run.energy / unit, float(run.x[:, 0].max() - x[:, 0].max()) / DX
    if energy > 1.5:
        return _too_lively(lab, start, told, run)
    outside = _outside(run.x, start) / DX
    numbers = f"front {front:.3g} dx, fall {fallen:.2g} g H, energy {energy:.2g} g H"
    if outside > 1:
        return failed(
            f"{told}: particles leave the box, though the water is slow (below 0.2 c0)",
            "Walls of particles need as many layers as the support is deep, take part in densities "
            "and in pressures, and stay where they are; other walls must look at every particle in "
            "every step.",
            outside,
            "at most 1",
            unit="dx outside",
        )
    if front < (0.8 if energy < _STIFF else 0.3):
        return _stays(told, front, energy)
    if fallen < 0.02:
        return inconclusive(f"{told}: it does not fall", numbers)
    return passed(told, numbers, "front > 0.8 dx, fall > 0, energy < 0.5 g H")


def _outside(x: Array, start: Case) -> float:
    assert start.box is not None
    x_min, x_max, y_min, y_max = start.box
    low, high = np.array([x_min, y_min]), np.array([x_max, y_max])
    return float(max((low - x).max(), (x - high).max()))


def _not_finite(lab: Lab, start: Case, told: str) -> Finding:
    if follow(lab, start, start.dt / 2, 2 * STEPS).finite:
        return failed(
            f"{told}: not finite any more; with a quarter of the step it stays so", QUARTER,
            "not finite", "finite", link="integration",
        )  # fmt: skip
    return failed(
        f"{told}: not finite any more, with a quarter of the step as well",
        "A blob in empty space stays finite. Walls press particles onto one place: skip pairs "
        "whose distance is (nearly) zero before dividing by it.",
        "not finite", "finite", link="force",
    )  # fmt: skip


def _too_lively(lab: Lab, start: Case, told: str, run: RunEnd) -> Finding:
    unit = 9.81 * 10 * DX
    short = follow(lab, start, start.dt / 2, 2 * STEPS)
    free = follow(lab, replace(start, box=None, gravity=np.zeros(2)), 2 * start.dt, STEPS)
    numbers = (run.energy / unit, "< 0.5")
    if short.finite and short.energy < 0.5 * unit:
        return failed(
            f"{told}: it gains more energy than it had; not so with a quarter of the step",
            QUARTER, *numbers, unit="g H", link="integration",
        )  # fmt: skip
    if free.finite and free.energy < 0.2 * unit and short.finite and short.energy > unit:
        return failed(
            f"{told}: it gains more energy than it had, with a quarter of the step as well, but "
            "not without box and gravity",
            "The walls put in energy: look at the velocity after a contact, and at the force of "
            "boundary particles.",
            *numbers, unit="g H",
        )  # fmt: skip
    return inconclusive(f"{told}: it gains more energy than it had", *numbers, unit="g H")


def _stays(told: str, front: float, energy: float) -> Finding:
    numbers = (front, "> 2")
    if energy < _STIFF:
        return failed(
            f"{told}: the front does not advance, and the column hardly moves ({energy:.2g} g H)",
            "Too much damping: viscosity is 0 in this case, so look for an artificial viscosity "
            "that is always on, for a decay of velocities, and for damping that is added twice.",
            *numbers, unit="dx", link="viscosity",
        )  # fmt: skip
    return failed(
        f"{told}: it falls ({energy:.2g} g H), but into a heap: nothing pushes the front",
        "Hardly any pressure is there: look at the density under compression (does it change?), "
        "then at B in the equation of state.",
        *numbers, unit="dx", link="pressure",
    )  # fmt: skip
