"""Do densities inside the fluid agree with how densely the particles are?"""

import math

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, passed, skipped
from sph_gym.doctor.passive.pressure import FITS, law
from sph_gym.doctor.passive.survey import RecordingSurvey, distances, nearest
from sph_gym.doctor.reading import Frame
from sph_gym.doctor.reading.frames import Array
from sph_gym.doctor.remedies import OWN_SHARE

# Crowding is measured with Wendland's kernel, over so many spacings and at most so many neighbours.
REACH, MOST = 2.2, 64
# Between these shares of the usual crowding, a particle is inside and hardly compressed.
INSIDE = (0.87, 1.25)
CLUMPED = 0.5
# So many particles, spread over all, are looked at.
ENOUGH = 4000
# A density may be off so much where the crowding is as usual; in at most this share of particles.
OFF, FEW = 0.5, 0.05
# The density of a lattice may miss that of rest so far: kernels that aren't matched read 0.8 to
# 1.27. And what spacings aren't known of may begin with at most this share of it.
REST, PRESSED = (0.7, 1.4), 1.6


def interior_density(survey: RecordingSurvey) -> Result:
    """Compare densities of particles inside the fluid with those of the start and of rest."""
    if survey.first.rho is None:
        return skipped("the recording has no densities")
    frames = [f for f in survey.samples if f.rho is not None and (f.rho != 0).any()]
    if not frames or len(frames[0].x) < 20:
        return skipped("too few particles, or densities that are all zero")
    for frame in frames:
        assert frame.rho is not None
        if (frame.rho <= 0).any():
            return _not_positive(survey, frame)
    return _against_crowding(survey, frames)


def _against_crowding(survey: RecordingSurvey, frames: list[Frame]) -> Result:
    rows = np.arange(0, len(frames[0].x), max(1, len(frames[0].x) // ENOUGH))
    rows = rows[rows < min(len(frame.x) for frame in frames)]
    crowding = [_crowding(survey, frame, rows) for frame in frames]
    frames = [frame.part(rows) for frame in frames]
    usual = float(np.median(crowding[0][crowding[0] >= np.median(crowding[0])]))
    inside = [_is_inside(each, usual) for each in crowding]
    if inside[0].sum() < 10:
        return inconclusive("hardly any particle is surrounded by others at the start")
    medians = [
        float(np.median(f.rho[m]))
        for f, m in zip(frames, inside, strict=True)
        if f.rho is not None and m.sum() >= 10
    ]
    rest, (low, high) = _rest(survey)
    if not math.isnan(rest) and not low < medians[0] / rest < high:
        return _not_at_rest(medians[0], rest)
    if _never_renewed(survey, frames, np.abs(crowding[0] - crowding[-1]) / usual):
        return failed(
            "every particle keeps the density of frame 0 to the last digit, while those around it "
            "change",
            "Sum the densities in every step, after particles have moved and before pressures are "
            "computed.",
            Measured("the same", "another one"),
        )
    if survey.change is None and not survey.reordered:
        worst = max(
            _share_off(frames[0], f, inside[0] & m) for f, m in zip(frames, inside, strict=True)
        )
        if worst > FEW:
            return _disagrees(worst)
    expected = medians[0] if math.isnan(rest) else rest
    return passed(
        "densities inside the fluid stay near rest",
        Measured(
            medians[-1],
            expected,
            unit="kg/m^3, median inside",
            tolerance="half, where as many particles are near as at the start",
        ),
    )


def _rest(survey: RecordingSurvey) -> tuple[float, tuple[float, float]]:
    """Return the density at rest [kg/m^3], and between which shares of it a flow may begin.

    It is that of the scene, or where pressures vanish; NaN where there is neither.
    """
    scene = survey.known.scene
    if scene is not None:
        usual = abs(float(np.median(nearest(survey.first.x))) / scene.dx - 1) < 0.1
        return scene.fluid.rho0, REST if usual else (0.0, math.inf)
    found = law(survey)
    vanish = any((p <= 0).any() for p in survey.pressures)
    if not vanish:
        return math.nan, (0.0, math.inf)  # a background pressure hides the density at rest
    # a fluid may begin in loose order, but hardly pressed to a multiple of its density
    return math.nan if found is None or found.misfit > FITS else found.rho0, (0.0, PRESSED)


def _never_renewed(survey: RecordingSurvey, frames: list[Frame], change: Array) -> bool:
    """Return whether densities stay though crowding does not; those of several fluids may.

    change: (n,) of the crowding, as a share of the usual one.
    """
    first, last = frames[0], frames[-1]
    assert first.rho is not None
    assert last.rho is not None
    if survey.change is not None or survey.reordered or len(frames) < 2:
        return False
    kinds = len(np.unique(first.rho))
    same = bool((first.rho == last.rho).all())
    return same and kinds > 0.1 * len(first.rho) and float(np.median(change)) > 0.02


def _crowding(survey: RecordingSurvey, frame: Frame, rows: NDArray[np.int64]) -> Array:
    """Return, for some particles, the sum of a kernel over fluid and walls.

    Only ratios of such sums mean anything.
    """
    walls = survey.walls
    others = frame.x if walls is None else np.concatenate([frame.x, walls])
    reach = REACH * survey.spacing
    found = distances(frame.x[rows], others, min(MOST, len(others)), reach)
    q = np.minimum(found / reach, 1.0)
    sums = np.asarray(((1 - q) ** 4 * (1 + 4 * q)).sum(axis=1), np.float64)
    # in a clump, the sum depends on the kernel more than on how many are near
    return np.where(found[:, 1] < CLUMPED * survey.spacing, np.inf, sums)


def _is_inside(crowding: Array, usual: float) -> NDArray[np.bool_]:
    low, high = INSIDE
    return (crowding > low * usual) & (crowding < high * usual)


def _share_off(first: Frame, frame: Frame, inside: NDArray[np.bool_]) -> float:
    """Return the share of particles, inside both times, whose density has changed too much."""
    assert first.rho is not None
    assert frame.rho is not None
    if inside.sum() < 20:
        return 0.0
    return float((np.abs(frame.rho[inside] / first.rho[inside] - 1) > OFF).mean())


def _not_positive(survey: RecordingSurvey, frame: Frame) -> Result:
    assert frame.rho is not None
    i = int(np.argmin(frame.rho))
    return failed(
        f"particle {survey.name(frame, i)} has a density of {frame.rho[i]:.4g} kg/m^3 at t = "
        f"{frame.time:.4g} s; {(frame.rho <= 0).sum()} particles have none above zero",
        OWN_SHARE,
        Measured(float(frame.rho[i]), "above 0", unit="kg/m^3"),
    )


def _not_at_rest(measured: float, rest: float) -> Result:
    return failed(
        f"inside the fluid, the median density of frame 0 is {measured:.4g} kg/m^3; the fluid "
        f"is at rest at {rest:.4g}",
        "Look at the mass of a particle, rho0 dx^2 in two dimensions; at the constant of the "
        "kernel, 2D or 3D; at the neighbours that are summed over.",
        Measured(
            measured,
            rest,
            unit="kg/m^3",
            tolerance=f"{REST[0]:g} to {REST[1]:g} times, {PRESSED:g} if the spacing isn't known",
        ),
    )


def _disagrees(share: float) -> Result:
    return failed(
        f"{100 * share:.0f} % of the particles inside the fluid have a density that is more than "
        "half off what they started with, while as many others as then are near them: the same sum "
        "over the same neighbours doesn't change",
        "Compare the neighbours with those of a search through all pairs: lists may be old, cells "
        "too small, columns left out, or pairs counted twice.",
        Measured(share, 0.0, unit="share of the particles inside", tolerance=f"{FEW:g}"),
        link="neighbours",
    )
