"""What a hard case is: a start, how it is steered, and what must hold."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.kernels import MATCHED
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls
from sph_gym.solver.walls import stroke_at
from sph_gym.studies.stability.events import Event

Steer = Callable[[Simulation, int], Controls]


# --- Who sets the controls ------------------------------------------------------------------


def article(sim: Simulation, frame: int) -> Controls:
    """The article's stable step, anew in every frame."""
    return stiffened(1.0)(sim, frame)


def stiffened(factor: float) -> Steer:
    """The same in a fluid that is so many times as stiff."""

    def steer(sim: Simulation, frame: int) -> Controls:
        _, stiffness, xsph = sim.nominal_controls
        sim.controls = sim.controls._replace(stiffness=factor * stiffness, xsph=xsph)
        return sim.controls._replace(dt=sim.stable_dt())

    return steer


def smoothed(epsilon: float) -> Steer:
    """The stable step with another XSPH epsilon."""
    return lambda sim, frame: article(sim, frame)._replace(xsph=epsilon)


def stepping(factor: float) -> Steer:
    """A constant step: so many times the stable one of the start."""
    return lambda sim, frame: sim.nominal_controls._replace(dt=factor * sim.nominal_controls.dt)


def overstepping(factor: float) -> Steer:
    """So many times the stable step, anew in every frame."""

    def steer(sim: Simulation, frame: int) -> Controls:
        controls = article(sim, frame)
        return controls._replace(dt=factor * controls.dt)

    return steer


def stiff_at_once(factor: float) -> Steer:
    """A stiffer fluid from the third frame on, with the step of the soft one."""

    def steer(sim: Simulation, frame: int) -> Controls:
        controls = sim.nominal_controls
        return controls._replace(stiffness=(factor if frame > 1 else 1.0) * controls.stiffness)

    return steer


def switching(*steers: Steer) -> Steer:
    """One after the other, another one in every frame."""
    return lambda sim, frame: steers[frame % len(steers)](sim, frame)


# --- Cases ----------------------------------------------------------------------------------


# Of the multiple of the stable step that a case asks for, what the largest step must reach.
REACHED = 0.999
# Of the compression in the most compressed hundredth, as the environments allow.
DENSE = 0.04


class Variant(NamedTuple):
    """What of a case is changed: its kernels, its precision or its resolution."""

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


class Case(NamedTuple):
    """A hard case.

    build: dx [m] and an item of `sizes` to a scene; event: what must have happened by the end;
    soon: `build` of the quick version, where that would end too early for it, else None;
    frames, quick: how many of the scene's frames
    it lasts at the usual spacing, and how many in the quick version; steer: sets the controls
    before each; stable: whether the step is at most the stable one, so that a blow-up is a
    failure; causes: the plausible ones of a blow-up; pushed: the multiple of the stable step that
    some step must reach; density: the
    largest mean compression of the second half; gain: the largest of the whole run beyond that
    of the start, by default the same; burst: the largest from the end of the first frame on, for
    what begins squeezed and has parted before the second half, else None; p99: the largest 99th
    percentile of the second half, None where the case says why; peak: the largest density of the
    second half [rho0], None if it isn't asked; alone: whether every density must be a lonely
    particle's; least: of the smallest density of
    the start, what must be left of it where the fluid stays together, else 0; typical: the least
    median density [rho0] where most of the fluid stays together, else 0; clumping: the
    largest share of particles closer than 0.6 dx in the second half, None if it isn't asked;
    pairs: whether kernels that are no pair are excused from it;
    excess: the most energy from nowhere, as a share of what is at stake; unmatched: the same of
    kernels that are no pair, by default the same; rise, unmatched_rise: the most that it ever
    rises above what it was before, by default as much; conserves: whether momentum is to stay what
    it was; calm: time [s] after which kinetic energy is looked at, and the most of it [m g H], else
    None; twin: the case that it must be like, else None; alike: how far apart their observables
    may be, clumped: how many more of its particles may be closer than 0.6 dx, None if it isn't
    asked; dtype: the precision of all variants, if it is one; behind: positions (n, 2) [m] and dx
    to which of them are on the wrong side of a wall; kernel: of the variant with another one.
    """

    name: str
    build: Callable[..., Scene]
    event: Event
    dx: float
    soon: Callable[..., Scene] | None = None
    frames: int = 100
    quick: int = 12
    steer: Steer = article
    stable: bool = True
    causes: tuple[str, ...] = ("cfl",)
    pushed: float = 0.0
    density: float = 0.02
    gain: float | None = None
    burst: float | None = None
    p99: float | None = DENSE
    peak: float | None = None
    alone: bool = False
    least: float = 0.0
    typical: float = 0.0
    clumping: float | None = None
    pairs: bool = False
    excess: float = 0.02
    unmatched: float | None = None
    rise: float | None = None
    unmatched_rise: float | None = None
    conserves: bool = False
    calm: tuple[float, float] | None = None
    twin: "Case | None" = None
    alike: float | None = None
    clumped: float | None = None
    dtype: str | None = None
    behind: Callable[[Any, float], Any] | None = None
    kernel: str = "wendland_c2"
    sizes: tuple[Any, ...] = (None,)

    def scene(self, variant: Variant, size: Any = None, quick: bool = False) -> Scene:
        """The scene of a variant, of one of the sizes."""
        dx = self.dx / variant.finer
        build = self.soon if quick and self.soon is not None else self.build
        scene = build(dx) if size is None else build(dx, size)
        if variant.other_kernels:
            fluid = dataclasses.replace(scene.fluid, kernel=self.kernel)
            scene = dataclasses.replace(scene, fluid=fluid)
        return scene

    def precision(self, variant: Variant) -> str:
        """Of the particles in a variant."""
        return self.dtype or variant.dtype

    def lasts(self, variant: Variant, quick: bool) -> int:
        """Frames; those of a finer variant are shorter."""
        return self.quick if quick else round(self.frames * variant.finer)

    def allowed_excess(self, scene: Scene) -> float:
        """Energy from nowhere, as a share of what is at stake, that is no error of the solver."""
        if self.unmatched is None or scene.fluid.kernel in MATCHED:
            return self.excess
        return self.unmatched

    def allowed_rise(self, scene: Scene) -> float:
        """The same of what energy from nowhere may rise by, after friction has taken some."""
        if self.unmatched_rise is not None and scene.fluid.kernel not in MATCHED:
            return self.unmatched_rise
        return self.allowed_excess(scene) if self.rise is None else self.rise

    def allowed_clumping(self, scene: Scene) -> float:
        """Share of particles closer than 0.6 dx that kernels don't make by themselves."""
        if self.clumping is None or (self.pairs and scene.fluid.kernel not in MATCHED):
            return math.inf
        return self.clumping

    def passed(self, sim: Simulation) -> int:
        """How many fluid particles are on the wrong side of a wall."""
        x, low, high, slack = _in_box(sim)
        wrong = ((x < low - slack) | (x > high + slack)).any(axis=1)
        if self.behind is not None:
            wrong |= self.behind(x, sim.scene.dx)
        return int(wrong.sum())


def held_by_box(sim: Simulation) -> int:
    """How many fluid particles lie on a side of the box: no boundary particle stopped them."""
    x, low, high, slack = _in_box(sim)
    return int(((np.abs(x - low) <= slack) | (np.abs(x - high) <= slack)).any(axis=1).sum())


def _in_box(sim: Simulation) -> tuple[Any, Any, Any, float]:
    """(n, 2) places [m], (2,) lower and upper sides of the box as it is now, and what rounds off.

    Infinite sides where there is none.
    """
    x = sim.x[: sim.n_fluid].astype(np.float64)
    walls = sim.scene.walls
    # a wall that was rounded to the precision of the particles
    slack = 1e-9 + 4 * float(np.finfo(sim.x.dtype).eps) * float(np.abs(x).max())
    if walls is None or walls.box is None:
        return x, np.full(2, -math.inf), np.full(2, math.inf), slack
    box = np.array(walls.box)
    if walls.motion is not None:
        stroke = walls.motion.stroke()
        dx, dy, _, _ = stroke_at(stroke, sim.time)
        box += (stroke.left * dx, stroke.right * dx, stroke.bottom * dy, stroke.top * dy)
    return x, box[::2], box[1::2], slack
