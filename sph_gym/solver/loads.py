"""Loads on sides of the box that mirror the fluid: on the whole, and along them.

In plain numpy, but for the forces, which the solver computes.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver import sampling
from sph_gym.solver.confinement import Box
from sph_gym.solver.images import FREEBOARD

if TYPE_CHECKING:
    from sph_gym.solver.simulation import Simulation

Array = NDArray[np.float64]

# The normals of `SIDES`, out of the box.
OUTWARD = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
# How close a particle is to where the box clamps if the box holds it, in spacings.
TOUCH = 1e-3


class Load(NamedTuple):
    """The load on a side of the box by the particles within h of it.

    place: of the side, along its normal [m]; x: (n,) of the particles along the side [m]; force:
    (n,) of each on the side, outwards [N/m]; slope: (n,) of the pressure there, along the side
    [Pa/m]; begins, ends: (k,) of what is wet [m]; low, high: the ends of the side [m]; period:
    (low, high) [m] if it closes upon itself, with images of the particles on both sides, or None;
    dx, h: [m].
    """

    place: float
    x: Array
    force: Array
    slope: Array
    begins: Array
    ends: Array
    low: float
    high: float
    period: tuple[float, float] | None
    dx: float
    h: float

    def pressure(self, places: Array) -> Array:
        """Return the pressures (m,) [Pa] at places (m,) along the side [m]; 0 where it is dry.

        Forces are spread over dx, and averaged over what is wet with a hat of half-width h. Where
        the hat is cut off, the middle of what is left of it is elsewhere; the mean is put right
        by that distance times the slope.
        """
        if self.period is not None:
            low, high = self.period
            places = low + (places - low) % (high - low)
        step = max(sampling.CHUNK // max(len(self.x), 1), 1)
        parts = [self._means(places[k : k + step]) for k in range(0, len(places), step)]
        return np.concatenate([np.zeros(0), *parts])

    def _means(self, places: Array) -> Array:
        at, tiny = places[:, None], np.finfo(float).tiny
        low = np.maximum(self.x - self.dx / 2, self.low)
        high = np.minimum(self.x + self.dx / 2, self.high)
        weight = (_area((high - at) / self.h) - _area((low - at) / self.h)) / (high - low)
        begins, ends = (self.begins - at) / self.h, (self.ends - at) / self.h
        wet = (_area(ends) - _area(begins)).sum(axis=1)
        off = self.h * (_moment(ends) - _moment(begins)).sum(axis=1)
        slope = weight @ self.slope / np.maximum(weight.sum(axis=1), tiny)
        found = (weight @ self.force - off * slope) / np.maximum(wet, tiny)
        away = np.maximum(begins, -ends).min(axis=1, initial=np.inf) * self.h
        return np.where(away <= (sampling.WET - 0.5) * self.dx, found, 0.0)


def _area(q: Array) -> Array:
    """Return the integral of a hat of half-width and area 1 up to q."""
    q = np.clip(q, -1.0, 1.0)
    return np.asarray(0.5 + q - 0.5 * q * np.abs(q))


def _moment(q: Array) -> Array:
    """Return the integral of q times that hat, from 0 to q."""
    q = np.minimum(np.abs(q), 1.0)
    return np.asarray(q**2 / 2 - q**3 / 3)


# --- From the particles ---------------------------------------------------------------------


def loads_on(sim: "Simulation", sides: Sequence[int]) -> dict[int, Load]:
    """Return the loads on sides that mirror the fluid, by their places in `SIDES`.

    The forces are scaled from the particles' mass to rho0 dx^2.
    """
    x, fluid = sampling.positions(sim)[0], sim.scene.fluid
    forces = fluid.rho0 * sim.scene.dx**2 / sim.mass * side_forces(sim, sides)
    pushed = sim.a[: sim.n_fluid].astype(np.float64)
    for side in range(4):
        pushed[:, side // 2] -= _held(sim, side) * OUTWARD[side].sum()
    if sim.scene.effects.field is not None:
        v = sim.v[: sim.n_fluid].astype(np.float64)
        pushed -= sim.scene.effects.field.on(sim.time, x, v)
    pairs = zip(sides, forces, strict=True)
    return {side: _load(sim, side, x, force, -fluid.rho0 * pushed) for side, force in pairs}


def _load(sim: "Simulation", side: int, x: Array, force: Array, slopes: Array) -> Load:
    """Return the load on a side; x: (n, 2) [m], force: (n,) [N/m], slopes: (n, 2) [Pa/m]."""
    box, axis, dx, h = sampling.sides(sim), side // 2, sim.scene.dx, sim.scene.h
    along, walls = 1 - axis, sim.scene.walls
    assert walls is not None
    near = np.abs(x[:, axis] - box[side]) < h
    place, force, slope = x[near, along], force[near], slopes[near, along]
    low, high = box[2 * along : 2 * along + 2]
    period = (walls.period_x, walls.period_y)[along]
    if period is not None:
        place = np.concatenate([place + k * (period[1] - period[0]) for k in (-1, 0, 1)])
        force, slope = np.tile(force, 3), np.tile(slope, 3)
    begins, ends = stretches(place, dx, 2 * sampling.WET)
    # what is less than dx / 2 from an end of the side is no gap
    begins = np.where(begins < low + dx / 2, low, begins)
    ends = np.where(ends > high - dx / 2, high, ends)
    return Load(box[side], place, force, slope, begins, ends, low, high, period, dx, h)


def side_forces(sim: "Simulation", sides: Sequence[int]) -> Array:
    """Return the force (k, n) [N/m] of each fluid particle on k sides that mirror the fluid.

    sides: their places in `SIDES`. Normal to the side, positive outwards: by the images behind
    it, since images along the other axis add up to nothing there, and by what `_held` says.
    """
    engine, whole = sim.engine, sim.engine.model
    assert whole.mirrors is not None
    found = np.empty((len(sides), sim.n_fluid))
    # accelerations without a mirror overwrite those of the present state
    sim._acceleration = None
    try:
        for force, side in zip(found, sides, strict=True):
            mirrors = list(whole.mirrors)
            mirrors[side] = engine.dtype(OUTWARD[side].sum() * np.inf)
            engine.model = whole._replace(mirrors=Box(*mirrors))
            force[engine.fluid.id] = engine.accelerations(sim.time)[side // 2]
    finally:
        engine.model = whole
    for force, side in zip(found, sides, strict=True):
        force -= sim.a[: sim.n_fluid, side // 2]
        force *= OUTWARD[side].sum()
        force += _held(sim, side)
    return sim.mass * found


def _held(sim: "Simulation", side: int) -> Array:
    """Return the acceleration (n,) [m/s^2] out of the box that a side that mirrors the fluid stops.

    Particles that lie where the box clamps press on it, for the rest than against their images.
    """
    mirrors = sim.engine.model.mirrors
    if mirrors is None or not np.isfinite(mirrors[side]):
        return np.zeros(sim.n_fluid)
    outward = OUTWARD[side].sum()
    before = (sampling.sides(sim)[side] - sampling.positions(sim)[0][:, side // 2]) * outward
    out = sim.a[: sim.n_fluid, side // 2].astype(np.float64) * outward
    return np.where(before < (FREEBOARD + TOUCH) * sim.scene.dx, np.maximum(out, 0.0), 0.0)


def stretches(x: Array, dx: float, gap: float) -> tuple[Array, Array]:
    """Return begins and ends (k,) [m] of the stretches of a line that particles cover.

    x: (n,) their places [m]; each covers dx / 2 [m] on both sides, and what is between two that
    are no farther apart than `gap` [dx].
    """
    x, some = np.sort(x), np.ones(min(len(x), 1), bool)
    apart = np.diff(x) > gap * dx
    return x[np.append(some, apart)] - dx / 2, x[np.append(apart, some)] + dx / 2
