"""States that can be shown: a running simulation, or one moment of a recording."""

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls
from sph_gym.solver.warnings import Warning
from sph_gym.view.nearby import Periods, Surroundings, surroundings

Array = NDArray[Any]
# Columns of a state; a recording may lack the last three.
COLUMNS = ("x", "v", "rho", "p", "a")


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
        self.columns = columns

    @property
    def x(self) -> Array:
        """(n, 2) positions [m]."""
        return self.columns["x"]

    @property
    def v(self) -> Array:
        """(n, 2) velocities [m/s]."""
        return self.columns["v"]

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
        if name not in self.columns:
            raise ValueError(f"{name}: the recording has no {meaning}")
        return self.columns[name]

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


# A state that can be shown; fluid comes first in its arrays.
Shown = Simulation | Still


def columns_of(state: Shown) -> frozenset[str]:
    """Return which columns the state has: all of a simulation, those recorded of a recording."""
    return frozenset(state.columns if isinstance(state, Still) else COLUMNS)


def spacings(state: Shown) -> Array:
    """Return (n_fluid,) distances to the nearest other fluid particle [dx], infinite if alone."""
    if isinstance(state, Simulation):
        spacing = np.empty(state.n_fluid)
        spacing[state.engine.fluid.id] = np.sqrt(state.engine.nearest_and_count()[0])
        return spacing / state.scene.dx
    return state.surroundings.nearest / state.scene.dx


def periods(scene: Scene) -> Periods:
    """Return the lengths [m] after which space closes upon itself in x and y."""
    x, y = (math.inf if ends is None else ends[1] - ends[0] for ends in scene.periods)
    return x, y
