"""The pressure between the particles of the fluid, and on sides of the box that mirror it.

Queries for Python, in plain numpy: they cost nothing in a step.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sph_gym.solver import sampling
from sph_gym.solver.checks import finite_array
from sph_gym.solver.loads import OUTWARD, loads_on
from sph_gym.solver.sampling import clamped, fit, positions

if TYPE_CHECKING:
    from sph_gym.solver.simulation import Simulation

Array = NDArray[np.float64]


def pressure_at(sim: "Simulation", points: ArrayLike) -> Array:
    """Return the pressures (m,) [Pa] of the fluid at points (m, 2) [m]; 0 where there is none.

    Within the fluid and on walls of boundary particles: of a plane fitted to the pressures of the
    fluid particles within h, `sim.p`, so that it is right where pressures grow towards a wall.

    On a side of the box that mirrors the fluid, and behind it: the force per length that the side
    takes there, a mean over what is wet within h along it. The particles' own pressures alternate
    from row to row before a mirror and say little. Their mass isn't quite rho0 dx^2; the forces
    are scaled to one that is, so that the pressure of water at rest is rho0 g times its depth.

    Up to h before such a side: linear along its normal, from the pressure on the side to that of
    the particles at h. Near a corner of two such sides along both normals.

    Points farther than 1.25 dx from all fluid particles are dry. Not below 0 in a fluid whose
    pressures are clamped. Raises ValueError for points that are not finite and of shape (m, 2).
    Sources: moving least squares of first order, Lancaster & Salkauskas 1981; the blend of two
    sides, Coons 1967.
    """
    points, (x, _) = finite_array("points", points, ("m", 2)), positions(sim)
    p = sim.p[: sim.n_fluid, None]
    found = fit(sim, points, x, p)[:, 0]
    near = _near_sides(sim, points)
    some = near.any & np.isfinite(found)
    if some.any():
        near = near.of(some)
        inside = np.nan_to_num(fit(sim, near.inner, x, p)[:, 0], nan=0.0)
        found[some] = _blend(sim, near, inside)
    return clamped(sim, np.nan_to_num(found, nan=0.0))


# --- Near sides that mirror the fluid -------------------------------------------------------


class _Near(NamedTuple):
    """The sides near points, at most one an axis.

    side: (2, m) its place in `SIDES`, -1 without one; share: (2, m) of the way from the side to
    where the particles' pressures count alone, 1 without one; inner: (m, 2) that place [m];
    points: (m, 2) those that are behind a side put onto it [m].
    """

    side: NDArray[np.int64]
    share: Array
    inner: Array
    points: Array

    @property
    def any(self) -> NDArray[np.bool_]:
        """(m,) whether any side is near."""
        return np.asarray((self.side >= 0).any(axis=0))

    def of(self, some: NDArray[np.bool_]) -> "_Near":
        """Return what belongs to some of the points."""
        return _Near(self.side[:, some], self.share[:, some], self.inner[some], self.points[some])


def _near_sides(sim: "Simulation", points: Array) -> _Near:
    """Return the sides that mirror the fluid and are within h before points (m, 2) [m]."""
    m = len(points)
    near = _Near(np.full((2, m), -1), np.ones((2, m)), points.copy(), points.copy())
    mirrors = sim.engine.model.mirrors
    if mirrors is None:
        return near
    box = sampling.sides(sim)
    for side in np.flatnonzero(np.isfinite(mirrors[:4])):
        axis, outward = side // 2, OUTWARD[side].sum()
        # two sides of a narrow box share what is between them
        reach = min(sim.scene.h, (box[2 * axis + 1] - box[2 * axis]) / 2)
        before = (box[side] - points[:, axis]) * outward
        here = before < reach
        near.side[axis, here] = side
        near.share[axis, here] = np.maximum(before[here] / reach, 0.0)
        near.inner[here, axis] = box[side] - reach * outward
        near.points[before < 0, axis] = box[side]
    return near


def _blend(sim: "Simulation", near: _Near, inside: Array) -> Array:
    """Return the pressures (m,) [Pa] at points; inside: (m,) [Pa] of the particles at `inner`."""
    found = near.share.prod(axis=0) * inside
    loads = loads_on(sim, [int(side) for side in np.unique(near.side) if side >= 0])
    for pair in np.unique(near.side, axis=1).T:
        here = (pair == near.side.T).all(axis=1)
        left = 1 - near.share[:, here]
        one, other = (loads.get(int(side)) for side in pair)
        if one is not None:
            found[here] += left[0] * one.pressure(near.points[here, 1])
        if other is not None:
            found[here] += left[1] * other.pressure(near.points[here, 0])
        if one is not None and other is not None:
            # what both say of the corner counts once
            both = one.pressure(np.array([other.place])), other.pressure(np.array([one.place]))
            found[here] -= left.prod(axis=0) * np.mean(both)
    return found
