"""Which equation of state do densities and pressures obey?"""

import math
from typing import NamedTuple

import numpy as np

from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, passed, skipped
from sph_gym.doctor.lab import once
from sph_gym.doctor.passive.survey import RecordingSurvey
from sph_gym.doctor.reading.frames import Array

GAMMAS = np.arange(0.5, 12.01, 0.25)
# Pressures may be so far off a law, as a share of how much they differ from each other.
FITS = 0.02
# A density at rest below this share of all densities is none: p = K rho^gamma, a gas.
LEAST = 0.3


class TaitFit(NamedTuple):
    """Tait's equation p = B ((rho / rho0)^gamma - 1), as found.

    stiffness and rho0 are NaN for a law without a density at rest. low, high: between which gamma
    may be; misfit: root mean square of what the law leaves, as a share of the standard deviation of
    p; tie: correlation of density and pressure.
    """

    gamma: float
    stiffness: float
    rho0: float
    low: float
    high: float
    misfit: float
    tie: float

    @property
    def sound_speed(self) -> float:
        """Return the speed of sound [m/s] at rest, NaN if the law has none."""
        square = self.gamma * self.stiffness / self.rho0
        return math.sqrt(square) if square > 0 else math.nan


def fit(rho: Array, p: Array) -> TaitFit | None:
    """Return the law that fits best; rho, p: (m,). None if there is too little to fit."""
    kept = np.isfinite(rho) & np.isfinite(p) & (p != 0) & (rho > 0)
    rho, p = rho[kept], p[kept]
    if len(rho) < 20 or np.ptp(p) == 0 or np.ptp(rho) < 1e-5 * np.median(rho):
        return None
    middle = float(np.median(rho))
    misfits = np.array([_misfit(rho / middle, p, gamma) for gamma in GAMMAS])
    best = float(GAMMAS[np.argmin(misfits)])
    fine = best + np.arange(-0.25, 0.2501, 0.01)
    fine = fine[fine > 0.1]
    of_fine = np.array([_misfit(rho / middle, p, gamma) for gamma in fine])
    gamma, misfit = float(fine[np.argmin(of_fine)]), float(of_fine.min())
    # all that fit hardly worse: small differences of density don't tell one from the other
    alike = np.concatenate([GAMMAS[misfits < 2 * misfit + 1e-5], [gamma]])
    slope, constant = _line((rho / middle) ** gamma, p)
    tie = float(np.corrcoef(rho, p)[0, 1])
    rho0 = middle * (-constant / slope) ** (1 / gamma) if slope > 0 > constant else math.nan
    if not rho0 > LEAST * rho.min():
        return TaitFit(gamma, math.nan, math.nan, *_ends(alike), misfit, tie)
    return TaitFit(gamma, -constant, rho0, *_ends(alike), misfit, tie)


def _ends(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _line(x: Array, y: Array) -> tuple[float, float]:
    away = x - x.mean()
    slope = float((away * y).sum() / (away * away).sum())
    return slope, float(y.mean() - slope * x.mean())


def _misfit(ratio: Array, p: Array, gamma: float) -> float:
    x = ratio**gamma
    for _ in range(2):
        slope, constant = _line(x, p)
        off = np.abs(p - slope * x - constant)
        # a few particles may obey another law: ghosts, or those that walls treat otherwise
        near = off <= np.quantile(off, 0.95)
        if near.sum() < 10 or np.ptp(x[near]) == 0:
            break
        slope, constant = _line(x[near], p[near])
    rest = (p - slope * x - constant)[near]
    return float(np.sqrt((rest**2).mean()) / np.std(p))


@once
def law(survey: RecordingSurvey) -> TaitFit | None:
    """Return the law of the recording's pressures, None if it can't be told."""
    pairs = [(f.rho, f.p) for f in survey.samples if f.rho is not None and f.p is not None]
    if not pairs:
        return None
    rho, p = (np.concatenate(column) for column in zip(*pairs, strict=True))
    return fit(rho, p)


def sound_speed(survey: RecordingSurvey) -> float:
    """Return the speed of sound [m/s]: of the scene, or of the law if there is one; else NaN."""
    known, scene = survey.known, survey.known.scene
    if scene is not None and known.stiffness is not None:
        return scene.fluid.sound_speed(float(np.max(known.stiffness)))
    if scene is not None:
        return scene.fluid.c0
    found = law(survey)
    return math.nan if found is None or found.misfit > FITS else found.sound_speed


# Pressures may be so far off a known law, as a share of themselves.
EXACT = 0.02
# Exponents within so much of each other are told as one.
VAGUE = 1.0
# Correlation of density and pressure beyond which one falls as the other grows.
FALLING = 0.8


def equation_of_state(survey: RecordingSurvey) -> Result:
    """Fit Tait's equation to densities and pressures, or compare them with the scene's."""
    if survey.first.rho is None or survey.first.p is None:
        return skipped("the recording has no densities and pressures")
    found = law(survey)
    if survey.known.scene is not None and survey.known.stiffness is not None:
        return _against_scene(survey, found)
    if found is None:
        return inconclusive("too few pressures differ from zero and each other to tell a law")
    if found.tie < -FALLING:
        return failed(
            "the larger the density, the smaller the pressure: compression pulls instead of "
            "pushing back",
            "p = B ((rho / rho0)^gamma - 1): look at the sign, and at which density divides which.",
            Measured(
                found.tie,
                1.0,
                unit="correlation of density and pressure",
                tolerance=f"above -{FALLING:g}",
            ),
        )
    if found.misfit > FITS:
        return inconclusive(
            f"pressure is no function of density: the best of Tait's equations leaves "
            f"{100 * found.misfit:.0f} % of it. Solvers of incompressible flow, gases, several "
            "fluids, and pressures that belong to another step's densities look like that",
            Measured(found.misfit, 0.0, unit="share of the pressures' spread"),
        )
    return _exponent(found)


def _exponent(found: TaitFit) -> Result:
    """Return what is said of a law that fits."""
    # densities that hardly differ obey many an exponent
    vague = found.high - found.low > VAGUE
    told = (
        f"gamma = {found.gamma:.3g} ({found.low:.3g} to {found.high:.3g}), "
        f"B = {found.stiffness:.4g} Pa, rho0 = {found.rho0:.5g} kg/m^3, "
        f"c0 = {found.sound_speed:.4g} m/s"
    )
    numbers = Measured(
        f"{found.low:.3g} to {found.high:.3g}" if vague else found.gamma, 7.0, unit="gamma"
    )
    if not found.rho0 > 0:
        return inconclusive(
            f"pressures never vanish: p = K rho^{found.gamma:.3g}, the law of a gas. For a liquid, "
            "take p = B ((rho / rho0)^7 - 1)",
            numbers,
        )
    if found.low <= 7 <= found.high:
        return passed(f"Tait's equation: {told}", numbers)
    if found.low <= 1 <= found.high:
        return inconclusive(
            f"the law is linear: {told}. It is a common one, but hardly resists strong "
            "compression; if the fluid looks like a gas, take gamma = 7",
            numbers,
        )
    return inconclusive(f"an unusual exponent: {told}", numbers)


def _against_scene(survey: RecordingSurvey, found: TaitFit | None) -> Result:
    scene, stiffness = survey.known.scene, survey.known.stiffness
    assert scene is not None
    assert stiffness is not None
    off, size = 0.0, 0.0
    for k, frame in zip(survey.sampled, survey.samples, strict=True):
        assert frame.rho is not None
        assert frame.p is not None
        expected = stiffness[k] * ((frame.rho / scene.fluid.rho0) ** scene.fluid.gamma - 1)
        if scene.fluid.clamp:
            expected = np.maximum(expected, 0.0)
        off = max(off, float(np.sqrt(((frame.p - expected) ** 2).mean())))
        size = max(size, float(np.sqrt((expected**2).mean())))
    # where all are clamped, rounding is compared with what a compression by 1 % would be
    size = max(size, 0.01 * scene.fluid.gamma * float(stiffness.max()))
    numbers = Measured(off / size, 0.0, unit="share of the pressures", tolerance=f"{EXACT:g}")
    if off < EXACT * size:
        return passed("pressures follow the scene's equation of state", numbers)
    best = "" if found is None else f"gamma = {found.gamma:.3g} with B = {found.stiffness:.4g} Pa"
    return failed(
        f"pressures are not those of the scene's Tait equation (gamma = {scene.fluid.gamma:g}, B = "
        f"{stiffness[0]:.4g} Pa) at the recorded densities; what fits best is "
        f"{best or 'no such law'}",
        "p = B ((rho / rho0)^gamma - 1) with B = rho0 c0^2 / gamma, at the densities of the same "
        "step, cut off at zero if the scene says so.",
        numbers,
    )
