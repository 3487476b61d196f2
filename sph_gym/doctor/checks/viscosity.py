"""Does viscosity brake differences of velocity, by the strength that was asked for, and once?"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import C0, DX, RHO0, Array, Case, case, lattice
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

# The viscosity that is asked for [m^2/s]; also, where nothing is seen of it, this times rho0: some
# take case.viscosity for the dynamic one.
ASKED = 0.05 * C0 * 3 * DX
# Velocities [c0]: small, so that terms in v^2, as artificial viscosity has them, stay out.
SLOW = 0.01
# The viscosity to compare with, as a share.
THIN = 1e-3
# A response below this share of what the viscosity asked for would do is none: for a kinematic
# one, and for one that was multiplied by rho0 to be seen as a dynamic one.
SEEN_KINEMATIC, SEEN_DYNAMIC = 1e-2, 1e-4


class Way(NamedTuple):
    """Where a solver's viscosity is seen: in `a`, or in changes of v; and what is asked for."""

    by_a: bool
    viscosity: float


def way_of(lab: Lab) -> Way:
    """Return how the solver's viscosity is seen; end the check if it shows none."""
    way = _found_way(lab)
    if way is None:
        raise Ends(skipped("the same with case.viscosity and without: shows none"))
    return way


@once
def _found_way(lab: Lab) -> Way | None:
    probe = random_motion(lab)
    usual = ASKED * SLOW * C0 / DX**2
    for viscosity, seen in ((ASKED, SEEN_KINEMATIC), (ASKED * RHO0, SEEN_DYNAMIC)):
        for by_a in (True, False) if "a" in lab.shown else (False,):
            drag = response(lab, probe, Way(by_a, viscosity))
            if not np.abs(drag).max() < seen * usual * viscosity / ASKED:
                return Way(by_a, viscosity)
    return None


def random_motion(lab: Lab) -> Case:
    """Return a lattice of 9 x 9 at rest spacing with random velocities."""
    x = lattice(9, 9)
    return case(x, SLOW * C0 * lab.rng.uniform(-1, 1, x.shape))


def response(lab: Lab, start: Case, way: Way) -> Array:
    """Return the accelerations (n, 2) [m/s^2] that the viscosity of `way` adds."""
    thick = replace(start, viscosity=way.viscosity)
    # not 0, for which some solvers have another kind of damping
    thin = replace(start, viscosity=THIN * way.viscosity)
    added = acceleration(lab, thick, way.by_a) - acceleration(lab, thin, way.by_a)
    return added / (1 - THIN)


def acceleration(lab: Lab, start: Case, by_a: bool) -> Array:
    """Return the accelerations (n, 2) [m/s^2], as `a` or as changes of v."""
    return lab.acceleration(start) if by_a else lab.change_of_velocity(start)


def shear(c0: float = C0, scale: float = 1.0) -> Case:
    """Return a lattice of 9 x 9, `scale` times as large, with v_x = A y^2.

    Its Laplacian, 2 A, is the same for any kernel, without errors of higher order.
    """
    x = lattice(9, 9, scale * DX)
    v = np.stack([curvature(scale) * x[:, 1] ** 2, np.zeros(len(x))], axis=1)
    return case(x, v, dx=scale * DX, h=3 * scale * DX, c0=c0)


def curvature(scale: float = 1.0) -> float:
    """Return A [1/(m s)] of the shear, with which the fastest have the speed SLOW * C0."""
    return SLOW * C0 / (4 * scale * DX) ** 2


def middle_first(speed: float) -> tuple[Array, Array]:
    """Return x and v of a lattice of 9 x 9 in which the one in the middle moves, others don't.

    For h up to 2 dx: then all its neighbours are surrounded on all sides. It is the first, so that
    it is on one side of all its pairs.
    """
    x = lattice(9, 9)
    x = x[np.argsort(np.abs(x).max(axis=1), kind="stable")]
    return x, np.where(np.arange(81)[:, None] == 0, speed * np.array([1.0, 0.3]), 0.0)


def middle(start: Case) -> Array:
    """Return which particles of the shear are at rest and have all their neighbours, (n,)."""
    near = np.abs(start.x) < 1.5 * start.dx
    return np.asarray(near[:, 0] & (np.abs(start.x[:, 1]) < 0.5 * start.dx))


def effective(lab: Lab, way: Way, c0: float = C0, scale: float = 1.0) -> float:
    """Return the kinematic viscosity [m^2/s] that the shear feels."""
    start = shear(c0, scale)
    drag = response(lab, start, way)[middle(start), 0]
    return float(drag.mean() / (2 * curvature(scale)))


def built_in(lab: Lab) -> float:
    """Return the kinematic viscosity [m^2/s] that is there although case.viscosity is 0."""
    start = shear()
    still = replace(start, v=np.zeros_like(start.v))
    drag = lab.change_of_velocity(start) - lab.change_of_velocity(still)
    return float(drag[middle(start), 0].mean() / (2 * curvature()))


def kick(lab: Lab) -> float:
    """Return what share of gravity's acceleration arrives in v; 1 in a sound solver."""
    start = case(lattice(3, 3, 1.1 * DX))
    g = 0.1 * C0**2 / start.h
    pulled = replace(start, gravity=np.array([g, 0.0]))
    gained = lab.change_of_velocity(pulled) - lab.change_of_velocity(start)
    return float(gained[:, 0].mean() / g)


# Strengths that pass, as shares of what was asked for; that are clearly twice; and clearly wrong.
RIGHT, TWICE, WRONG = (0.65, 1.35), (1.7, 2.4), 3.0
# The constant of three dimensions is 1.125 / h of that of two; other kernels have up to 1.5 / h.
OF_3D = (0.73, 2.0)
# Damping that the case doesn't ask for, and that is no fluid's any more [c0 h].
JELLY = 0.3


@check("viscosity", step=7, needs=("order",))
def viscosity_damps(lab: Lab) -> Result:
    """Give a lattice a shear and random velocities: does viscosity brake or drive them?"""
    way = way_of(lab)
    powers = []
    for start in (shear(), random_motion(lab)):
        drag = response(lab, start, way)
        most = np.sum(np.linalg.norm(drag, axis=1) * np.linalg.norm(start.v, axis=1))
        powers.append(float(np.sum(drag * start.v) / most))
    need(np.isfinite(powers).all(), "a lattice in motion: accelerations are not finite")
    numbers = Measured(max(powers), -1.0, unit="of the largest power", tolerance="below 0.05")
    if min(powers) > 0.05:
        return failed(
            "a lattice of 81, in a shear and with random velocities: viscosity drives the motion "
            "that it should brake",
            "The difference is v_j - v_i for the acceleration of i: turn the sign.",
            numbers,
        )
    if max(powers) > 0.05:
        return inconclusive("viscosity brakes one motion and drives another", numbers.bare)
    return passed("a lattice in a shear and with random velocities is braked", numbers)


@check("viscosity", step=7, needs=("viscosity_damps",))
def viscosity_relative(lab: Lab) -> Result:
    """Add one velocity to all particles: viscosity must not notice."""
    way = way_of(lab)
    start = random_motion(lab)
    wind = replace(start, v=start.v + SLOW * C0 * np.array([1.0, -0.7]))
    drag, in_wind = response(lab, start, way), response(lab, wind, way)
    differs = float(np.abs(in_wind - drag).max()) / max(float(np.abs(in_wind).max()), 1e-300)
    need(np.isfinite(differs), "a lattice in motion: accelerations are not finite")
    numbers = Measured(differs, 0.0, tolerance="0.05 of the largest")
    if differs > 0.05:
        return failed(
            "a lattice of 81 with random velocities: when all are given one more velocity, "
            f"viscous accelerations change by {100 * differs:.2g} %: it brakes what moves as a "
            "whole",
            "Take differences of velocities, v_j - v_i, never v_i or v_j itself; a decay of all "
            "velocities is no viscosity.",
            numbers,
        )
    return passed("viscosity doesn't notice a velocity of the whole", numbers)


@check("viscosity", step=7, needs=("viscosity_damps",))
def viscosity_momentum(lab: Lab) -> Result:
    """Move one particle in a lattice: what viscosity takes from it, its neighbours must get."""
    way = way_of(lab)
    drag = response(lab, case(*middle_first(SLOW * C0), h=2 * DX), way)
    left = np.hypot(*drag.sum(axis=0)) / max(float(np.hypot(*drag[0])), 1e-300)
    need(np.isfinite(left), "one particle moves in a lattice: accelerations are not finite")
    numbers = Measured(left, 0.0, tolerance="0.05 of what the one feels")
    if left > 0.05:
        return failed(
            "one particle moves in a lattice of 81 at rest: viscous accelerations of all don't add "
            f"up to 0, but to {100 * left:.2g} % of its own",
            "What j does to i, i must do to j: give both of a pair their share, by the same "
            "factor, symmetric in rho_i and rho_j.",
            numbers,
        )
    return passed("viscosity keeps the momentum", numbers)


@check("viscosity", step=7, needs=("viscosity_relative", "viscosity_momentum"))
def viscosity_strength(lab: Lab) -> Result:
    """Measure the viscosity of a shear, at two speeds of sound, sizes and viscosities."""
    way = way_of(lab)
    arrives = abs(kick(lab) - 1) < 0.02
    need(way.by_a or arrives, "velocities don't follow accelerations: integration")
    if "rho" in lab.shown:
        rho = float(lab.density(shear())[40])
        need(
            0.75 < rho / RHO0 < 1.3,
            "the density is wrong, by which viscosity is divided",
            Measured(rho, RHO0),
        )
    if way.by_a and arrives:
        again = effective(lab, Way(False, way.viscosity)) / effective(lab, way)
        if TWICE[0] < again < TWICE[1]:
            return _too_thick(again, "velocities lose {:.2g} times what `a` says")
    return _by_form(lab, way)


def _by_form(lab: Lab, way: Way) -> Result:
    """Judge the strength by what it depends on."""
    nu = effective(lab, way)
    others = [
        effective(lab, Way(way.by_a, 2 * way.viscosity)),
        effective(lab, way, c0=2 * C0),
        effective(lab, way, scale=2.0),
    ]
    numbers = Measured(nu, way.viscosity, unit="m^2/s")
    felt = nu > 0 and np.isfinite(others).all() and min(others) > 0
    need(felt, "a shear feels no viscosity", numbers)
    of_viscosity, of_c0, of_size = np.log2(np.array(others) / nu)
    if abs(of_viscosity - 1) > 0.1:
        return inconclusive("viscosity is not proportional to case.viscosity", numbers.bare)
    for power, kind in ((of_size, 0), (of_size - 1, 1)):
        # two powers of h more than the viscosity of this kind has
        if abs(of_c0 - kind) < 0.2 and abs(power - 2) < 0.3:
            return _by_weight(way, nu, kind)
    if abs(of_c0 - 1) < 0.2:
        return _artificial(nu / (way.viscosity * C0 * 3 * DX))
    if abs(of_c0) < 0.1 and abs(of_size) < 0.15:
        return _clean(lab, way, nu)
    if abs(of_c0) < 0.1 and abs(of_size + 1) < 0.2:
        return _inverse(way, nu)
    text = f"nu goes with c0^{of_c0:.2g} and with the size^{of_size:.2g}: no known form"
    return inconclusive(text, numbers)


def _by_weight(way: Way, nu: float, kind: int) -> Result:
    asked = way.viscosity * (C0 * 3 * DX) ** kind
    return failed(
        f"viscosity is {nu / asked:.2g} of what was asked for, four times as much with twice h",
        "The kernel W stands where its Laplacian belongs, 40/(pi h^5) (h - r) for Mueller's: they "
        "differ by a factor of about h^2 / 10.",
        Measured(nu, asked, unit="m^2/s"),
    )


def _artificial(alpha: float) -> Result:
    text = "viscosity is proportional to c0 h: case.viscosity is taken for alpha; "
    text += f"nu = {alpha:.2g} alpha c0 h"
    numbers = Measured(alpha, "1/32 to 1/8", unit="alpha c0 h")
    need(alpha < 1, text, numbers.bare)
    return passed(text, numbers)


def _shares(way: Way, nu: float, asked: float) -> tuple[float, str]:
    """Return nu as a share of what was asked for, as a kinematic or as a dynamic viscosity."""
    kinematic, dynamic = nu / asked, nu * RHO0 / asked
    if abs(np.log(kinematic)) < abs(np.log(dynamic)):
        return kinematic, "kinematic"
    return dynamic, "dynamic"


def _clean(lab: Lab, way: Way, nu: float) -> Result:
    """Judge a viscosity that depends on nothing but case.viscosity."""
    share, kind = _shares(way, nu, way.viscosity)
    if RIGHT[0] < share < RIGHT[1]:
        return passed(
            f"a shear of 81 particles: the {kind} viscosity is {share:.3g} of what was asked for",
            Measured(share, 1.0, tolerance="0.35"),
        )
    numbers = Measured(share, 1.0)
    need(_linear(lab, way), f"only some pairs feel viscosity: {kind}", numbers)
    if TWICE[0] < share < TWICE[1]:
        return _too_thick(share, "the fluid is {:.2g} times as viscous as was asked for")
    undivided = any(RIGHT[0] < share / factor < RIGHT[1] for factor in (RHO0, 1 / RHO0))
    # with densities that are not shown, and may be wrong, only a cause that can be named counts
    if undivided or ("rho" in lab.shown and not 1 / WRONG < share < WRONG):
        return failed(
            f"a shear of 81 particles, with two speeds of sound and two sizes: nu = {nu:.3g} "
            f"m^2/s, for case.viscosity = {way.viscosity:.3g}",
            "Divide by the densities: a_i = nu sum m_j / rho_j (v_j - v_i) Laplacian W, with "
            "nu = mu / rho; the Laplacian of two dimensions is 40 / (pi h^5) (h - r).",
            Measured(nu, way.viscosity, unit="m^2/s", tolerance="a factor of 3"),
        )
    return inconclusive(f"the {kind} viscosity is not what was asked for", numbers)


def _linear(lab: Lab, way: Way) -> bool:
    """Return whether turning all velocities turns what viscosity does, as no switch would."""
    start = random_motion(lab)
    drag = response(lab, start, way)
    turned = response(lab, replace(start, v=-start.v), way)
    return bool(np.abs(drag + turned).max() < 0.02 * np.abs(drag).max())


def _too_thick(share: float, what: str) -> Result:
    return failed(
        f"a shear of 81 particles: {what.format(share)}",
        "Viscosity is applied twice, and the fluid will be like jelly: once as a force and once "
        "more to velocities, or by loops over i and j that both give both of a pair their share.",
        Measured(share, 1.0, tolerance="0.35"),
    )


def _inverse(way: Way, nu: float) -> Result:
    """Judge a viscosity that goes with 1 / h, as constants of three dimensions make it."""
    h = 3 * DX
    share, kind = _shares(way, nu * h, way.viscosity)
    text = f"{kind} viscosity is {share:.3g} / h of what was asked for, at h = {h} and {2 * h} m"
    if OF_3D[0] < share < OF_3D[1]:
        return failed(
            f"a shear of 81 particles: the {text}: a constant of three dimensions",
            "In two dimensions, the Laplacian of the viscosity kernel is 40 / (pi h^5) (h - r); "
            "45 / (pi h^6) belongs to three.",
            Measured(share / h, 1.0, tolerance="0.35"),
        )
    return inconclusive(f"the {text}", Measured(share / h, 1.0))


@check("viscosity", step=7, needs=("order",))
def no_jelly(lab: Lab) -> Result:
    """Measure what brakes a shear although no viscosity was asked for."""
    h = 3 * DX
    share = built_in(lab) / (C0 * h)
    text = f"without viscosity, a shear feels nu = {share:.2g} c0 h"
    numbers = Measured(share, 0.0, unit="c0 h", tolerance=f"below {JELLY}")
    if not share > JELLY:
        return passed(text, numbers)
    left = _left_of_a_wave(lab)
    need(
        left < 0.6,
        f"{text}, but a wave keeps {100 * left:.2g} %",
        numbers._replace(tolerance=""),
    )
    return failed(
        f"{text}; of a wave 8 dx long, {100 * left:.2g} % is left after 5 steps of 0.1 h / c0",
        "Too much damping, the fluid is like jelly: look for artificial viscosity with a large "
        "alpha, a smoothing of velocities in every step, a viscosity that can't be turned off.",
        numbers,
    )


def _left_of_a_wave(lab: Lab) -> float:
    """Return the share of a shear wave that 5 usual steps leave, against that of a uniform flow."""
    x = lattice(9, 9)
    wave = np.sin(2 * np.pi * x[:, 1] / (8 * DX))
    left = []
    for shape in (wave, np.ones(81)):
        v = SLOW * C0 * np.stack([shape, np.zeros(81)], axis=1)
        start = case(x, v)
        after = lab.make(start).step(start.dt, 5).v
        inside = np.abs(x).max(axis=1) < 2.5 * DX
        left.append((after * v)[inside].sum() / (v * v)[inside].sum())
    return float(left[0] / left[1]) if left[1] > 0.05 else np.nan
