"""Does the momentum of a free flow stay, does spurious energy appear?"""

import math

import numpy as np

from sph_gym.doctor.case import tait_energy
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, passed, skipped
from sph_gym.doctor.passive.pressure import sound_speed
from sph_gym.doctor.passive.survey import RecordingSurvey
from sph_gym.doctor.reading.frames import Array
from sph_gym.solver.gravity import Gravity
from sph_gym.solver.scene import Scene

# Momentum may change by this share of what the particles have without their directions.
DRIFT = 0.01
UNIT = "change of the mean velocity, as a share of the speeds"
# Spurious energy, as a share of what is at stake: kernels that aren't matched heat a little.
SURPLUS = 0.3
# The fluid burst if its mean kinetic energy is above this share of c0^2 / 2.
BURST = 1.0


def momentum(survey: RecordingSurvey) -> Result:
    """Compare the mean velocity of the fluid with that of a free fall."""
    looks, scene = survey.looks, survey.known.scene
    if survey.first.v is None or survey.change is not None or len(looks) < 3:
        return skipped("needs velocities, the same particles in all frames, and three frames")
    times = survey.times
    mean = np.array([look.velocity for look in looks])
    size = math.sqrt(2 * max(look.kinetic for look in looks))
    change = mean - mean[0]
    off = float(np.abs(change).max()) / max(size, 1e-300)
    if scene is not None:
        return _free_fall(survey, scene, change, size)
    numbers = Measured(off, 0.0, unit=UNIT)
    if off < DRIFT:
        return passed("the momentum stays: no force from outside acts", numbers)
    if np.isfinite(times).all() and np.ptp(times) > 0:
        g = np.array([np.polyfit(times - times[0], column, 1)[0] for column in change.T])
        rest = change - g * (times - times[0])[:, None]
        if np.abs(rest - rest.mean(axis=0)).max() < DRIFT * size:
            text = ", ".join(f"{part:.4g}" for part in g)
            return passed(f"the momentum changes as under a gravity of ({text}) m/s^2")
    return inconclusive(
        "the momentum changes; what walls and gravity do to it can't be told", numbers
    )


def _free_fall(survey: RecordingSurvey, scene: Scene, change: Array, size: float) -> Result:
    """Compare the change of the mean velocity (frames, d) with what the scene's gravity does."""
    if scene.walls is not None or not _uniform(scene):
        return inconclusive("walls and forces from outside change the momentum")
    fall = scene.effects.gravity_at(0.0) * (survey.times - survey.times[0])[:, None]
    off = float(np.abs(change - fall).max()) / max(size, 1e-300)
    numbers = Measured(off, 0.0, unit=UNIT, tolerance=f"{DRIFT:g}")
    if off < DRIFT:
        return passed("the momentum is that of a free fall", numbers)
    return failed(
        "the fluid is free but for gravity, and yet its momentum changes: particles push others "
        "harder than they are pushed back",
        "Give both particles of a pair the same force: -m (p_i / rho_i^2 + p_j / rho_j^2) times "
        "the gradient, or a mean of the two pressures.",
        numbers,
    )


def energy(survey: RecordingSurvey) -> Result:
    """Look for kinetic energy that neither gravity nor compression can have given."""
    if survey.first.v is None or survey.n_frames < 2:
        return skipped("needs velocities and two frames")
    kinetic = np.array([look.kinetic for look in survey.looks])
    c = sound_speed(survey)
    if math.isfinite(c) and kinetic.max() > BURST * c**2 / 2 > kinetic[0]:
        return failed(
            f"the mean kinetic energy grows to {kinetic.max() / (c**2 / 2):.3g} times that of all "
            f"particles at the speed of sound ({c:.4g} m/s)",
            _CAUSES,
            Measured(float(kinetic.max() / (c**2 / 2)), f"below {BURST:g}", unit="c0^2 / 2"),
        )
    scene, stiffness = survey.known.scene, survey.known.stiffness
    changes = stiffness is not None and np.ptp(stiffness) > 0
    if scene is None or survey.first.rho is None or not _closed(scene) or changes:
        return inconclusive("what walls, gravity and controls give to the fluid can't be told")
    return _balance(survey, scene, kinetic)


_CAUSES = (
    "Halve the time step first: if the energy then stays away, it was too long for the stiffness. "
    "Else look at the symmetry and the sign of the pressure force, and at walls that give back "
    "more speed than came."
)


def _balance(survey: RecordingSurvey, scene: Scene, kinetic: Array) -> Result:
    g = scene.effects.gravity_at(0.0)
    potential = np.array([-float(g @ look.center) for look in survey.looks])
    stored = _stored(survey, scene)
    total = kinetic + potential - kinetic[0] - potential[0] - stored
    stake = max(float(np.max(kinetic)), float(np.ptp(potential)), stored, 1e-300)
    worst = float(np.max(total)) / stake
    # a fluid at rest that trembles has no energy worth speaking of
    quiet = kinetic.max() < (0.01 * scene.fluid.c0) ** 2 / 2
    numbers = Measured(worst, 0.0, "share of the energy at stake", f"{SURPLUS:g}")
    if worst < SURPLUS or quiet:
        return passed("no spurious energy", numbers._replace(measured=max(worst, 0.0)))
    k = int(np.argmax(total))
    return failed(
        f"in {survey.when(k)}, kinetic and potential energy are more than at the start, with all "
        "that compression had stored, by a share that can't come from within",
        _CAUSES,
        numbers,
    )


def _stored(survey: RecordingSurvey, scene: Scene) -> float:
    """Return the mean energy of compression of frame 0 [m^2/s^2], by Tait's equation."""
    fluid, rho = scene.fluid, survey.first.rho
    assert rho is not None
    known = survey.known.stiffness
    stiffness = fluid.stiffness(fluid.c0) if known is None else float(np.max(known))
    ratio = rho / fluid.rho0
    if fluid.clamp:
        ratio = np.maximum(ratio, 1.0)
    return float(np.mean(stiffness / fluid.rho0 * tait_energy(ratio, fluid.gamma)))


def _uniform(scene: Scene) -> bool:
    """Return whether gravity, if there is any, is the same at all times and places."""
    field = scene.effects.field
    return field is None or (isinstance(field, Gravity) and field.ramp == 0)


def _closed(scene: Scene) -> bool:
    """Return whether nothing from outside but a uniform gravity does work on the fluid."""
    walls = scene.walls
    still = walls is None or (
        walls.motion is None and not np.any(walls.velocities) and not walls.is_periodic
    )
    return still and scene.effects.surface_tension is None and _uniform(scene)
