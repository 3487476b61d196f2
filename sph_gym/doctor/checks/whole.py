"""Blobs in empty space, once nothing else was found: what is wrong shows, and may be traced."""

from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import C0, DX, Array, Case, all_finite, case, lattice, tait_energy
from sph_gym.doctor.diagnosis import Measured, Result, failed, need, passed
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import check

# Faster than this [c0] nothing can get from a squeeze of a few per cent.
_EXPLODED = 0.5
STEPS = 150
# Times the energy that Tait's equation stores: measured are 0.2 to 0.8 with all kernels.
_TOO_MUCH = 2.0
QUARTER = (
    "A quarter of the step cures it: take the time step from the smallest of 0.4 h / c0 (h: the "
    "smoothing length), 0.25 sqrt(h / a) and 0.125 h^2 / nu, or mend the integrator."
)


class RunEnd(NamedTuple):
    """The end of a run: the last x, v (n, 2), and the highest speed on the way [m/s]."""

    x: Array
    v: Array
    fastest: float

    @property
    def finite(self) -> bool:
        """Return whether all numbers are."""
        return all_finite(self.x, self.v)

    @property
    def energy(self) -> float:
        """Return the mean kinetic energy of a particle [J/kg]."""
        return float((self.v**2).sum(axis=1).mean() / 2)


def follow(lab: Lab, start: Case, dt: float, steps: int) -> RunEnd:
    """Return a run that ends early where numbers are not finite."""
    subject, fastest = lab.make(start), 0.0
    for _ in range(steps):
        subject.step(dt)
        speed = float(np.linalg.norm(subject.v, axis=1).max())
        fastest = max(fastest, speed) if np.isfinite(speed) else np.inf
        if not np.isfinite(fastest):
            break
    return RunEnd(subject.x, subject.v, fastest)


@check("setup", needs=("order",), last=True)
def reproducible(lab: Lab) -> Result:
    """Do the same case twice: the second solver must do what the first one did."""
    x = lattice(5, 5, 0.9 * DX)
    start = case(x + lab.rng.uniform(-0.05, 0.05, x.shape) * DX)
    one, other = (follow(lab, start, start.dt, 5) for _ in range(2))
    need(one.finite and other.finite, "not finite, which other checks judge")
    apart = float(np.abs(one.x - other.x).max() / DX)
    if apart > 1e-3:
        return failed(
            "the same case twice, 5 steps each: the particles end at different places",
            "Something is left over from one solver to the next (a list at the level of the module "
            "or the class), or memory is used before it is set.",
            Measured(apart, 0.0, unit="dx", tolerance="0.001 dx"),
        )
    return passed("the same case twice, 5 steps each: apart", Measured(apart, 0.0, unit="dx"))


@check("pressure", step=5, last=True)
def suction(lab: Lab) -> Result:
    """Let a block stand that is stretched by a tenth: nothing may pull it together."""
    start = case(lattice(5, 5, 1.1 * DX))
    a = lab.acceleration(start)
    pull = -float((a * start.x).sum() / np.abs(start.x).sum()) / (start.c0**2 / start.h)
    need(np.isfinite(pull), "not finite, which other checks judge")
    told = "a block of 5 x 5 at 1.1 dx at rest: mean pull inwards"
    numbers = Measured(pull, 0.0, unit="c0^2 / h", tolerance="0.05")
    if pull > 0.05:
        return failed(
            f"{told}: its particles attract each other",
            "Clamp pressures to zero, p = max(0, ...): at a surface, densities by summation are "
            "low, and what Tait's equation makes of them pulls the fluid into clumps.",
            numbers,
        )
    return passed(told, numbers)


@check("force", step=3, last=True)
def blob(lab: Lab) -> Result:
    """Squeeze a blob by 3 % in empty space: it must neither explode nor run away."""
    start = case(lattice(8, 8, 0.97 * DX))
    run = follow(lab, start, start.dt, STEPS)
    told = f"a blob of 8 x 8, squeezed by 3 %, {STEPS} steps in empty space"
    if not run.finite or run.fastest > _EXPLODED * C0:
        return _exploded(lab, start, told, run)
    drift = float(np.abs(run.v.mean(axis=0)).max())
    if drift > 0.01 * C0:
        return failed(
            f"{told}: it runs away as a whole, although nothing else is there",
            "What i does to j, j has to do to i: use a symmetric form of the pressure force, over "
            "complete lists of neighbours.",
            Measured(drift / C0, 0.0, unit="c0", tolerance="0.01 c0"),
        )
    return passed(
        f"{told}: highest speed", Measured(run.fastest / C0, f"< {_EXPLODED:g}", unit="c0")
    )


def _exploded(lab: Lab, start: Case, told: str, run: RunEnd) -> Result:
    """Tell an explosion by the length of the step from one by the forces."""
    calm = follow(lab, start, start.dt / 4, 2 * STEPS)
    numbers = Measured(
        run.fastest / C0 if run.finite else "not finite", f"< {_EXPLODED:g}", unit="c0"
    )
    if calm.finite and calm.fastest < _EXPLODED / 2 * C0:
        return failed(
            f"{told}: it explodes; with a quarter of the step it is calm ({calm.fastest / C0:.3g} "
            "c0)",
            QUARTER,
            numbers,
            link="integration",
        )
    return failed(
        f"{told}: it explodes, with a quarter of the step as well",
        "Not the step: something attracts, or pushes too hard. Look at pairs: two squeezed "
        "particles must part, each with the same force; then at the sign and the constant of the "
        "kernel's gradient, and at B in the equation of state.",
        numbers,
    )


@check("pressure", step=6, last=True)
def expansion(lab: Lab) -> Result:
    """Let a blob expand that is squeezed to 0.9 dx: what it gains must have been stored in it."""
    start = case(lattice(8, 8, 0.9 * DX))
    stored = start.c0**2 / start.gamma * tait_energy(0.9**-2, start.gamma)
    run = follow(lab, start, start.dt, 100)
    need(run.finite, "not finite, which other checks judge")
    share = run.energy / stored
    told = "a blob of 8 x 8 at 0.9 dx expands: kinetic energy over what Tait's equation stores"
    numbers = Measured(share, "0.2 to 1", tolerance=f"up to {_TOO_MUCH:g}")
    if share > _TOO_MUCH:
        short = follow(lab, start, start.dt / 4, 400)
        cured = short.finite and short.energy < _TOO_MUCH * stored
        return failed(
            f"{told}; {short.energy / stored:.3g} with a quarter of the step",
            QUARTER
            if cured
            else "The equation of state or the force is too strong: B is rho0 c0^2 / gamma "
            "(without gamma it is 7 times too large); the gradient's constant is that of two "
            "dimensions.",
            numbers,
            link="integration" if cured else "pressure",
        )
    return passed(told, numbers)
