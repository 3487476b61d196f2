"""Densities that are followed in time by d rho / dt = -rho div v, and what is wrong with one."""

import numpy as np

from sph_gym.doctor.case import C0, RHO0, SUPPORT, Array, H, case
from sph_gym.doctor.findings import Finding, failed, inconclusive, passed
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.laws import Match, integral, match
from sph_gym.doctor.probes import DISTANCES, STILL, closing, fluid

SUPPORT_RADIUS = (
    "case.h is the SUPPORT radius, where W ends. Splines are often written with a smoothing "
    "length of a half (cubic, Wendland) or a third (quintic, Gaussian) of it: convert once, in "
    "the adapter, and use the same radius in the neighbour search."
)
_UPSIDE_DOWN = ", and yet they push: the slope of the kernel has the wrong sign everywhere"
_RENEW = "Densities must be renewed in every step from the present neighbours."
EVERY_PAIR = (
    "Compare with a loop over all pairs. Then look at the neighbour search: cells smaller than "
    "the support, cells visited twice, a rounding that puts a particle into the wrong cell."
)


def by_continuity(lab: Lab) -> Finding:
    """Return what is found of densities that don't depend on positions."""
    settings = fluid(H)
    early, late = closing(lab, DISTANCES, (4, 16), **settings)
    both, nearer = late.rho - early.rho, early.q - late.q
    rise = both.mean(axis=1)
    if np.abs(rise).max() < 1e-5 * np.abs(late.rho).max():
        return _deaf(lab, late.lone)
    lab.facts["density"] = "continuity"
    one_sided = np.abs(both[:, 0] - both[:, 1])
    if one_sided.max() > 0.05 * np.abs(both).max():
        return uneven(early.q, one_sided, np.zeros(len(rise)), 0.05 * np.abs(both).max())
    moved = np.abs(nearer) > 0.1 * np.abs(nearer).max()
    middle, slopes = ((early.q + late.q) / 2)[moved], (rise / np.where(moved, nearer, 1.0))[moved]
    if slopes[np.argmax(np.abs(slopes))] < 0:
        return _falling(slopes, bool((late.push - early.push).sum() > 1e-3 * C0**2 / H))
    return _reach(middle, slopes) or _slopes_mass(lab, middle, slopes)


def _falling(slopes: Array, pushes: bool) -> Finding:
    """Return that densities fall where they should rise; pushes: whether pairs part even so."""
    return failed(
        # thinned particles that push: the slope in the force has the wrong sign, too
        "pairs that approach each other: their densities fall" + _UPSIDE_DOWN * pushes,
        "d rho_i/dt = sum m_j (v_i - v_j) . grad_i W_ij: check the order of i and j, and the sign "
        "of grad W, which points to the neighbour.",
        float(slopes.min()),
        "above 0",
        unit="kg/m^3 per h",
        link="force" if pushes else "density",
    )


def _reach(q: Array, slopes: Array) -> Finding | None:
    """Return that slopes end elsewhere than at h, None if they don't."""
    size = np.abs(slopes).max()
    far = (q > 1.0) & (np.abs(slopes) > 1e-2 * size)
    if far.any():
        return failed(
            "pairs further apart than case.h change each other's density",
            SUPPORT_RADIUS,
            f"to r = {q[far].max():.2f} h",
            "not beyond h",
        )
    near = (q > 0.65) & (q < 0.76)
    if near.any() and np.abs(slopes[near]).max() < 1e-4 * size:
        return failed(
            "pairs nearer than case.h don't change each other's density",
            SUPPORT_RADIUS,
            f"none from r = {q[near].min():.2f} h on",
            "up to h",
        )
    return None


def _slopes_mass(lab: Lab, q: Array, slopes: Array) -> Finding:
    """Return whether d rho/dt = -rho div v has the right size."""
    found = match(q, slopes, "slope", alike=0.03)
    lab.facts["slope"], lab.facts["kernel"] = found, found.name
    mass = found.factor if found.kernel else integral(q, slopes * q) / 2
    plain = RHO0 / SUPPORT**2
    share = mass / plain
    name = found.name or "of no known name"
    if 0.8 < share < 1.25:
        return passed(
            f"densities by continuity; the kernel is {name}", share, 1.0, unit="of -rho div v"
        )
    if not found.kernel:
        return inconclusive("densities by continuity, kernel unknown", share, 1.0)
    return failed(
        f"pairs that approach each other: d rho/dt = -rho div v is off ({name} kernel)",
        factor_remedy(share, H, found),
        share,
        1.0,
        unit="of -rho div v",
        tolerance="20 %",
    )


def _deaf(lab: Lab, own: float) -> Finding:
    lists = "neighbors" in lab.shown
    start = case([[H, H], [1.3 * H, H]])
    listed = lists and 1 in lab.make(start).step(STILL * start.dt).neighbors(0)
    lost = (lists and not listed) or (not lists and own < 0.9 * RHO0)
    return failed(
        "pairs at 28 distances, at rest and approaching: each has the density of a lone particle",
        EVERY_PAIR
        if lost
        else "Densities must be renewed in every step from the present neighbours.",
        own,
        "more than that of a lone particle",
        unit="kg/m^3",
        link="neighbours" if lost else "density",
    )


def uneven(q: Array, one_sided: Array, between: Array, noise: float) -> Finding:
    """Return that densities of like pairs differ: between partners (k, 2), or places (k,)."""
    lonely = bool(one_sided.max() > noise)
    bad = one_sided > noise if lonely else np.tile(between > noise, 2)
    what = (
        "one partner counts the other, but not the other way round"
        if lonely
        else "the same distance gives different densities at another place"
    )
    return failed(
        f"pairs at {len(DISTANCES)} distances, in two places and directions each: {what}",
        EVERY_PAIR,
        f"{int(bad.sum())} of {len(q)} pairs, from r = {q[bad].min():.2f} h on",
        "0 pairs",
        link="neighbours",
    )


def factor_remedy(share: float, h: float, found: Match, small: float | None = None) -> str:
    """Return what makes a density `share` times as large; small: the same at half of h."""
    solid = found.kernel.solid if found.kernel else 1.4
    follows = small is None or abs(small / share / 2 - 1) < 0.1
    if follows and 0.7 < share * h / solid < 1.4:
        return (
            f"The kernel has the constant of three dimensions, {solid / h:.3g} times that of two"
            + ("; with half of h it is off by twice as much. " if small else ". ")
            + "In 2D: poly6 4/(pi h^8), spiky 10/(pi h^5), cubic spline 40/(7 pi h^2), "
            "Wendland C2 7/(pi h^2), h the support."
        )
    mass = f"The mass of a particle is rho0 dx^2 = {RHO0 * (h / SUPPORT) ** 2:.3g} kg/m in 2D"
    return f"{mass}; here densities are {share:.3g} times too large. Else the kernel's constant."
