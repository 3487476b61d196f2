"""The knobs: everything that is set of a run, in numbers that don't depend on its resolution."""

from dataclasses import replace
from typing import NamedTuple

from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import DEFAULT_XSPH, Simulation
from sph_gym.solver.state import Controls
from sph_gym.studies.accuracy.problems import Problem

DENSITIES = ("summation", "continuity")
FIXED = "fixed"
# Of delta-SPH, for densities by continuity where the scene doesn't name one.
DIFFUSION = 0.1


class Setting(NamedTuple):
    """One run.

    across: particles along the problem's length; width: h / dx; step: dt / the stable step at the
    start; sound: c / c0, which is the stiffness; kernel, density, dtype, integrator: names; xsph:
    epsilon, 0 for none; controller: "fixed" keeps dt and stiffness, others set them every frame.
    """

    across: int
    width: float
    step: float
    sound: float
    kernel: str
    density: str
    dtype: str
    integrator: str
    xsph: float
    controller: str = FIXED

    @property
    def line(self) -> "Setting":
        """The same at no particular resolution."""
        return self._replace(across=0)

    def differences(self, other: "Setting") -> dict[str, object]:
        """The knobs that stand elsewhere than in another setting, resolution apart."""
        return {
            name: value
            for name, value, theirs in zip(self._fields, self, other, strict=True)
            if value != theirs and name != "across"
        }


def nominal(problem: Problem, across: int | None = None) -> Setting:
    """What the scene itself says, at a resolution."""
    across = problem.nominal if across is None else across
    scene = problem.build(across)
    effects = scene.effects
    return Setting(
        across,
        round(scene.h / scene.dx, 9),
        1.0,
        1.0,
        scene.fluid.kernel,
        DENSITIES[effects.continuity],
        "float64",
        scene.integrator,
        DEFAULT_XSPH if effects.xsph else 0.0,
    )


def build(problem: Problem, setting: Setting, other: int = 0) -> Scene:
    """The scene of a run, its controls included.

    Raises ValueError for settings that the scene doesn't allow.
    """
    plain = problem.build(setting.across, other)
    effects = replace(plain.effects, xsph=setting.xsph > 0)
    continuity = setting.density == "continuity"
    if continuity != effects.continuity:
        diffusion = DIFFUSION if continuity else None
        effects = replace(effects, continuity=continuity, density_diffusion=diffusion)
    fluid = replace(plain.fluid, kernel=setting.kernel)
    scene = replace(
        plain,
        h=setting.width * plain.dx,
        fluid=fluid,
        effects=effects,
        integrator=setting.integrator,
    )
    controls = Controls(1.0, fluid.stiffness(setting.sound * fluid.c0), setting.xsph)
    still = Simulation(replace(scene, controls=controls), setting.dtype, threads=1)
    dt = setting.step * still.stable_dt()
    return replace(scene, controls=controls._replace(dt=dt))
