"""Faults in the law of a pair's force, one at a time."""

from typing import NamedTuple

from sph_gym.doctor.case import GAMMA


class PairFault(NamedTuple):
    """One thing that may be wrong in a pair law, and what it does to it.

    own: the particle's own share; solid_*: the constant of three dimensions; mass, force, both:
    factors of the mass, of the force, and of every sum over pairs; exponent, stiffness: of
    p = stiffness ((rho/rho0)^exponent - 1 + rest) / exponent, None for gamma; clamp: whether p < 0
    is cut off; absolute: whether |p| is taken; upside_down: whether it is rho0/rho; reach: of both
    kernels, in h; reach_density: of that for densities; rate: factor of d rho/dt, of continuity
    only; pairing: whether the slope is poly6's; times_r: whether the direction is a distance
    instead of a unit vector.
    """

    link: str = ""
    name: str = ""
    remedy: str = ""
    own: float = 1.0
    solid_density: bool = False
    solid_force: bool = False
    mass: float = 1.0
    force: float = 1.0
    both: float = 1.0
    exponent: float | None = None
    stiffness: float = 1.0
    rest: float = 0.0
    clamp: bool = True
    absolute: bool = False
    upside_down: bool = False
    reach: float = 1.0
    reach_density: float = 1.0
    rate: float = 1.0
    pairing: bool = False
    times_r: bool = False


FAULTS = (
    PairFault(
        "neighbours",
        "each pair counts twice",
        "Visit every pair once a particle: cells visited twice, or a list with both orders, "
        "double the sums.",
        both=2.0,
    ),
    PairFault(
        "density",
        "no self-contribution",
        "Begin each sum with the particle's own share, rho[i] = m W(0, h).",
        own=0.0,
    ),
    PairFault(
        "density",
        "self-contribution twice",
        "Add the particle's own share once: a search that also finds the particle itself adds it.",
        own=2.0,
    ),
    PairFault(
        "density",
        "density kernel with the constant of three dimensions",
        "Use the constants of 2D: poly6 4/(pi h^8), cubic spline 40/(7 pi h^2).",
        solid_density=True,
    ),
    PairFault(
        "density",
        "both kernels with the constants of three dimensions",
        "Use the constants of 2D: poly6 4/(pi h^8), spiky slope -30/(pi h^5).",
        solid_density=True,
        solid_force=True,
    ),
    PairFault("density", "mass twice", "The mass is rho0 dx^2 in 2D.", mass=2.0),
    PairFault("density", "mass half", "The mass is rho0 dx^2 in 2D.", mass=0.5),
    *(
        PairFault(
            "density",
            f"kernel that ends at {reach:g} h",
            "case.h is the SUPPORT radius: a smoothing length is a half or a third of it.",
            reach=reach,
        )
        for reach in (0.5, 2.0, 3.0, 1 / 3)
    ),
    *(
        PairFault(
            "density",
            f"density kernel that ends at {reach:g} h",
            "case.h is the SUPPORT radius: a smoothing length is a half or a third of it.",
            reach_density=reach,
        )
        for reach in (0.5, 2.0)
    ),
    PairFault(
        "force",
        "direction not divided by the distance",
        "Use the unit vector (x_i - x_j) / r.",
        times_r=True,
    ),
    PairFault("pressure", "B without gamma", "B is rho0 c0^2 / gamma.", stiffness=GAMMA),
    PairFault(
        "pressure",
        "linear gas law",
        "Use Tait's equation, p = B ((rho/rho0)^7 - 1) with B = rho0 c0^2 / 7.",
        exponent=1.0,
    ),
    PairFault(
        "pressure",
        "linear gas law with Tait's B",
        "Use Tait's equation, p = B ((rho/rho0)^7 - 1): the exponent is missing.",
        exponent=1.0,
        stiffness=1 / GAMMA,
    ),
    *(
        PairFault(
            "pressure",
            f"exponent {gamma:g} instead of 7",
            "Tait's equation has the exponent gamma in both places, case.gamma.",
            exponent=gamma,
            stiffness=stiffness,
        )
        for gamma in (1.4, 2.0, 3.0, 3.5, 5.0, 6.0, 8.0)
        for stiffness in (1.0, gamma / GAMMA)
    ),
    PairFault(
        "pressure", "pressures below zero", "Cut pressures off at zero: p = max(0, p).", clamp=False
    ),
    PairFault(
        "pressure",
        "pressures below zero taken as positive",
        "Cut pressures off at zero: p = max(0, p), not |p|.",
        absolute=True,
    ),
    PairFault(
        "pressure",
        "rho0 / rho in Tait's equation",
        "p = B ((rho/rho0)^gamma - 1): the ratio is upside down.",
        upside_down=True,
    ),
    PairFault(
        "pressure",
        "Tait's equation without its - 1",
        "p = B ((rho/rho0)^gamma - 1): without the - 1, fluid at rest is under pressure.",
        rest=1.0,
    ),
    PairFault(
        "force",
        "slope of poly6 for the pressure force",
        "Use the spiky slope, -30/(pi h^5) (h - r)^2: that of poly6 vanishes at short distance, "
        "and particles pair up.",
        pairing=True,
    ),
    PairFault(
        "force",
        "slope a third as large",
        "The slope of the spiky kernel in 2D is -30/(pi h^5) (h - r)^2, not -10/(pi h^5).",
        force=1 / 3,
    ),
    PairFault(
        "force",
        "slope with the constant of three dimensions",
        "Use the slope of 2D: -30/(pi h^5) (h - r)^2 for the spiky kernel.",
        solid_force=True,
    ),
    PairFault("force", "force twice", "Each pair is to push once.", force=2.0),
    PairFault(
        "force",
        "wrong sign, in the rate of density, too",
        "Count the minus signs of the slope, which pressure and d rho/dt share.",
        force=-1.0,
        rate=-1.0,
        clamp=False,
    ),
    PairFault(
        "force",
        "slope a third as large, in the rate of density, too",
        "The slope of the spiky kernel in 2D is -30/(pi h^5) (h - r)^2, not -10/(pi h^5).",
        force=1 / 3,
        rate=1 / 3,
    ),
    PairFault("force", "wrong sign", "Count the minus signs of the slope.", force=-1.0),
)

SOUND, LINEAR = PairFault(), PairFault("pressure", "linear gas law", exponent=1.0)
