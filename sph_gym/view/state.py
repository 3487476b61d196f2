"""States that can be shown: a running simulation, or one moment of a recording."""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls
from sph_gym.solver.warnings import Warning
from sph_gym.view.nearby import OPEN, Periods, Surroundings, surroundings

Array = NDArray[Any]
# Columns of a state that a recording may lack.
OPTIONAL = ("rho", "p", "a")


class Shown(Protocol):
    """A state that can be shown, as `Simulation` and `Still` have it; fluid comes first in arrays.

    x, v, a: (n, 2) [m], [m/s], [m/s^2]; rho, p: (n,) [kg/m^3], [Pa]; time [s].
    """

    @property
    def n_fluid(self) -> int:
        """Number of fluid particles."""

    @property
    def x(self) -> Array:
        """Positions."""

    @property
    def v(self) -> Array:
        """Velocities."""

    @property
    def rho(self) -> Array:
        """Densities."""

    @property
    def p(self) -> Array:
        """Pressures."""

    @property
    def a(self) -> Array:
        """Accelerations."""

    @property
    def controls(self) -> Controls:
        """Time step, stiffness and epsilon; NaN where they are not known."""

    @property
    def sound_speed(self) -> float:
        """Sound speed [m/s], NaN if it is not known."""

    @property
    def neighbor_counts(self) -> Array:
        """Number of others within the support of each fluid particle."""

    @property
    def warnings(self) -> Sequence[Warning]:
        """Oddities of the run."""

    scene: Scene
    time: float


class Still:
    """One moment of a recording.

    scene: that it belongs to; time: [s]; columns: x, v, and rho, p, a as far as they were recorded,
    (n[, 2]) each, fluid first; n_fluid: of them; controls: dt [s], stiffness [Pa], xsph, NaN where
    they are not known.
    """

    warnings: tuple[Warning, ...] = ()

    def __init__(
        self, scene: Scene, time: float, columns: dict[str, Array], n_fluid: int, controls: Controls
    ) -> None:
        self.scene, self.time, self.n_fluid, self.controls = scene, time, n_fluid, controls
        self._columns = columns

    @property
    def x(self) -> Array:
        """(n, 2) positions [m]."""
        return self._columns["x"]

    @property
    def v(self) -> Array:
        """(n, 2) velocities [m/s]."""
        return self._columns["v"]

    @property
    def rho(self) -> Array:
        """(n,) densities [kg/m^3]; ValueError if they were not recorded."""
        return self._recorded("rho", "densities")

    @property
    def p(self) -> Array:
        """(n,) pressures [Pa]; ValueError if they were not recorded."""
        return self._recorded("p", "pressures")

    @property
    def a(self) -> Array:
        """(n, 2) accelerations [m/s^2]; ValueError if they were not recorded."""
        return self._recorded("a", "accelerations")

    def _recorded(self, name: str, meaning: str) -> Array:
        if name not in self._columns:
            raise ValueError(f"{name}: the recording has no {meaning}")
        return self._columns[name]

    @property
    def has(self) -> frozenset[str]:
        """Names of the columns that were recorded."""
        return frozenset(self._columns)

    @property
    def sound_speed(self) -> float:
        """Sound speed [m/s] at the stiffness of this moment, NaN if that is not known."""
        if not self.controls.stiffness > 0:
            return math.nan
        return self.scene.fluid.sound_speed(self.controls.stiffness)

    @cached_property
    def surroundings(self) -> Surroundings:
        """Neighbours of every fluid particle."""
        return surroundings(self.x, self.n_fluid, self.scene.h, periods(self.scene))

    @property
    def neighbor_counts(self) -> Array:
        """(n_fluid,) how many others, wall particles included, are within the support radius."""
        return self.surroundings.counts


def columns_of(state: Shown) -> frozenset[str]:
    """Return which columns the state has: all of a simulation, those recorded of a recording."""
    return state.has if isinstance(state, Still) else frozenset(("x", "v", *OPTIONAL))


def spacings(state: Shown) -> Array:
    """Return (n_fluid,) distances to the nearest other fluid particle [dx], infinite if alone."""
    if isinstance(state, Simulation):
        spacing = np.empty(state.n_fluid)
        spacing[state.engine.fluid.id] = np.sqrt(state.engine.nearest_and_count()[0])
        return spacing / state.scene.dx
    assert isinstance(state, Still)
    return state.surroundings.nearest / state.scene.dx


def periods(scene: Scene) -> Periods:
    """Return the lengths [m] after which space closes upon itself in x and y."""
    if scene.walls is None:
        return OPEN
    ends = (scene.walls.period_x, scene.walls.period_y)
    x, y = (math.inf if each is None else each[1] - each[0] for each in ends)
    return x, y
