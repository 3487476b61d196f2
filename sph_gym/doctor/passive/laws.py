"""Which of Tait's equations do the densities and pressures of a recording obey?"""

import math
from typing import NamedTuple

import numpy as np

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


def law(survey: RecordingSurvey) -> TaitFit | None:
    """Return the law of the recording's pressures, None if it can't be told."""
    if "law" not in survey.facts:
        pairs = [(f.rho, f.p) for f in survey.samples if f.rho is not None and f.p is not None]
        survey.facts["law"] = None
        if pairs:
            rho, p = (np.concatenate(column) for column in zip(*pairs, strict=True))
            survey.facts["law"] = fit(rho, p)
    found = survey.facts["law"]
    assert found is None or isinstance(found, TaitFit)
    return found


def sound_speed(survey: RecordingSurvey) -> float:
    """Return the speed of sound [m/s]: of the scene, or of the law if there is one; else NaN."""
    known, scene = survey.known, survey.known.scene
    if scene is not None and known.stiffness is not None:
        return scene.fluid.sound_speed(float(np.max(known.stiffness)))
    if scene is not None:
        return scene.fluid.c0
    found = law(survey)
    return math.nan if found is None or found.misfit > FITS else found.sound_speed
