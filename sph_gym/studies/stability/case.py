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

    build: dx [m] and an item of `sizes` to a scene; frames, quick: how many of the scene's frames
    it lasts at the usual spacing, and how many in the quick version; steer: sets the controls
    before each; stable: whether the step is at most the stable one, so that a blow-up is a
    failure; pushed: the multiple of the stable step that some step must reach; density: the
    largest mean compression of the second half; gain: the largest of the whole run beyond that
    of the start, by default the same; burst: the largest from the end of the first frame on, for
    what begins squeezed and has parted before the second half, else None; p99: the largest 99th
    percentile of the second half, None where the case says why; least: of the smallest density of
    the start, what must be left of it where the fluid stays together, else 0; typical: the least
    median density [rho0] where most of the fluid stays together, else 0; clumping: the
    largest share of particles closer than 0.6 dx in the second half, None if it isn't asked;
    pairs: whether kernels that are no pair are excused from it;
    excess: the most energy from nowhere, as a share of what is at stake; unmatched: the same of
    kernels that are no pair, by default the same; conserves: whether momentum is to stay what it
    was; behind: positions (n, 2) [m] and dx to which of them are on the wrong side of a wall;
    kernel: of the variant with another one.
    """

    name: str
    build: Callable[..., Scene]
    dx: float
    frames: int = 100
    quick: int = 12
    steer: Steer = article
    stable: bool = True
    pushed: float = 0.0
    density: float = 0.02
    gain: float | None = None
    burst: float | None = None
    p99: float | None = DENSE
    least: float = 0.0
    typical: float = 0.0
    clumping: float | None = None
    pairs: bool = False
    excess: float = 0.02
    unmatched: float | None = None
    conserves: bool = False
    behind: Callable[[Any, float], Any] | None = None
    kernel: str = "wendland_c2"
    sizes: tuple[Any, ...] = (None,)

    def scene(self, variant: Variant, size: Any = None) -> Scene:
        """The scene of a variant, of one of the sizes."""
        dx = self.dx / variant.finer
        scene = self.build(dx) if size is None else self.build(dx, size)
        if variant.other_kernels:
            fluid = dataclasses.replace(scene.fluid, kernel=self.kernel)
            scene = dataclasses.replace(scene, fluid=fluid)
        return scene

    def lasts(self, variant: Variant, quick: bool) -> int:
        """Frames; those of a finer variant are shorter."""
        return self.quick if quick else round(self.frames * variant.finer)

    def allowed_excess(self, scene: Scene) -> float:
        """Energy from nowhere, as a share of what is at stake, that is no error of the solver."""
        if self.unmatched is None or scene.fluid.kernel in MATCHED:
            return self.excess
        return self.unmatched

    def allowed_clumping(self, scene: Scene) -> float:
        """Share of particles closer than 0.6 dx that kernels don't make by themselves."""
        if self.clumping is None or (self.pairs and scene.fluid.kernel not in MATCHED):
            return math.inf
        return self.clumping

    def passed(self, sim: Simulation) -> int:
        """How many fluid particles are on the wrong side of a wall."""
        x = sim.x[: sim.n_fluid].astype(np.float64)
        # a wall that was rounded to the precision of the particles
        slack = 1e-9 + 4 * float(np.finfo(sim.x.dtype).eps) * float(np.abs(x).max())
        wrong = np.zeros(len(x), bool)
        box = None if sim.scene.walls is None else sim.scene.walls.box
        if box is not None and sim.scene.walls.motion is None:  # type: ignore[union-attr]
            low, high = np.array(box[::2]), np.array(box[1::2])
            wrong |= ((x < low - slack) | (x > high + slack)).any(axis=1)
        if self.behind is not None:
            wrong |= self.behind(x, sim.scene.dx)
        return int(wrong.sum())
