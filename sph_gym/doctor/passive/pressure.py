"""Which equation of state do densities and pressures obey?"""

import numpy as np

from sph_gym.doctor.findings import Finding, failed, inconclusive, passed, skipped
from sph_gym.doctor.passive.laws import FITS, TaitFit, law
from sph_gym.doctor.passive.survey import RecordingSurvey

# Pressures may be so far off a known law, as a share of themselves.
EXACT = 0.02
# Exponents within so much of each other are told as one.
VAGUE = 1.0
# Correlation of density and pressure beyond which one falls as the other grows.
FALLING = 0.8


def equation_of_state(survey: RecordingSurvey) -> Finding:
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
            found.tie,
            1.0,
            unit="correlation of density and pressure",
            tolerance=f"above -{FALLING:g}",
        )
    if found.misfit > FITS:
        return inconclusive(
            f"pressure is no function of density: the best of Tait's equations leaves "
            f"{100 * found.misfit:.0f} % of it. Solvers of incompressible flow, gases, several "
            "fluids, and pressures that belong to another step's densities look like that",
            found.misfit,
            0.0,
            unit="share of the pressures' spread",
        )
    return _exponent(found)


def _exponent(found: TaitFit) -> Finding:
    """Return what is said of a law that fits."""
    # densities that hardly differ obey many an exponent
    vague = found.high - found.low > VAGUE
    numbers = (f"{found.low:.3g} to {found.high:.3g}" if vague else found.gamma, 7.0)
    told = (
        f"gamma = {found.gamma:.3g} ({found.low:.3g} to {found.high:.3g}), "
        f"B = {found.stiffness:.4g} Pa, rho0 = {found.rho0:.5g} kg/m^3, "
        f"c0 = {found.sound_speed:.4g} m/s"
    )
    if not found.rho0 > 0:
        return inconclusive(
            f"pressures never vanish: p = K rho^{found.gamma:.3g}, the law of a gas. For a liquid, "
            "take p = B ((rho / rho0)^7 - 1)",
            *numbers,
            unit="gamma",
        )
    if found.low <= 7 <= found.high:
        return passed(f"Tait's equation: {told}", *numbers, unit="gamma")
    if found.low <= 1 <= found.high:
        return inconclusive(
            f"the law is linear: {told}. It is a common one, but hardly resists strong "
            "compression; if the fluid looks like a gas, take gamma = 7",
            *numbers,
            unit="gamma",
        )
    return inconclusive(f"an unusual exponent: {told}", *numbers, unit="gamma")


def _against_scene(survey: RecordingSurvey, found: TaitFit | None) -> Finding:
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
    if off < EXACT * size:
        return passed("pressures follow the scene's equation of state", off / size, 0.0,
                      unit="share of the pressures", tolerance=f"{EXACT:g}")  # fmt: skip
    best = "" if found is None else f"gamma = {found.gamma:.3g} with B = {found.stiffness:.4g} Pa"
    return failed(
        f"pressures are not those of the scene's Tait equation (gamma = {scene.fluid.gamma:g}, B = "
        f"{stiffness[0]:.4g} Pa) at the recorded densities; what fits best is "
        f"{best or 'no such law'}",
        "p = B ((rho / rho0)^gamma - 1) with B = rho0 c0^2 / gamma, at the densities of the same "
        "step, cut off at zero if the scene says so.",
        off / size,
        0.0,
        unit="share of the pressures",
        tolerance=f"{EXACT:g}",
    )
