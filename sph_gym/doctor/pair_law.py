"""Which densities, equation of state and kernel make a measured force between two particles?

For solvers that show positions and velocities only. Everything is told without units: forces in
c0^2 / h, densities in rho0, distances in h.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import GAMMA, Array
from sph_gym.doctor.diagnosis import LINKS
from sph_gym.doctor.laws import KERNELS, Kernel, lattice_sum
from sph_gym.doctor.remedies import (
    CLAMP,
    IN_2D,
    MASS,
    OWN_SHARE,
    SUPPORT_RADIUS,
    TAIT_EQUATION,
    UNIT_VECTOR,
)


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


_SLOPE = "The slope of the spiky kernel in 2D is -30/(pi h^5) (h - r)^2, not -10/(pi h^5)."
FAULTS = (
    PairFault(
        "neighbours",
        "each pair counts twice",
        "Visit every pair once a particle: cells visited twice, or a list with both orders, "
        "double the sums.",
        both=2.0,
    ),
    PairFault("density", "no self-contribution", OWN_SHARE, own=0.0),
    PairFault(
        "density",
        "self-contribution twice",
        "Add the particle's own share once: a search that also finds the particle itself adds it.",
        own=2.0,
    ),
    PairFault(
        "density",
        "density kernel with the constant of three dimensions",
        IN_2D,
        solid_density=True,
    ),
    PairFault(
        "density",
        "both kernels with the constants of three dimensions",
        IN_2D,
        solid_density=True,
        solid_force=True,
    ),
    PairFault("density", "mass twice", MASS, mass=2.0),
    PairFault("density", "mass half", MASS, mass=0.5),
    *(
        PairFault("density", f"kernel that ends at {reach:g} h", SUPPORT_RADIUS, reach=reach)
        for reach in (0.5, 2.0, 3.0, 1 / 3)
    ),
    *(
        PairFault(
            "density",
            f"density kernel that ends at {reach:g} h",
            SUPPORT_RADIUS,
            reach_density=reach,
        )
        for reach in (0.5, 2.0)
    ),
    PairFault("force", "direction not divided by the distance", UNIT_VECTOR, times_r=True),
    PairFault("pressure", "B without gamma", TAIT_EQUATION, stiffness=GAMMA),
    PairFault("pressure", "linear gas law", TAIT_EQUATION, exponent=1.0),
    PairFault(
        "pressure", "linear gas law with Tait's B", TAIT_EQUATION, exponent=1.0, stiffness=1 / GAMMA
    ),
    *(
        PairFault(
            "pressure",
            f"exponent {gamma:g} instead of 7",
            TAIT_EQUATION,
            exponent=gamma,
            stiffness=stiffness,
        )
        for gamma in (1.4, 2.0, 3.0, 3.5, 5.0, 6.0, 8.0)
        for stiffness in (1.0, gamma / GAMMA)
    ),
    PairFault("pressure", "pressures below zero", CLAMP, clamp=False),
    PairFault("pressure", "pressures below zero taken as positive", CLAMP, absolute=True),
    PairFault("pressure", "rho0 / rho in Tait's equation", TAIT_EQUATION, upside_down=True),
    PairFault("pressure", "Tait's equation without its - 1", TAIT_EQUATION, rest=1.0),
    PairFault(
        "force",
        "slope of poly6 for the pressure force",
        "Use the spiky slope, -30/(pi h^5) (h - r)^2: that of poly6 vanishes at short distance, "
        "and particles pair up.",
        pairing=True,
    ),
    PairFault("force", "slope a third as large", _SLOPE, force=1 / 3),
    PairFault("force", "slope with the constant of three dimensions", IN_2D, solid_force=True),
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
        _SLOPE,
        force=1 / 3,
        rate=1 / 3,
    ),
    PairFault("force", "wrong sign", "Count the minus signs of the slope.", force=-1.0),
)

SOUND, LINEAR = PairFault(), PairFault("pressure", "linear gas law", exponent=1.0)


# A law explains a measurement if it is nowhere off by more than this share. A faulty law is
# believed only if every sound one is off by FAR or more, and so many times as far as the faulty
# one. Of some twenty kernels that are not in `KERNELS`, no faulty law is nearer than 33 %.
EXPLAINS, FAR = 0.02, 0.08
CLEARLY = 5.0
# Forces in c0^2 / h that rounding makes in tiny steps, where velocities are differences of x.
ROUNDING = 5e-3


class PairForces(NamedTuple):
    """Forces of pairs, measured in one case.

    ratio: h / dx; h [m]; c0 [m/s]; q: (k,) distances; force: (k,) positive where partners part;
    density: (k,) rho / rho0 if the solver shows it, else None. For continuity: start, (k,)
    distances at which they were rho0, and base, (k,) those whose forces are subtracted. partners:
    how many neighbours at the distance q each particle has.
    """

    ratio: float
    h: float
    c0: float
    q: Array
    force: Array
    density: Array | None = None
    start: Array | None = None
    base: Array | None = None
    partners: int = 1


class FittedPairLaw(NamedTuple):
    """A pair law that was compared with a measurement.

    fault: None for a sound law; error: the largest distance, as a share of the force there;
    scale: what forces had to be multiplied by.
    """

    density: str
    slope: str
    calibrated: bool
    form: float
    fault: PairFault | None
    error: float
    scale: float = 1.0

    def __str__(self) -> str:
        kernels = self.density if self.density == self.slope else f"{self.density}, {self.slope}"
        mass = "mass calibrated" if self.calibrated else "mass rho0 dx^2"
        form = "" if self.form == 1 else ", Mueller's force"
        return f"{kernels}; {mass}{form}" + (f"; {self.fault.name}" if self.fault else "")


_NAMES = list(KERNELS)
# Which kernels (density, slope) are used together.
_USUAL = np.array(
    [[a == b or a == "poly6" or b in ("spiky", "poly6") for b in _NAMES] for a in _NAMES]
)


def force(law: FittedPairLaw, one: PairForces, at: Array) -> Array:
    """Return the forces (k,) of a law for densities of pairs at one.q and slopes at `at`."""
    fault = law.fault or SOUND
    model = _model(one, fault, law.calibrated, at)
    return np.asarray(law.form * model[_NAMES.index(law.density), _NAMES.index(law.slope)])


def density(law: FittedPairLaw, one: PairForces) -> Array:
    """Return rho / rho0 (k,) that a law gives pairs at one.q."""
    rho = _densities(one, law.fault or SOUND, law.calibrated)[1]
    return np.asarray(rho[_NAMES.index(law.density)])


def laws(series: list[PairForces]) -> tuple[FittedPairLaw, FittedPairLaw]:
    """Return the best sound law and the best faulty one."""
    sound = min(_fits(series, SOUND), key=lambda law: law.error)
    moving = series[0].start is not None
    # where densities are measured, other checks have judged them
    links = ("pressure", "force") if series[0].density is not None else LINKS
    faults = [each for each in FAULTS if each.link in links or each.solid_density]
    faults = [each for each in faults if moving or each.rate == 1.0]
    faulty = min((law for f in faults for law in _fits(series, f)), key=lambda law: law.error)
    return sound._replace(fault=None), faulty


def scaled_law(series: list[PairForces]) -> FittedPairLaw:
    """Return the law that is best when forces are multiplied by one number, sound or linear."""
    found = [law for f in (SOUND, LINEAR) for law in _fits(series, f, scaled=True)]
    return min(found, key=lambda law: law.error)


def _fits(
    series: list[PairForces], fault: PairFault, scaled: bool = False
) -> Iterator[FittedPairLaw]:
    """Yield the law with the best kernels for each mass and form of the force."""
    for calibrated in (True, False):
        models = [_difference(one, fault, calibrated) for one in series]
        scale = _scale(models[0], series[0].force) if scaled else np.ones(models[0].shape[:2])
        for form in (1.0, 0.5):
            if form * fault.force == 1.0 and fault.force != 1.0:
                continue  # Mueller's form, counted twice, is the usual form
            error = np.zeros(scale.shape)
            for one, model in zip(series, models, strict=True):
                off = _error(form * scale[..., None] * model, one)
                error = np.maximum(error, np.where(np.isfinite(off), off, np.inf))
            if fault is not SOUND:
                # the more laws are tried, the sooner a wrong one fits by chance
                error = np.where(_USUAL, error, np.inf)
            i, j = np.unravel_index(np.argmin(error), error.shape)
            by = float(scale[i, j]) * form
            yield FittedPairLaw(
                _NAMES[i], _NAMES[j], calibrated, form, fault, float(error[i, j]), by
            )


def _scale(model: Array, force: Array) -> Array:
    """Return what to multiply each model (i, j, k) by, so that its largest force is measured."""
    most = int(np.argmax(np.abs(force)))
    with np.errstate(all="ignore"):
        return np.asarray(force[most] / model[..., most])


def _error(model: Array, one: PairForces) -> Array:
    """Return how far each model (i, j, k) is from the measured forces, at its worst distance."""
    rounding = ROUNDING if one.start is None else 0.0
    size = np.abs(one.force).max(initial=0.0)
    floor = 1e-3 * size + max(rounding, 1e-6)
    off = np.maximum(np.abs(model - one.force) - rounding, 0.0)
    return np.asarray((off / ((np.abs(model) + np.abs(one.force)) / 2 + floor)).max(axis=-1))


def _difference(one: PairForces, fault: PairFault, calibrated: bool) -> Array:
    model = _model(one, fault, calibrated)
    if one.base is None:
        return model
    return model - _model(one._replace(q=one.base), fault, calibrated)


def _model(one: PairForces, fault: PairFault, calibrated: bool, at: Array | None = None) -> Array:
    """Return the forces (density kernel, slope, distance) of a law; at: distances of slopes."""
    masses, rho = _densities(one, fault, calibrated)
    load = masses[:, None] * _pressure(rho, fault) / np.maximum(rho, 1e-12) ** 2
    q = (one.q if at is None else at) / fault.reach
    arm = q * fault.reach * one.h if fault.times_r else 1.0
    slopes = [
        kernel.slope(q) * (kernel.solid / one.h if fault.solid_force else 1.0) * arm
        if kernel.pairing == fault.pairing
        else np.full(len(q), np.nan)
        for kernel in KERNELS.values()
    ]
    factor = fault.force * fault.both * 2 / fault.reach**3
    return np.asarray(factor * load[:, None] * np.array(slopes)[None])


def _densities(one: PairForces, fault: PairFault, calibrated: bool) -> tuple[Array, Array]:
    """Return masses (kernel,) in rho0 h^2 and densities (kernel, distance) in rho0."""
    masses, rho, reach = [], [], fault.reach * fault.reach_density
    for kernel in KERNELS.values():
        constant = (kernel.solid / one.h if fault.solid_density else 1.0) / reach**2
        mass = fault.mass * _mass(kernel, one.ratio, calibrated, constant, reach)
        around = kernel.weight(one.q / reach)
        if one.start is None:
            own = fault.own * float(kernel.weight(np.zeros(1))[0])
            rho.append(mass * constant * (own + fault.both * one.partners * around))
        else:
            rho.append(
                1 + fault.rate * mass * constant * (around - kernel.weight(one.start / reach))
            )
        masses.append(mass)
    if one.density is not None:
        rho = [one.density] * len(masses)
    return np.array(masses), np.array(rho)


def _pressure(rho: Array, fault: PairFault) -> Array:
    """Return p / (rho0 c0^2)."""
    exponent = fault.exponent or GAMMA
    if fault.upside_down:
        rho = 1 / np.maximum(rho, 1e-12)
    p = fault.stiffness / exponent * (np.maximum(rho, 0.0) ** exponent - 1 + fault.rest)
    if fault.absolute:
        return np.abs(p)
    return np.maximum(p, 0.0) if fault.clamp else p


def _mass(kernel: Kernel, ratio: float, calibrated: bool, constant: float, reach: float) -> float:
    """Return the mass of a particle in rho0 h^2."""
    if not calibrated:
        return 1 / ratio**2
    return 1 / (constant * lattice_sum(kernel.weight, ratio * reach))
