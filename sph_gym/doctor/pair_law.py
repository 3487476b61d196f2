"""Which densities, equation of state and kernel make a measured force between two particles?

For solvers that show positions and velocities only. Everything is told without units: forces in
c0^2 / h, densities in rho0, distances in h.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import Array
from sph_gym.doctor.laws import KERNELS, Kernel, lattice_sum

# A law explains a measurement if it is nowhere off by more than this share, and a faulty law is
# believed only if every sound one is so many times as far off.
EXPLAINS = 0.02
CLEARLY = 5.0


class Series(NamedTuple):
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


class Fault(NamedTuple):
    """One thing that may be wrong in a pair law, and what it does to it.

    own: the particle's own share; solid_*: the constant of three dimensions; mass, force, both:
    factors of the mass, of the force, and of every sum over pairs; exponent, stiffness: of
    p = stiffness ((rho/rho0)^exponent - 1) / exponent, None for gamma; reach: of the kernels, in h.
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
    clamp: bool = True
    reach: float = 1.0
    pairing: bool = False


_GAMMA = 7.0
FAULTS = (
    Fault(
        "neighbours",
        "each pair counts twice",
        "Visit every pair once a particle: cells visited twice, or a list with both orders, "
        "double the sums.",
        both=2.0,
    ),
    Fault(
        "density",
        "no self-contribution",
        "Begin each sum with the particle's own share, rho[i] = m W(0, h).",
        own=0.0,
    ),
    Fault(
        "density",
        "self-contribution twice",
        "Add the particle's own share once: a search that also finds the particle itself adds it.",
        own=2.0,
    ),
    Fault(
        "density",
        "density kernel with the constant of three dimensions",
        "Use the constants of 2D: poly6 4/(pi h^8), cubic spline 40/(7 pi h^2).",
        solid_density=True,
    ),
    Fault(
        "density",
        "both kernels with the constants of three dimensions",
        "Use the constants of 2D: poly6 4/(pi h^8), spiky slope -30/(pi h^5).",
        solid_density=True,
        solid_force=True,
    ),
    Fault("density", "mass twice", "The mass is rho0 dx^2 in 2D.", mass=2.0),
    Fault("density", "mass half", "The mass is rho0 dx^2 in 2D.", mass=0.5),
    *(
        Fault(
            "density",
            f"kernel that ends at {reach:g} h",
            "case.h is the SUPPORT radius: a smoothing length is a half or a third of it.",
            reach=reach,
        )
        for reach in (0.5, 2.0, 1 / 3)
    ),
    Fault(
        "pressure",
        "B without gamma",
        "B is rho0 c0^2 / gamma.",
        stiffness=_GAMMA,
    ),
    Fault(
        "pressure",
        "linear gas law",
        "Use Tait's equation, p = B ((rho/rho0)^7 - 1) with B = rho0 c0^2 / 7.",
        exponent=1.0,
    ),
    Fault(
        "pressure",
        "linear gas law with Tait's B",
        "Use Tait's equation, p = B ((rho/rho0)^7 - 1): the exponent is missing.",
        exponent=1.0,
        stiffness=1 / _GAMMA,
    ),
    *(
        Fault(
            "pressure",
            f"exponent {gamma:g} instead of 7",
            "Tait's equation has the exponent gamma in both places, case.gamma.",
            exponent=gamma,
            stiffness=stiffness,
        )
        for gamma in (1.4, 2.0, 3.0, 5.0, 6.0, 8.0)
        for stiffness in (1.0, gamma / _GAMMA)
    ),
    Fault(
        "pressure",
        "pressures below zero",
        "Cut pressures off at zero: p = max(0, p).",
        clamp=False,
    ),
    Fault(
        "force",
        "slope of poly6 for the pressure force",
        "Use the spiky slope, -30/(pi h^5) (h - r)^2: that of poly6 vanishes at short distance, "
        "and particles pair up.",
        pairing=True,
    ),
    Fault(
        "force",
        "slope a third as large",
        "The slope of the spiky kernel in 2D is -30/(pi h^5) (h - r)^2, not -10/(pi h^5).",
        force=1 / 3,
    ),
    Fault(
        "force",
        "slope with the constant of three dimensions",
        "Use the slope of 2D: -30/(pi h^5) (h - r)^2 for the spiky kernel.",
        solid_force=True,
    ),
    Fault("force", "force twice", "Each pair is to push once.", force=2.0),
    Fault("force", "wrong sign", "Count the minus signs of the slope.", force=-1.0),
)


class Law(NamedTuple):
    """A pair law that was compared with a measurement.

    fault: None for a sound law; error: the largest distance, as a share of the force there;
    scale: what forces had to be multiplied by.
    """

    density: str
    slope: str
    calibrated: bool
    form: float
    fault: Fault | None
    error: float
    scale: float = 1.0

    def __str__(self) -> str:
        kernels = self.density if self.density == self.slope else f"{self.density}, {self.slope}"
        mass = "mass calibrated" if self.calibrated else "mass rho0 dx^2"
        form = "" if self.form == 1 else ", Mueller's force"
        return f"{kernels}; {mass}{form}" + (f"; {self.fault.name}" if self.fault else "")


_SOUND = Fault()
_NAMES = list(KERNELS)


def force(law: Law, one: Series, at: Array) -> Array:
    """Return the forces (k,) of a law for densities of pairs at one.q and slopes at `at`."""
    fault = law.fault or _SOUND
    model = _model(one, fault, law.calibrated, at)
    return np.asarray(law.form * model[_NAMES.index(law.density), _NAMES.index(law.slope)])


def density(law: Law, one: Series) -> Array:
    """Return rho / rho0 (k,) that a law gives pairs at one.q."""
    rho = _densities(one, law.fault or _SOUND, law.calibrated)[1]
    return np.asarray(rho[_NAMES.index(law.density)])


def laws(series: list[Series]) -> tuple[Law, Law]:
    """Return the best sound law and the best faulty one."""
    sound = min(_fits(series, _SOUND), key=lambda law: law.error)
    faulty = min((law for f in FAULTS for law in _fits(series, f)), key=lambda law: law.error)
    return sound._replace(fault=None), faulty


def scaled_law(series: list[Series]) -> Law:
    """Return the sound law that is best when all forces are multiplied by one number."""
    best = min(_fits(series, _SOUND, scaled=True), key=lambda law: law.error)
    return best._replace(fault=None)


def _fits(series: list[Series], fault: Fault, scaled: bool = False) -> Iterator[Law]:
    """Yield the law with the best kernels for each mass and form of the force."""
    for calibrated in (True, False):
        models = [_difference(one, fault, calibrated) for one in series]
        scale = _scale(models[0], series[0].force) if scaled else np.ones(models[0].shape[:2])
        for form in (1.0, 0.5):
            if form * fault.force == 1.0 and fault.force != 1.0:
                continue  # Mueller's form, counted twice, is the usual form
            error = np.zeros(scale.shape)
            for one, model in zip(series, models, strict=True):
                off = _error(form * scale[..., None] * model, one.force)
                error = np.maximum(error, np.where(np.isfinite(off), off, np.inf))
            i, j = np.unravel_index(np.argmin(error), error.shape)
            by = float(scale[i, j]) * form
            yield Law(_NAMES[i], _NAMES[j], calibrated, form, fault, float(error[i, j]), by)


def _scale(model: Array, force: Array) -> Array:
    """Return what to multiply each model (i, j, k) by, so that its largest force is measured."""
    most = int(np.argmax(np.abs(force)))
    with np.errstate(all="ignore"):
        return np.asarray(force[most] / model[..., most])


def _error(model: Array, force: Array) -> Array:
    """Return how far each model (i, j, k) is from a force (k,), at its worst distance."""
    size = np.abs(force).max(initial=0.0)
    floor = 1e-3 * size + 1e-6
    return np.asarray(
        (np.abs(model - force) / ((np.abs(model) + np.abs(force)) / 2 + floor)).max(axis=-1)
    )


def _difference(one: Series, fault: Fault, calibrated: bool) -> Array:
    model = _model(one, fault, calibrated)
    if one.base is None:
        return model
    return model - _model(one._replace(q=one.base), fault, calibrated)


def _model(one: Series, fault: Fault, calibrated: bool, at: Array | None = None) -> Array:
    """Return the forces (density kernel, slope, distance) of a law; at: distances of slopes."""
    masses, rho = _densities(one, fault, calibrated)
    load = masses[:, None] * _pressure(rho, fault) / np.maximum(rho, 1e-12) ** 2
    q = (one.q if at is None else at) / fault.reach
    slopes = [
        kernel.slope(q) * (kernel.solid / one.h if fault.solid_force else 1.0)
        if kernel.pairing == fault.pairing
        else np.full(len(q), np.nan)
        for kernel in KERNELS.values()
    ]
    factor = fault.force * fault.both * 2 / fault.reach**3
    return np.asarray(factor * load[:, None] * np.array(slopes)[None])


def _densities(one: Series, fault: Fault, calibrated: bool) -> tuple[Array, Array]:
    """Return masses (kernel,) in rho0 h^2 and densities (kernel, distance) in rho0."""
    masses, rho = [], []
    for kernel in KERNELS.values():
        constant = (kernel.solid / one.h if fault.solid_density else 1.0) / fault.reach**2
        mass = fault.mass * _mass(kernel, one.ratio, calibrated, constant, fault.reach)
        around = kernel.weight(one.q / fault.reach)
        if one.start is None:
            own = fault.own * float(kernel.weight(np.zeros(1))[0])
            rho.append(mass * constant * (own + fault.both * one.partners * around))
        else:
            rho.append(1 + mass * constant * (around - kernel.weight(one.start / fault.reach)))
        masses.append(mass)
    if one.density is not None:
        rho = [one.density] * len(masses)
    return np.array(masses), np.array(rho)


def _pressure(rho: Array, fault: Fault) -> Array:
    """Return p / (rho0 c0^2)."""
    exponent = fault.exponent or _GAMMA
    p = fault.stiffness / exponent * (np.maximum(rho, 0.0) ** exponent - 1)
    return np.maximum(p, 0.0) if fault.clamp else p


def _mass(kernel: Kernel, ratio: float, calibrated: bool, constant: float, reach: float) -> float:
    """Return the mass of a particle in rho0 h^2."""
    if not calibrated:
        return 1 / ratio**2
    return 1 / (constant * _lattice_sum(kernel.name, ratio * reach))


@lru_cache
def _lattice_sum(name: str, ratio: float) -> float:
    return lattice_sum(KERNELS[name].weight, ratio)
