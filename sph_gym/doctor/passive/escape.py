"""Do particles leave through walls, or far away from the fluid?"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, passed, skipped
from sph_gym.doctor.passive.survey import RecordingSurvey
from sph_gym.doctor.reading import Frame
from sph_gym.doctor.reading.frames import Array

# A path that crosses the border of the walls between two wall particles, each nearer than this
# [spacings], went through. What slides off the end of a wall has wall particles on one side only.
GAP = 0.9
# A particle is lost if it is this far from all others [their extent].
FAR = 3.0
_LEAK = (
    "Shorten the time step so that nothing crosses a wall in one; let walls clamp the position and "
    "reflect the normal velocity; or line them with boundary particles, as many layers as the "
    "support is wide. A side without any wall leaks from the start."
)


def escape(survey: RecordingSurvey) -> Result:
    """Look for particles beyond a known box, through walls of particles, or far from all others."""
    if not survey.samples or len(survey.first.x) < 8:
        return skipped("too few particles")
    scene = survey.known.scene
    walls = None if scene is None else scene.walls
    if walls is not None and (walls.is_periodic or walls.motion is not None):
        return inconclusive("walls that move and periodic sides are not judged")
    box = None if walls is None else walls.box
    if box is not None and (found := _beyond(survey, box)):
        return found
    followed = survey.change is None and not survey.reordered and not survey.walls_move
    if followed and survey.walls is not None and (found := _through(survey, survey.walls)):
        return found
    return _far(survey)


def _beyond(survey: RecordingSurvey, box: tuple[float, float, float, float]) -> Result | None:
    low, high = np.array(box[::2]), np.array(box[1::2])
    for k, frame in zip(survey.sampled, survey.samples, strict=True):
        depth = np.maximum(low - frame.x, frame.x - high).max(axis=1)
        i = int(np.argmax(depth))
        if depth[i] > survey.spacing:
            return failed(
                f"in {survey.when(k)}, {(depth > survey.spacing).sum()} particles are more than a "
                f"spacing outside the box; particle {survey.name(frame, i)} is at "
                f"({frame.x[i, 0]:.4g}, {frame.x[i, 1]:.4g}) m",
                _LEAK,
                Measured(
                    float(depth[i]) / survey.spacing, 0.0, unit="spacings outside", tolerance="1"
                ),
            )
    return None


def _through(survey: RecordingSurvey, walls: Array) -> Result | None:
    """Find a path that leaves the rectangle around fluid and walls where a wall particle is."""
    everything = np.concatenate([survey.first.x, walls])
    low, high = everything.min(axis=0), everything.max(axis=0)
    counts = [_outside(frame, low, high).sum() for frame in survey.samples]
    for k, last, before, after in zip(
        survey.sampled, survey.sampled[1:], counts, counts[1:], strict=False
    ):
        if after <= before:
            continue
        a = survey.fluid(k)
        for m in range(k + 1, last + 1):
            b = survey.fluid(m)
            if (found := _leak(survey, a, b, (low, high), walls)) is not None:
                return found
            a = b
    return None


def _leak(
    survey: RecordingSurvey, a: Frame, b: Frame, ends: tuple[Array, Array], walls: Array
) -> Result | None:
    i, points, axes = _crossing(a, b, *ends)
    leaks = np.array(
        [
            _is_between(p, axis, walls, GAP * survey.spacing)
            for p, axis in zip(points, axes, strict=True)
        ],
        bool,
    )
    if not leaks.any():
        return None
    first = int(np.argmax(leaks))
    return failed(
        f"between t = {a.time:.4g} s and {b.time:.4g} s, {leaks.sum()} particles leave the "
        f"rectangle around fluid and walls; particle {survey.name(a, int(i[first]))} does so "
        f"between wall particles, at ({points[first, 0]:.4g}, {points[first, 1]:.4g}) m",
        _LEAK,
        Measured(int(leaks.sum()), 0, unit="particles"),
    )


def _is_between(point: Array, axis: int, walls: Array, reach: float) -> bool:
    """Return whether wall particles are near, on both sides; axis: that along which it leaves."""
    away = walls - point
    near = (np.abs(away[:, axis]) < reach / 2) & (np.abs(away) < reach).all(axis=1)
    beside = np.delete(away[near], axis, axis=1)
    return bool((beside < 0).any() and (beside > 0).any())


def _outside(frame: Frame, low: Array, high: Array) -> NDArray[np.bool_]:
    return np.asarray(((frame.x < low) | (frame.x > high)).any(axis=1))


def _crossing(a: Frame, b: Frame, low: Array, high: Array) -> tuple[Any, Array, Any]:
    """Return which particles leave the rectangle, where (m, d) [m], and along which axes (m,)."""
    i = np.flatnonzero(~_outside(a, low, high) & _outside(b, low, high))
    start, way = a.x[i], b.x[i] - a.x[i]
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(way > 0, (high - start) / way, (low - start) / way)
    shares = np.where(way == 0, np.inf, shares)
    return i, start + shares.min(axis=1, initial=1.0)[:, None] * way, shares.argmin(axis=1)


def _far(survey: RecordingSurvey) -> Result:
    """Look for particles far from where all others are."""
    worst, where, n = 0.0, 0, 0
    for k, frame in zip(survey.sampled, survey.samples, strict=True):
        middle = np.median(frame.x, axis=0)
        size = np.quantile(np.abs(frame.x - middle), 0.9, axis=0).max() + survey.spacing
        away = np.abs(frame.x - middle).max(axis=1) / size
        if away.max() > worst:
            worst, where, n = float(away.max()), k, int((away > FAR).sum())
    numbers = Measured(worst, FAR, unit="extents of the fluid")
    if worst > FAR:
        return inconclusive(
            f"in {survey.when(where)}, {n} particles are more than {FAR:g} times as far from the "
            "middle as nine tenths of the fluid; without known walls this may be spray",
            numbers,
        )
    return passed("all particles stay together", numbers)
