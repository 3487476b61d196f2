"""Settings of a run: all that can be chosen, in numbers that don't depend on the resolution."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

from sph_gym.controllers import ArticleCfl, Controller, TunedCfl
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import DEFAULT_XSPH, Simulation
from sph_gym.solver.state import Controls

DENSITIES = ("summation", "continuity")
FIXED = "fixed"
RULES: dict[str, Callable[[], Controller]] = {"cfl": ArticleCfl, "tuned_cfl": TunedCfl}
# Strength of delta-SPH for densities by continuity where the scene doesn't name one.
DIFFUSION = 0.1
# The longest step that is recommended, as a multiple of the stable one: the limit is near, and
# where it lies depends on everything else.
LONGEST = 1.5
# Titles of the settings in tables and figures, and how a value of each is written.
TITLES = {
    "width": ("h / dx", "h = {} dx"),
    "step": ("dt / stable step", "dt = {} stable"),
    "sound": ("stiffness, by c / c0", "c = {} c0"),
    "kernel": ("kernel", "{}"),
    "density": ("density", "{}"),
    "dtype": ("precision", "{}"),
    "integrator": ("integrator", "{}"),
    "xsph": ("XSPH epsilon", "epsilon {}"),
    "controller": ("controller", "{}"),
}


class Setting(NamedTuple):
    """Settings of one run.

    across: particles along the length that is resolved; width: h / dx; step: dt / the stable step
    at the start; sound: c / c0, which is the stiffness; kernel, density, dtype, integrator: names;
    xsph: epsilon, 0 for none; controller: "fixed" keeps dt and stiffness, others set them in every
    frame.
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
    def series(self) -> "Setting":
        """These settings at no resolution (across is 0): they name a refinement series."""
        return self._replace(across=0)

    def differences(self, other: "Setting") -> dict[str, object]:
        """Return the values that differ from those of another setting, resolution apart."""
        pairs = zip(self._fields, self, other, strict=True)
        return {name: own for name, own, theirs in pairs if own != theirs and name != "across"}


def is_agent(controller: str) -> bool:
    """Return whether a controller is neither fixed nor a rule: it searches or was trained."""
    return controller != FIXED and controller not in RULES


def nominal(case: Refinement, across: int | None = None) -> Setting:
    """Return the scene's own settings at a resolution, by default its nominal one."""
    across = case.nominal if across is None else across
    scene = case.build(across)
    return Setting(
        across,
        width=round(scene.h / scene.dx, 9),
        step=1.0,
        sound=1.0,
        kernel=scene.fluid.kernel,
        density=DENSITIES[scene.effects.continuity],
        dtype="float64",
        integrator=scene.integrator,
        xsph=DEFAULT_XSPH if scene.effects.xsph else 0.0,
    )


def build(case: Refinement, setting: Setting, other: int = 0) -> Scene:
    """Return the scene of a run, its controls included.

    other: which of the other cases, 0 for none. Raises ValueError for settings that the scene
    doesn't allow.
    """
    plain = case.build(setting.across, other)
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
    at_start = Simulation(replace(scene, controls=controls), setting.dtype, threads=1)
    dt = setting.step * at_start.stable_dt()
    return replace(scene, controls=controls._replace(dt=dt))


def write_changes(changes: Mapping[str, object]) -> list[str]:
    """Return values of settings in words, as short as possible."""
    return [
        TITLES[name][1].format(f"{v:g}" if isinstance(v, float) else str(v).replace("_", " "))
        for name, v in changes.items()
    ]
