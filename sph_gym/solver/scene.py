"""Scenes: fluid, effects and geometry, checked once, in Python, when they are made."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from sph_gym.solver.checks import finite_array, in_range, known, positive
from sph_gym.solver.effects import Effects
from sph_gym.solver.gravity import AnyGravity
from sph_gym.solver.initial_checks import check_places
from sph_gym.solver.integrators import INTEGRATORS, VISCOUS_SHARES
from sph_gym.solver.kernels import ALL_KERNELS, viscous_share
from sph_gym.solver.neighbors import NARROWEST_DOMAIN
from sph_gym.solver.plain import from_plain, to_plain
from sph_gym.solver.state import Controls
from sph_gym.solver.surface import FRICTION_SHARE, layer_viscosity
from sph_gym.solver.walls import Motion, Walls

# Largest h / dx: beyond it a particle has more than 30,000 neighbours, and a unit is surely wrong.
WIDEST = 100
# Smallest and largest lengths [m] and speeds [m/s]: beyond them powers of h overflow.
SMALLEST, LARGEST = 1e-12, 1e12
EQUATIONS_OF_STATE = ("tait",)
# Version of the form of `Scene.to_dict`.
FORM = 1


@dataclass(frozen=True)
class Fluid:
    """A weakly compressible fluid.

    c0: nominal artificial sound speed [m/s], about ten times the largest speed (`sound_speed`).
    rho0: rest density [kg/m^3]. gamma: Tait's exponent. kernel: density kernel and pressure
    gradient as one choice, a matched pair, "wendland_c2", "spiky", "cubic_spline" or
    "quintic_spline", or the article's "mueller", which is none and heats what isn't damped; those
    that begin with "wrong" are what their name says (see kernels.py). eos: "tait"; with gamma = 1
    it is the linear law.
    clamp: whether negative pressures are cut off, as free surfaces want it.

    Raises ValueError for values that aren't positive and finite, c0 outside [1e-12, 1e12],
    gamma < 1 and unknown names.
    """

    c0: float
    rho0: float = 1000.0
    gamma: float = 7.0
    kernel: str = "wendland_c2"
    eos: str = "tait"
    clamp: bool = True

    def __post_init__(self) -> None:
        c0 = in_range("fluid.c0", positive("fluid.c0", self.c0), SMALLEST, LARGEST)
        object.__setattr__(self, "c0", c0)
        object.__setattr__(self, "rho0", positive("fluid.rho0", self.rho0))
        object.__setattr__(self, "gamma", in_range("fluid.gamma", self.gamma, 1.0))
        if not isinstance(self.clamp, bool):
            raise ValueError(f"fluid.clamp: expected True or False, got {self.clamp!r}")
        known("fluid.kernel", self.kernel, ALL_KERNELS)
        known("fluid.eos", self.eos, EQUATIONS_OF_STATE)

    def stiffness(self, c: float) -> float:
        """Tait's B [Pa] for a sound speed c [m/s]."""
        return float(self.rho0 * c * c / self.gamma)

    def sound_speed(self, stiffness: float) -> float:
        """Sound speed [m/s] at rest density for Tait's B [Pa]."""
        return math.sqrt(self.gamma * stiffness / self.rho0)


def check_controls(controls: Controls) -> Controls:
    """The three numbers as floats; ValueError for dt or stiffness <= 0 and for xsph < 0."""
    try:
        dt, stiffness, xsph = controls
    except (TypeError, ValueError):
        raise ValueError(f"controls: expected (dt, stiffness, xsph), got {controls!r}") from None
    return Controls(
        positive("controls.dt", dt),
        positive("controls.stiffness", stiffness),
        in_range("controls.xsph", xsph, 0.0),
    )


@dataclass(frozen=True, eq=False)
class Scene:
    """A flow to simulate: particles, fluid, effects, walls, and for how long.

    x, v: (n, 2) positions [m] and velocities [m/s] (at rest if left out); dx: particle spacing
    [m]; h: SUPPORT radius [m], at least dx; walls: None is open space; duration: of the whole
    run [s]; frame: physical time [s] between two looks at it, and of one environment step;
    integrator: "symplectic_euler", "kick_drift_kick" or "predictor_corrector";
    controls: nominal controls, by default stiffness rho0 c0^2 / gamma, dt the stable step at the
    start, xsph 0.3; hydrostatic: whether the fluid starts with the pressures of water at rest
    under the gravity of the start, below a level dx / 2 above its highest particle. Then x is the
    lattice from which it is pressed together (`hydrostatics.pressed`), and settles for 186 steps
    before time 0 if it is at rest; densities by continuity simply begin with those values.

    Raises ValueError that names the argument, for wrong shapes and types, non-finite numbers, no
    particles at all, dx or h outside [1e-12, 1e12] m, h < dx or h > 100 dx, times that aren't
    positive, and fluid outside of the box or within half a spacing of boundary particles.
    """

    name: str
    x: ArrayLike
    dx: float
    h: float
    fluid: Fluid
    v: ArrayLike | None = None
    effects: Effects = field(default_factory=Effects)
    walls: Walls | None = None
    duration: float = 1.0
    frame: float = 0.01
    controls: Controls | None = None
    integrator: str = "symplectic_euler"
    hydrostatic: bool = False

    def __post_init__(self) -> None:
        known("integrator", self.integrator, INTEGRATORS)
        if not isinstance(self.name, str) or not self.name:
            raise ValueError(f"name: expected a non-empty string, got {self.name!r}")
        x = finite_array("x", self.x, ("n", 2))
        if len(x) == 0:
            raise ValueError("x: expected at least one particle, got none")
        v = np.zeros_like(x) if self.v is None else finite_array("v", self.v, x.shape)
        x.flags.writeable = v.flags.writeable = False
        object.__setattr__(self, "x", x)
        object.__setattr__(self, "v", v)
        for name in ("dx", "h", "duration", "frame"):
            object.__setattr__(self, name, positive(name, getattr(self, name)))
        for name in ("dx", "h"):
            in_range(name, getattr(self, name), SMALLEST, LARGEST)
        if self.h < self.dx:
            raise ValueError(
                f"h: expected a support radius of at least dx = {self.dx:g} m, got {self.h:g}"
            )
        if self.h > WIDEST * self.dx:
            raise ValueError(
                f"h: expected a support radius of at most {WIDEST} dx = {WIDEST * self.dx:g} m, "
                f"got {self.h:g}"
            )
        if self.frame > self.duration:
            raise ValueError(
                f"frame: expected at most the duration, {self.duration:g} s, got {self.frame:g}"
            )
        for name, kind in (("fluid", Fluid), ("effects", Effects)):
            if not isinstance(getattr(self, name), kind):
                raise ValueError(
                    f"{name}: expected {kind.__name__}(...), got {getattr(self, name)!r}"
                )
        if self.walls is not None and not isinstance(self.walls, Walls):
            raise ValueError(f"walls: expected Walls(...) or None, got {self.walls!r}")
        if self.effects.surface_tension is not None and self.h == self.dx:
            raise ValueError(
                "h: expected a support radius above dx with effects.surface_tension, since no "
                f"particle at rest would be near enough to attract, got {self.h:g}"
            )
        if self.controls is not None:
            object.__setattr__(self, "controls", check_controls(self.controls))
        self._check_walls()
        self._check_hydrostatic()

    def to_dict(self) -> dict[str, Any]:
        """Return the scene as plain data for JSON, from which `from_dict` makes it again.

        Numbers keep all their digits; infinity is the text "inf".
        """
        return {"version": FORM} | to_plain(self, "scene")

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Scene":
        """Return the scene of a `to_dict`, or of the parameters of a recording.

        Its simulations are the same to the last bit. Raises ValueError for anything else, for
        another version, and as `Scene` does.
        """
        if not isinstance(data, Mapping) or data.get("class") != cls.__name__:
            raise ValueError(f"scene: expected a dictionary of Scene.to_dict(), got {data!r:.80}")
        parts = dict(data)
        # recordings tell the version of the package instead
        version = parts.pop("version", FORM)
        if version != FORM:
            raise ValueError(f"scene.version: expected {FORM}, got {version!r}")
        controls = parts.get("controls")
        if isinstance(controls, Mapping):
            if set(controls) != set(Controls._fields):
                raise ValueError(
                    f"scene.controls: expected {', '.join(Controls._fields)}, got {controls!r}"
                )
            parts["controls"] = Controls(**controls)
        kinds = (cls, Fluid, Effects, Walls, Motion, *get_args(AnyGravity))
        found = from_plain("scene", parts, {kind.__name__: kind for kind in kinds})
        assert isinstance(found, cls)
        return found

    @property
    def periods(self) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
        """The ends [m] at which space closes upon itself along x and y; None: it does not."""
        return (None, None) if self.walls is None else (self.walls.period_x, self.walls.period_y)

    @property
    def viscous_share(self) -> float:
        """The longest step that laminar viscosity allows, as a share of h^2 / nu; see `kernels`.

        It depends on h / dx and the integrator.
        """
        return VISCOUS_SHARES.get(self.integrator, 1.0) * viscous_share(self.h, self.dx)

    @property
    def surface_dt(self) -> float:
        """The longest step [s] that the friction of a surface under tension allows, else inf."""
        sigma = self.effects.surface_tension
        if not sigma:
            return math.inf
        share = FRICTION_SHARE * VISCOUS_SHARES.get(self.integrator, 1.0)
        return share * self.h**2 / layer_viscosity(sigma, self.h, self.fluid.rho0)

    def _check_walls(self) -> None:
        """Check the demands of walls, fluid and effects on each other."""
        walls = self.walls
        if walls is None:
            return
        like_fluid = walls.particles is not None and walls.pressure == "like fluid"
        if self.effects.continuity and like_fluid:
            raise ValueError(
                "walls.pressure: expected 'extrapolated' with effects.continuity, since boundary "
                "particles that are like fluid sum their densities, got 'like fluid'"
            )
        for name, axis in (("period_x", 0), ("period_y", 1)):
            ends = getattr(walls, name)
            if ends is None:
                continue
            # but for rounding
            if ends[1] - ends[0] < (1 - 1e-9) * NARROWEST_DOMAIN * self.h:
                raise ValueError(
                    f"walls.{name}: expected at least {NARROWEST_DOMAIN:g} h = "
                    f"{NARROWEST_DOMAIN * self.h:g} m, got {ends[1] - ends[0]:g}"
                )
            place = np.asarray(self.x)[:, axis]
            if place.min() < ends[0] or place.max() >= ends[1]:
                raise ValueError(
                    f"x: expected positions in walls.{name} = [{ends[0]:g}, {ends[1]:g}), got "
                    f"{place.min():g} to {place.max():g}"
                )
        check_places(self)

    def _check_hydrostatic(self) -> None:
        """Check that there is weight, and something that it may rest on."""
        if not isinstance(self.hydrostatic, bool):
            raise ValueError(f"hydrostatic: expected True or False, got {self.hydrostatic!r}")
        if not self.hydrostatic:
            return
        gravity, walls = self.effects.gravity_at(0.0), self.walls
        if not gravity.any():
            raise ValueError(
                "hydrostatic: expected a uniform gravity that acts from the start, without a "
                f"ramp, got effects.gravity = {self.effects.gravity!r}"
            )
        if walls is None:
            raise ValueError("hydrostatic: expected walls that the fluid rests on, got none")
        for name, pull in zip(("period_x", "period_y"), gravity.tolist(), strict=True):
            if pull and getattr(walls, name) is not None:
                raise ValueError(
                    f"hydrostatic: expected no gravity along walls.{name}, got {pull:g} m/s^2"
                )


def sound_speed(v_max: float) -> float:
    """The artificial sound speed [m/s] that keeps a flow of at most v_max [m/s] at Mach 0.1."""
    return 10.0 * positive("v_max", v_max)
