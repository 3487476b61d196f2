"""Hard cases: a start, the controls of every frame, an event that must happen, and bounds."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from sph_gym.solver.kernels import MATCHED
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls
from sph_gym.studies.stability.checks import BY_NAME, Bound
from sph_gym.studies.stability.events import Event

# --- Controls -------------------------------------------------------------------------------

StepControls = Callable[[Simulation, int], Controls]


def stable_step(
    sim: Simulation,
    frame: int,
    times: float = 1.0,
    stiffer: float = 1.0,
    epsilon: float | None = None,
) -> Controls:
    """Return the article's stable step, anew in every frame, or some multiple of it.

    stiffer: multiple of the nominal stiffness; epsilon: of XSPH, by default the nominal one.
    """
    _, stiffness, xsph = sim.nominal_controls
    sim.controls = sim.controls._replace(stiffness=stiffer * stiffness, xsph=xsph)
    dt = times * sim.stable_dt()
    return sim.controls._replace(dt=dt, xsph=xsph if epsilon is None else epsilon)


def constant_step(sim: Simulation, frame: int) -> Controls:
    """Return the stable step of the start in every frame."""
    return sim.nominal_controls


def stiff_at_once(sim: Simulation, frame: int, factor: float) -> Controls:
    """Return a stiffer fluid from the third frame on, with the step of the soft one."""
    controls = sim.nominal_controls
    return controls._replace(stiffness=(factor if frame > 1 else 1.0) * controls.stiffness)


def switching(*steers: StepControls) -> StepControls:
    """Take one steer after the other, another one in every frame."""
    return lambda sim, frame: steers[frame % len(steers)](sim, frame)


# --- Cases ----------------------------------------------------------------------------------


class Variant(NamedTuple):
    """A change of a case: its kernels, its precision or its resolution."""

    name: str
    other_kernels: bool = False
    dtype: str = "float64"
    finer: float = 1.0


VARIANTS = (
    Variant("as it is"),
    Variant("other kernels", other_kernels=True),
    Variant("float32", dtype="float32"),
    Variant("finer", finer=1.5),
)


class HardCase(NamedTuple):
    """A hard case; see `hard_case`.

    build: dx [m], and an item of `sizes` if there are any, to a scene; event: what must have
    happened by the end; soon: `build` of the quick version, where `build` would end too early
    for its event; frames, quick: how many of the scene's frames it lasts at the usual spacing,
    and how many in the quick version; steer: sets the controls before each; stable: whether a
    blow-up is a failure, since the step is at most the stable one; causes: the plausible ones of
    a blow-up; calm: time [s] after which the kinetic energy is looked at; twin: the case that it
    must be like; dtype: the precision of all variants, if it is one; behind: positions (n, 2)
    [m] and dx to which of them are on the wrong side of a wall; kernel: that of the variant with
    another one; bounds: of checks, by name, where they differ from the usual ones; unmatched:
    those of kernels that are no pair, where they differ.
    """

    name: str
    build: Callable[..., Scene]
    event: Event
    dx: float
    soon: Callable[..., Scene] | None = None
    frames: int = 100
    quick: int = 12
    steer: StepControls = stable_step
    stable: bool = True
    causes: tuple[str, ...] = ("cfl",)
    calm: float | None = None
    twin: "HardCase | None" = None
    dtype: str | None = None
    behind: Callable[[Any, float], Any] | None = None
    kernel: str = "wendland_c2"
    sizes: tuple[Any, ...] = (None,)
    bounds: Mapping[str, Bound] = {}
    unmatched: Mapping[str, Bound] = {}

    def scene(self, variant: Variant, size: Any = None, quick: bool = False) -> Scene:
        """Return the scene of a variant, of one of the sizes."""
        dx = self.dx / variant.finer
        build = self.soon if quick and self.soon is not None else self.build
        scene = build(dx) if size is None else build(dx, size)
        if variant.other_kernels:
            fluid = dataclasses.replace(scene.fluid, kernel=self.kernel)
            scene = dataclasses.replace(scene, fluid=fluid)
        return scene

    def precision(self, variant: Variant) -> str:
        """Return the precision of the particles in a variant."""
        return self.dtype or variant.dtype

    def n_frames(self, variant: Variant, quick: bool) -> int:
        """Return how many frames it lasts; those of a finer variant are shorter."""
        return self.quick if quick else round(self.frames * variant.finer)

    def bound(self, name: str, variant: Variant, quick: bool = False) -> float | None:
        """Return the bound of a check in a variant; None if there is none."""
        if name == "happened":
            return self.event.quick if quick else self.event.full
        bound = self.bounds.get(name, BY_NAME[name].bound)
        if name in self.unmatched:
            kernel = self.scene(variant, self.sizes[0]).fluid.kernel
            bound = bound if kernel in MATCHED else self.unmatched[name]
        if isinstance(bound, str):
            return self.bound(bound, variant)
        return bound[self.precision(variant)] if isinstance(bound, Mapping) else bound


def hard_case(
    name: str,
    build: Callable[..., Scene],
    event: Event,
    dx: float,
    unmatched: Mapping[str, Bound] | None = None,
    **settings: Any,
) -> HardCase:
    """Return a case; settings: fields of `HardCase`, and bounds of checks by the checks' names."""
    bounds = {check: settings.pop(check) for check in BY_NAME if check in settings}
    return HardCase(name, build, event, dx, bounds=bounds, unmatched=unmatched or {}, **settings)
