"""A recording as a source of moments: what a run saved, or the last states that `watch` wrote."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sph_gym.solver.scene import Fluid, Scene
from sph_gym.solver.state import Controls
from sph_gym.trajectory import Trajectory
from sph_gym.view.history import MEASURES, History
from sph_gym.view.layout import SPLASH, View, view_bounds
from sph_gym.view.nearby import surroundings
from sph_gym.view.state import Array, Still

# Where a recording doesn't tell: support radius [dx], density at rest [kg/m^3], and the sound speed
# as a multiple of the largest speed.
SUPPORT, REST_DENSITY, SOUND = 2.6, 1000.0, 10.0
# Strays are left out of the view: what is farther from the others, without this share of them at
# either end, than so many times their extent.
TAIL, FAR = 0.05, 1.0


class Recording:
    """The moments of a recording: a `Source`.

    frames: of any solver; what it doesn't tell about the scene (spacing, support, density at rest,
    speed of sound) is estimated from the particles, and `estimated` names it.

    Raises ValueError for a recording without moments, positions or velocities.
    """

    def __init__(self, frames: Trajectory) -> None:
        fields = frames.fields
        for name in ("x", "v"):
            if name not in fields:
                raise ValueError(f"recording: expected the field {name!r}, got {sorted(fields)}")
        if len(frames.times) == 0 or fields["x"].shape[1] == 0:
            raise ValueError("recording: expected at least one moment with particles, got none")
        self._frames, self._at, told = frames, 0, frames.parameters
        kind = np.asarray(told.get("kind", np.zeros(fields["x"].shape[1])))
        self.n_fluid = int((kind == 0).sum())
        self.estimated: list[str] = []
        self.scene = self._find_scene(told)
        self._walls = self._fixed_walls()
        self._series = self._measure()
        self.tripped: Mapping[str, Any] | None = told.get("tripped")
        self.unit = "frame" if self.tripped is None else "step"
        self._state: Still | None = None

    @property
    def n(self) -> int:
        """Number of moments."""
        return len(self._frames.times)

    @property
    def at(self) -> int:
        """Index of the present moment."""
        return self._at

    @property
    def state(self) -> Still:
        """The present moment."""
        if self._state is None:
            k, fields = self._at, self._frames.fields
            columns = {name: self._with_walls(name, field[k]) for name, field in fields.items()}
            controls = Controls(*map(float, self._frames.controls[k]))
            self._state = Still(self.scene, self.time(k), columns, self.n_fluid, controls)
        return self._state

    def time(self, k: int) -> float:
        """Return the time of a moment [s]."""
        return float(self._frames.times[k])

    def series(self) -> Mapping[str, Array]:
        """Return (n,) values of every measure and every gauge over all moments, by their titles."""
        return self._series

    def go(self, k: int) -> None:
        """Make moment k the present one; the nearest there is if there is none."""
        self._at, self._state = min(max(k, 0), self.n - 1), None

    def forward(self) -> bool:
        """Go to the next moment; False if this is the last one."""
        if self._at + 1 >= self.n:
            return False
        self.go(self._at + 1)
        return True

    @property
    def bounds(self) -> View:
        """The part of space that all moments need [m]: without strays, with the scene's walls."""
        x = self._frames.fields["x"].reshape(-1, 2)
        x = x[np.isfinite(x).all(axis=1)]
        if "scene" in self._frames.parameters or not len(x):
            return view_bounds(self.scene)
        low, high = np.quantile(x, TAIL, axis=0), np.quantile(x, 1 - TAIL, axis=0)
        far = np.maximum(FAR * (high - low), 3 * self.scene.dx)
        x = x[((x >= low - far) & (x <= high + far)).all(axis=1)]
        low, high = x.min(axis=0), x.max(axis=0)
        margin = np.maximum(SPLASH * (high - low), 3 * self.scene.dx)
        (x_min, y_min), (x_max, y_max) = low - margin, high + margin
        return View(float(x_min), float(x_max), float(y_min), float(y_max))

    # --- the scene --------------------------------------------------------------------------

    def _find_scene(self, told: Mapping[str, Any]) -> Scene:
        if "scene" in told:
            return Scene.from_dict(told["scene"])
        x = self._first_finite("x")
        dx = self._number(told, "dx", self._spacing(x))
        h = max(self._number(told, "h", SUPPORT * dx), dx)
        rho = self._frames.fields.get("rho")
        rho0 = self._number(told, "rho0", REST_DENSITY if rho is None else _typical(rho[0]))
        with np.errstate(invalid="ignore"):
            speeds = np.hypot(*np.moveaxis(self._frames.fields["v"], -1, 0))
        c0 = self._number(told, "c0", SOUND * _typical(speeds, 0.99))
        duration = max(float(np.ptp(self._frames.times)), 1e-12)
        return Scene(
            str(told.get("solver", "recording")),
            x=x,
            dx=dx,
            h=h,
            fluid=Fluid(rho0=rho0, c0=c0),
            duration=duration,
            frame=duration / max(self.n - 1, 1),
        )

    def _number(self, told: Mapping[str, Any], name: str, otherwise: float) -> float:
        """Return a number that the recording tells, else the estimate."""
        value = told.get(name)
        if isinstance(value, int | float) and math.isfinite(value) and value > 0:
            return float(value)
        self.estimated.append(name)
        return otherwise

    def _first_finite(self, name: str) -> Array:
        """Return (n, 2) a field of the first moment; what isn't finite in it is put at 0."""
        return np.nan_to_num(
            np.asarray(self._frames.fields[name][0], float), posinf=0.0, neginf=0.0
        )

    def _spacing(self, x: Array) -> float:
        """Return the median distance to the nearest particle [m], 1 for a lone one."""
        extent = float(np.ptp(x, axis=0).max())
        if len(x) < 2 or extent == 0:
            return 1.0
        # a support in which, evenly strewn, there would be some twenty
        reach = 2.6 * extent / math.sqrt(len(x))
        nearest = surroundings(x, len(x), reach).nearest
        nearest = nearest[np.isfinite(nearest) & (nearest > 0)]
        return float(np.median(nearest)) if len(nearest) else extent

    def _fixed_walls(self) -> Array | None:
        """Return the (m, 2) boundary particles of the scene if the recording left them out."""
        walls, n = self.scene.walls, self._frames.fields["x"].shape[1]
        if walls is None or walls.particles is None or walls.motion is not None:
            return None
        return np.asarray(walls.particles, float) if n == self.n_fluid else None

    def _with_walls(self, name: str, column: Array) -> Array:
        if self._walls is None:
            return column
        beyond = (
            self._walls if name == "x" else np.full((len(self._walls), *column.shape[1:]), np.nan)
        )
        return np.concatenate([column, beyond])

    # --- measures ---------------------------------------------------------------------------

    def _measure(self) -> dict[str, Array]:
        fields, n = self._frames.fields, self.n_fluid
        found: dict[str, Array] = {}
        with np.errstate(all="ignore"):
            if "rho" in fields:
                strain = fields["rho"][:, :n] / self.scene.fluid.rho0 - 1.0
                found["density_error"] = np.maximum(strain, 0.0).mean(axis=1)
            found["max_speed"] = np.hypot(*np.moveaxis(fields["v"][:, :n], -1, 0)).max(axis=1)
        titled: dict[str, Array] = {}
        for name, values in found.items():
            title, factor, unit = MEASURES[name]
            titled[f"{title} [{unit}]"] = factor * values
        for name, values in self._frames.gauges.items():
            columns = values.T if values.ndim == 2 else values[None]
            axes = ("",) if len(columns) == 1 else (" x", " y")
            titled |= {name + axis: column for axis, column in zip(axes, columns, strict=True)}
        return titled


def _typical(values: Array, share: float = 0.5) -> float:
    """Return a quantile of the finite values above zero, 1 if there are none."""
    finite = values[np.isfinite(values) & (values > 0)]
    return float(np.quantile(finite, share)) if finite.size else 1.0


# Moments that can be shown one after the other.
Source = History | Recording
