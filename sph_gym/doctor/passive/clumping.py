"""Does suction make clumps, do particles come together in pairs or at one place?"""

import numpy as np

from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, passed, skipped
from sph_gym.doctor.passive.survey import RecordingSurvey, nearest
from sph_gym.doctor.reading.frames import Array
from sph_gym.doctor.remedies import CLAMP

# Particles nearer to each other than these shares of the spacing are clumped, or paired.
CLUMPED, PAIRED = 0.5, 0.3
# Nearer than this share of it, they are at one place.
SAME = 1e-6
# Shares of the particles: what is usual, what is odd, what is a fault.
USUAL, ODD, CURDLED = 0.05, 0.2, 0.4
UNIT = "share of the particles"


def suction(survey: RecordingSurvey) -> Result:
    """Look for negative pressures together with particles that gather in clumps."""
    if survey.first.p is None or not survey.samples:
        return skipped("the recording has no pressures")
    negative = max(float((p < 0).mean()) for p in survey.pressures)
    shares = [_share_nearer(f.x, CLUMPED * survey.spacing) for f in survey.samples]
    before, worst = shares[0], max(shares)
    numbers = Measured(worst, before, unit=UNIT, tolerance=f"{CURDLED:g}")
    if negative < USUAL or before > USUAL or worst < ODD:
        text = f"up to {100 * negative:.0f} % negative pressures, and no clumps by them"
        return passed(text, numbers)
    text = (
        f"pressures of up to {100 * negative:.0f} % of the particles are negative, and "
        f"{100 * worst:.0f} % come closer than {CLUMPED:g} spacings to another "
        f"({100 * before:.0f} % at the start)"
    )
    scene = survey.known.scene
    if worst < CURDLED or (scene is not None and not scene.fluid.clamp):
        return inconclusive(
            f"{text}; with p = max(0, p) they might not", Measured(worst, before, unit=UNIT)
        )
    return failed(f"{text}: suction curdles the fluid", CLAMP, numbers)


def clumping(survey: RecordingSurvey) -> Result:
    """Measure distances to the nearest neighbour: particles in pairs, or at one place."""
    if not survey.samples or len(survey.samples[0].x) < 8:
        return skipped("too few particles")
    at_one_place = [_share_nearer(f.x, SAME * survey.spacing) for f in survey.samples]
    worst = int(np.argmax(at_one_place))
    if at_one_place[worst] and not at_one_place[0]:
        return _coincident(survey, worst)
    shares = [_share_nearer(f.x, PAIRED * survey.spacing) for f in survey.samples]
    if shares[-1] > CURDLED and shares[0] < USUAL:
        return _paired(survey, shares)
    text = "particles keep their distance"
    return passed(text, Measured(shares[-1], shares[0], unit=UNIT, tolerance=f"{CURDLED:g}"))


def _paired(survey: RecordingSurvey, shares: list[float]) -> Result:
    text = (
        f"{100 * shares[-1]:.0f} % of the particles end closer than {PAIRED:g} spacings to another "
        f"({100 * shares[0]:.0f} % at the start)"
    )
    numbers = Measured(shares[-1], shares[0], unit=UNIT, tolerance=f"{CURDLED:g}")
    if survey.pressures and not any((p < 0).any() for p in survey.pressures):
        return failed(
            f"{text}, though no pressure is negative: they form pairs",
            "Take the gradient of the spiky kernel for pressure: poly6's vanishes for near "
            "particles. With other kernels, take fewer neighbours.",
            numbers,
        )
    return failed(
        f"{text}; there are negative pressures or none at all in the recording",
        "Clamp pressures at zero first; then look at the gradient of the kernel for pressure: "
        "poly6's vanishes for near particles, spiky's doesn't.",
        numbers,
        link="pressure",
    )


def _coincident(survey: RecordingSurvey, worst: int) -> Result:
    frame, room = survey.samples[worst], SAME * survey.spacing
    x = frame.x
    same = nearest(x) < room
    beside = np.isclose(x, x.min(axis=0), rtol=0, atol=room)
    beside |= np.isclose(x, x.max(axis=0), rtol=0, atol=room)
    text = f"{same.sum()} particles are at the place of another one in "
    text += survey.when(survey.sampled[worst])
    if beside.any(axis=1)[same].all():
        return inconclusive(
            f"{text}, all of them at the border of the fluid: walls that clamp positions put them "
            "on top of each other in corners",
            Measured(int(same.sum()), 0, unit="particles"),
        )
    return _on_top(survey, text, int(same.sum()))


def _on_top(survey: RecordingSurvey, text: str, n: int) -> Result:
    numbers = Measured(n, 0, unit="particles")
    if survey.pressures and not any(p.any() for p in survey.pressures):
        return failed(
            f"{text}, and all pressures of all frames are zero: nothing keeps particles apart",
            "Densities that never come above that of rest give no pressure: look at the mass of a "
            "particle, rho0 dx^2 in two dimensions, and at the constant of the kernel.",
            numbers,
            link="density",
        )
    return failed(
        text,
        "Particles at one place have no direction to part in: the pressure force must keep them "
        "from coming so close (sign, gradient of the kernel); a small random push parts those "
        "that did.",
        numbers,
    )


def _share_nearer(x: Array, distance: float) -> float:
    return float((nearest(x) < distance).mean()) if len(x) else 0.0
