"""Do particles move as their velocities say, and at speeds and energies that can be?"""

import math
from typing import NamedTuple

import numpy as np

from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, passed, skipped
from sph_gym.doctor.passive.pressure import sound_speed
from sph_gym.doctor.passive.survey import RecordingSurvey
from sph_gym.doctor.reading import Frame

# A velocity is steady if it changes by less than this share of itself from frame to frame.
STEADY = 0.2
# Displacements may differ from time x velocity by this share.
TOLERANCE = 0.15
# A particle that moves this far in all, and this far from one frame to the next, can't be one that
# stays in place [spacings].
SHORT, CREEP = 1.0, 0.02
# Mach numbers above the first are no weakly compressible flow; above the second, the fluid burst.
FAST, BURST = 0.3, 2.0
# More than these shares of the particles.
FEW, MANY = 0.01, 0.05


class FrameStep(NamedTuple):
    """Motion of particles between two frames.

    told, shown: time [s] between the frames by the file, and by displacements over velocities;
    steady: share of the moving particles whose velocity changes little; aside: median part of the
    displacement that is not along the velocity, as a share of it.
    """

    told: float
    shown: float
    steady: float
    aside: float


def motion(survey: RecordingSurvey) -> Result:
    """Compare displacements between frames with velocities, for particles of steady velocity."""
    if survey.first.v is None:
        return skipped("the recording has no velocities")
    if survey.reordered:
        return skipped("particles can't be followed from frame to frame")
    steps = [_step(a, b, survey.interval(k)) for k, a, b in survey.pairs()]
    usable = [step for step in steps if step is not None and step.steady > 0.5]
    if len(usable) < 2:
        return inconclusive(
            "velocities change too much from frame to frame to be compared with displacements; "
            "frames closer to each other would tell"
        )
    along = [step for step in usable if step.aside < 0.3]
    if len(along) < len(usable) / 2:
        return _unrelated(usable)
    shown = np.array([step.shown for step in along])
    ratios = shown / np.array([step.told for step in along])
    if not np.isfinite(ratios).all():
        return inconclusive(
            f"particles move along their velocities, {np.median(shown):.4g} s a frame; the "
            "recording doesn't tell the times, so it can't be said whether that is right"
        )
    ratio = float(np.median(ratios))
    if abs(ratio - 1) >= TOLERANCE and np.ptp(ratios) < 0.3 * abs(ratio):
        return failed(
            f"between frames, particles move along their velocities, but {ratio:.4g} times as far "
            f"as time and velocity say, in {len(along)} pairs of frames alike",
            "Is x changed by dt * v, with the whole dt, once a step? If the factor is a power of "
            "ten, times, velocities or positions are written in other units.",
            Measured(ratio, 1.0, unit="m / m", tolerance="15 %"),
        )
    if abs(ratio - 1) >= TOLERANCE:
        return inconclusive(
            "particles move farther than they should in some frames", Measured(ratio, 1.0)
        )
    return passed(
        "particles move as far as their velocities say", Measured(ratio, 1.0, tolerance="15 %")
    )


def _unrelated(steps: list[FrameStep]) -> Result:
    aside = float(np.median([step.aside for step in steps]))
    return failed(
        "velocities hardly change from frame to frame, and yet particles move across them: "
        f"{100 * aside:.0f} % of the displacement is not along the velocity",
        "Does every velocity belong to its particle? If positions are sorted into cells, sort "
        "velocities too. Else look at what else moves particles: XSPH adds a small share of the "
        "velocities around, divided by the density.",
        Measured(aside, 0.0, unit="share of the displacement", tolerance="0.3"),
    )


def _step(a: Frame, b: Frame, told: float) -> FrameStep | None:
    """Return how particles move between two frames; None if too few move to tell."""
    assert a.v is not None
    assert b.v is not None
    mean = (a.v + b.v) / 2
    speed, change = np.linalg.norm(mean, axis=1), np.linalg.norm(b.v - a.v, axis=1)
    moving = speed > 0.1 * speed.max(initial=0.0)
    steady = moving & (change < STEADY * speed)
    if steady.sum() < 5:
        return None
    way = (b.x - a.x)[steady]
    times = (way * mean[steady]).sum(axis=1) / speed[steady] ** 2
    length = np.linalg.norm(way, axis=1)
    aside = np.linalg.norm(way - times[:, None] * mean[steady], axis=1)
    share = aside / np.maximum(length, 1e-300)
    return FrameStep(
        told, float(np.median(times)), steady.sum() / moving.sum(), float(np.median(share))
    )


def frozen(survey: RecordingSurvey) -> Result:
    """Look for particles that have a velocity and stay where they are, in all frames."""
    if survey.first.v is None or survey.reordered or survey.change is not None:
        return skipped("needs velocities, and the same particles in all frames")
    if survey.n_frames < 3:
        return skipped(f"{survey.n_frames} frames are too few to tell")
    step = survey.interval(0)
    if not math.isfinite(step):
        return skipped("the recording doesn't tell the times")
    sizes = [np.linalg.norm(frame.v, axis=1) for frame in survey.samples if frame.v is not None]
    speed = np.median(sizes, axis=0)
    whole = survey.looks[-1].time - survey.looks[0].time
    # what gravity gives in a single step to a particle that a wall holds is no motion
    way, slow = SHORT * survey.spacing, speed * step < CREEP * survey.spacing
    stuck = survey.still & (speed * whole > way) & ~slow
    if not stuck.any():
        return passed(
            "every particle with a velocity moves", Measured(0, 0, unit="particles stuck")
        )
    x, i = survey.first.x, int(np.argmax(stuck))
    beside = np.minimum(x - x.min(axis=0), x.max(axis=0) - x).min(axis=1) < 0.1 * survey.spacing
    clamped = bool(beside[stuck].all()) and not survey.still.all()
    return failed(
        f"{stuck.sum()} particles, {survey.name(survey.first, i)} the first, stay at their place "
        "in all frames, though by their velocities they move a spacing and more",
        "Reflect or clear the normal velocity where a wall clamps a position."
        if clamped
        else "Is x changed in every step, for every particle, and is the x that is written the one "
        "that is changed?",
        Measured(int(stuck.sum()), 0, unit="particles"),
        link="walls" if clamped else "",
    )


def speeds(survey: RecordingSurvey) -> Result:
    """Compare speeds with the speed of sound, told or found in the equation of state."""
    if survey.first.v is None:
        return skipped("the recording has no velocities")
    c = sound_speed(survey)
    if not math.isfinite(c):
        return skipped("the speed of sound is neither told nor to be found from rho and p")
    shares = []
    for frame in survey.samples:
        assert frame.v is not None
        speed = np.linalg.norm(frame.v, axis=1)
        shares.append([(speed > limit * c).mean() for limit in (FAST, BURST)])
    fast, burst = np.max(shares, axis=0)
    return _judged(float(fast), float(burst), c, max(look.top_speed for look in survey.looks) / c)


def _judged(fast: float, burst: float, c: float, top: float) -> Result:
    if burst > MANY:
        return failed(
            f"{100 * burst:.0f} % of the particles are faster than {BURST:g} times the speed of "
            f"sound ({c:.4g} m/s): the fluid burst",
            "Halve the time step first; if it still bursts, look at the sign and the symmetry of "
            "the pressure force, then at the stiffness.",
            Measured(
                top,
                0.1,
                unit="largest Mach number",
                tolerance=f"at most {BURST:g} but for {100 * MANY:.0f} % of the particles",
            ),
        )
    if fast > FEW:
        return inconclusive(
            f"{100 * fast:.0f} % of the particles are faster than {FAST:g} times the speed of "
            f"sound ({c:.4g} m/s): the fluid isn't weakly compressible any more. A speed of sound "
            "ten times the largest speed keeps it so",
            Measured(top, 0.1, unit="largest Mach number"),
        )
    return passed(
        "speeds are well below that of sound",
        Measured(
            top,
            0.1,
            unit="largest Mach number",
            tolerance=f"at most {FAST:g} but for 1 % of the particles",
        ),
    )
