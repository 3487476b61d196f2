"""Is the force between two particles the one that the kernel's slope makes of their pressures?"""

from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import RHO0, TAIT, Array, H
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, need, passed
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.laws import KERNELS, Kernel, Match, integral, match
from sph_gym.doctor.probes import DISTANCES, Pairs, closing, fluid, pairs, squeezing
from sph_gym.doctor.registry import check
from sph_gym.doctor.remedies import IN_2D

_PAIRING = (
    "Use a kernel whose slope stays strong at short distance, such as the spiky one, -30/(pi h^5) "
    "(h - r)^2, for the pressure force; poly6 is for densities only."
)


class Slope(NamedTuple):
    """The kernel's slope as the forces of pairs show it.

    q: (k,) distances in support radii; values: (k,) -m dW/dr h^3 [kg/m]; found: the kernel;
    share: its first moment over the mass that the densities show, 1 if both are right; density:
    the density kernel.
    """

    q: Array
    values: Array
    found: Match
    share: float
    density: Match


@check("force", step=8, needs=("isolated", "push_apart"), shows=("rho", "p"), may_refuse=True)
def force_kernel(lab: Lab) -> Result:
    """Measure the slope of the force's kernel by pairs: its shape and its constant."""
    ratio = squeezing(lab)
    slope = None if ratio is None else measure(lab, H, ratio)
    if slope is None or ratio is None:
        return inconclusive("no pairs could be brought under pressure")
    if slope.found.kernel and slope.found.kernel.pairing:
        peak = slope.q[np.argmax(np.abs(slope.values))]
        return failed(
            "pairs under pressure hardly repel each other when close: they will pair up",
            _PAIRING,
            Measured(f"{slope.found.name}, strongest at r = {peak:.2f} h", "strongest below 0.4 h"),
        )
    beyond = (slope.q > 1.0) & (np.abs(slope.values) > 1e-2 * np.abs(slope.values).max())
    if beyond.any():
        return failed(
            "pairs further apart than case.h push each other",
            "case.h is the support radius: the slope ends there, as the density kernel does.",
            Measured(f"to r = {slope.q[beyond].max():.2f} h", "not beyond h"),
        )
    return _constant(lab, slope, ratio)


def measure(lab: Lab, h: float, ratio: float) -> Slope | None:
    """Return the slope of the force's kernel, None if pairs are under no pressure."""
    settings = fluid(h, ratio)
    found = pairs(lab, DISTANCES, **settings)
    if np.ptp(found.rho) > 1e-4 * np.abs(found.rho).max():
        weight = found.rho.mean(axis=1) - found.lone
        density = match(found.q, weight, "weight")
        mass = density.factor if density.kernel else integral(found.q, weight)
        load, push, q = 2 * (found.p / found.rho**2).mean(axis=1), found.push.mean(axis=1), found.q
    else:
        seen = closing(lab, DISTANCES, (4, 16, 28, 40, 52), **settings)
        early, late = seen[0], seen[-1]
        q = seen[3].q
        slopes = (seen[1].rho - early.rho).mean(axis=1) / (early.q - seen[1].q)
        density = match(seen[1].q, slopes, "slope", alike=0.03)
        mass = density.factor if density.kernel else integral(q, slopes * q) / 2
        push, load = _without_friction(seen), 2 * (late.p / late.rho**2).mean(axis=1)
        push = push * load
    return _slope(q, push, load, mass, density, h)


def _without_friction(seen: list[Pairs]) -> Array:
    """Return d push / d load (k,) of pairs in motion, whatever friction goes with their speed."""
    push = np.array([each.push.mean(axis=1) for each in seen]).T
    load = np.array([2 * (each.p / each.rho**2).mean(axis=1) for each in seen]).T
    speed = np.array([each.closing for each in seen]).T
    columns = np.stack([load, speed], axis=2)
    return np.array(
        [np.linalg.lstsq(c, each, rcond=None)[0][0] for c, each in zip(columns, push, strict=True)]
    )


def _slope(
    q: Array, push: Array, load: Array, mass: float, density: Match, h: float
) -> Slope | None:
    # where pressures are cut off, nothing is seen of the kernel
    seen = load > 1e-2 * TAIT / RHO0**2
    seen |= load > 1e-3 * np.abs(load).max(initial=0.0)
    seen &= np.isfinite(push)
    if seen.sum() < 8 or mass <= 0:
        return None
    q = q[seen]
    values = push[seen] / load[seen] * h
    found = match(q, values, "slope", alike=0.015)
    if not found.kernel and density.kernel:
        # friction blurs what is measured in motion, but densities may have told the kernel
        found = match(q, values, "slope", alike=0.15, names=(density.name,))
    moment = found.factor if found.kernel else integral(q, values * q) / 2
    return Slope(q, values, found, moment / mass, density)


def _constant(lab: Lab, slope: Slope, ratio: float) -> Result:
    """Return whether the constant in front of the force's kernel is right."""
    name = slope.found.name or "no known name"
    numbers = {"unit": "of -m dW/dr", "tolerance": "6 %; half is Mueller's form"}
    for right in (1.0, 0.5):
        if abs(slope.share / right - 1) < 0.06:
            return passed(f"the force's kernel is {name}", Measured(slope.share, right, **numbers))
    if slope.found.kernel is None:
        return inconclusive(f"the force's kernel has {name}", Measured(slope.share, 1.0, **numbers))
    small = measure(lab, H / 2, ratio)
    if small is None:
        return inconclusive("the force at half of h could not be had", Measured(slope.share, 1.0))
    link, cause = factor_cause(slope.share, small.share, H, slope.found.kernel, slope.density)
    need(cause, f"the force's kernel is {name}; its size is not", Measured(slope.share, 1.0))
    text = f"pairs under pressure: the push against the measured pressures and densities ({name})"
    return failed(text, cause, Measured(slope.share, 1.0, **numbers), link=link)


def factor_cause(
    share: float, small: float, h: float, kernel: Kernel, density: Match
) -> tuple[str, str]:
    """Return the link and the cause of a force that is `share` times as large as it should be.

    small: the same at half of the support h [m]; kernel: of the force. ("", "") if the factor is
    no known one and within 15 % of a right one.
    """
    solid = {"3D force": kernel.solid / h}
    if density.kernel:
        solid["3D density"] = h / density.kernel.solid
        solid["3D both"] = kernel.solid / density.kernel.solid
    grows = {"3D force": 2.0, "3D density": 0.5, "3D both": 1.0}
    for cause, factor in solid.items():
        for form in (1.0, 0.5):
            near = abs(share / (form * factor) - 1) < 0.04
            if near and abs(small / share / grows[cause] - 1) < 0.1 and abs(factor - 1) > 0.05:
                return _SOLID[cause][0], _SOLID[cause][1].format(factor)
    if abs(small / share - 1) > 0.1:
        return "force", f"The constant does not go with 1/h^3 as it must in 2D: {_CONSTANT}"
    third = any(abs(share * 3 / form - 1) < 0.06 for form in (1.0, 0.5))
    if third and kernel is KERNELS["spiky"]:
        return "force", (
            "The slope of the spiky kernel in 2D is -30/(pi h^5) (h - r)^2; -10/(pi h^5) is the "
            "constant of the kernel itself and makes sound 0.58 times as fast."
        )
    if abs(share / 2 - 1) < 0.06:
        return "force", "The force counts twice: each pair is visited twice, or a 2 is too much."
    if any(abs(share / form - 1) < 0.15 for form in (1.0, 0.5)):
        return "", ""
    return "force", f"The constant is off by a factor of {share:.3g}: {_CONSTANT}"


_CONSTANT = (
    "the slope is the derivative of a kernel whose integral over the plane is 1, such as "
    "-30/(pi h^5) (h - r)^2 for the spiky one."
)
_SOLID = {
    "3D force": (
        "force",
        "The slope has the constant of three dimensions, {:.3g} times that of two: " + _CONSTANT,
    ),
    "3D density": (
        "density",
        "The density kernel has the constant of three dimensions: calibrating the mass hides that "
        "in the densities, but makes the mass, and with it every force, {:.3g} times as large as "
        "it should be. " + IN_2D,
    ),
    "3D both": (
        "density",
        "Both kernels have the constants of three dimensions: calibrating the mass hides that in "
        "the densities, but pressure is {:.3g} times as strong. " + IN_2D,
    ),
}
