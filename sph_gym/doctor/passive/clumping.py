"""Does suction make clumps, do particles come together in pairs or at one place?"""

import numpy as np

from sph_gym.doctor.findings import Finding, failed, inconclusive, passed, skipped
from sph_gym.doctor.passive.survey import Survey, nearest
from sph_gym.doctor.reading.frames import Array

# Particles nearer to each other than these shares of the spacing are clumped, or paired.
CLUMPED, PAIRED = 0.5, 0.3
# Nearer than this share, they are at one place.
SAME = 1e-6


def suction(survey: Survey) -> Finding:
    """Look for negative pressures together with particles that gather in clumps."""
    if survey.first.p is None or not survey.samples:
        return skipped("the recording has no pressures")
    negative = max(float((f.p < 0).mean()) for f in survey.samples if f.p is not None)
    before, after = (_share_nearer(f.x, CLUMPED * survey.spacing)
                     for f in (survey.samples[0], survey.samples[-1]))  # fmt: skip
    if negative > 0.05 and after > 0.2 > 0.05 > before:
        return failed(
            f"pressures of up to {100 * negative:.0f} % of the particles are negative, and "
            f"{100 * after:.0f} % of the particles end closer than {CLUMPED:g} spacings to another "
            f"({100 * before:.0f} % at the start): suction curdles the fluid",
            "Clamp pressures: p = max(0, p).",
            after,
            before,
            unit="share of clumped particles",
            tolerance="0.2",
        )
    text = "no negative pressures" if negative == 0 else (
        f"up to {100 * negative:.0f} % negative pressures, but no clumps"
    )  # fmt: skip
    return passed(text, after, before, unit="share of clumped particles", tolerance="0.2")


def clumping(survey: Survey) -> Finding:
    """Measure distances to the nearest neighbour: particles in pairs, or at one place."""
    if not survey.samples or len(survey.samples[0].x) < 8:
        return skipped("too few particles")
    frames, spacing = survey.samples, survey.spacing
    at_one_place = [_share_nearer(f.x, SAME * spacing) * len(f.x) for f in frames]
    worst = int(np.argmax(at_one_place))
    if at_one_place[worst] and not at_one_place[0]:
        return _coincident(survey, worst, round(at_one_place[worst]))
    before, after = (_share_nearer(f.x, PAIRED * spacing) for f in (frames[0], frames[-1]))
    negative = any((f.p < 0).any() for f in frames if f.p is not None)
    if after > 0.25 and before < 0.05:
        unclear = frames[0].p is None or negative
        return failed(
            f"{100 * after:.0f} % of the particles end closer than {PAIRED:g} spacings to another "
            f"({100 * before:.0f} % at the start)"
            + ("" if unclear else ", though no pressure is negative: they form pairs"),
            "Clamp pressures at zero first; then look at the gradient of the kernel for pressure: "
            "poly6's vanishes for near particles, spiky's doesn't."
            if unclear
            else "Take the gradient of the spiky kernel for pressure: poly6's vanishes for near "
            "particles. With other kernels, take fewer neighbours.",
            after,
            before,
            unit="share of paired particles",
            tolerance="0.25",
            link="pressure" if unclear else "",
        )
    return passed("particles keep their distance", after, before,
                  unit="share of paired particles", tolerance="0.25")  # fmt: skip


def _coincident(survey: Survey, worst: int, n: int) -> Finding:
    frame, spacing = survey.samples[worst], survey.spacing
    x = frame.x
    same = nearest(x) < SAME * spacing
    beside = np.isclose(x, x.min(axis=0), atol=SAME * spacing)
    beside |= np.isclose(x, x.max(axis=0), atol=SAME * spacing)
    where = survey.when(survey.sampled[worst])
    if beside.any(axis=1)[same].all():
        return inconclusive(
            f"{n} particles are at the place of another one in {where}, all of them at the border "
            "of the fluid: walls that clamp positions put them on top of each other in corners",
            n,
            0,
            unit="particles",
        )
    return failed(
        f"{n} particles are at the place of another one in {where}",
        "Particles at one place have no direction to part in: the pressure force must keep them "
        "from coming so close (sign, gradient of the kernel); a small random push parts those "
        "that did.",
        n,
        0,
        unit="particles",
    )


def _share_nearer(x: Array, distance: float) -> float:
    return float((nearest(x) < distance).mean()) if len(x) else 0.0
