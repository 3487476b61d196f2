"""The fluid at places where no particle is: values, velocities, and the level of the surface.

Queries for Python, in plain numpy: they cost nothing in a step.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sph_gym.solver.checks import finite_array
from sph_gym.solver.confinement import stroke_at
from sph_gym.solver.mirror_plates import Plate, mirroring_plates
from sph_gym.solver.periodic import make_period, nearest_image

if TYPE_CHECKING:
    from sph_gym.solver.simulation import Simulation

Array = NDArray[np.float64]

# Pairs of a point and a particle that are looked at together: some ten megabytes.
CHUNK = 1_000_000
# In spacings dx: a point farther than this from all fluid particles is dry; how far apart
# particles must be for a slope between them; reach of the smoothing along y, and the step of the
# samples there, when a surface is looked for.
WET, SLOPE, SMOOTHING, STEP = 1.25, 0.2, 2.0, 0.125


def velocity_at(sim: "Simulation", points: ArrayLike) -> Array:
    """Return the velocities (m, 2) [m/s] of the fluid at points (m, 2) [m]; NaN where it is dry.

    A plane is fitted to the velocities of the fluid particles within h. Points farther than 1.25 dx
    from all of them are dry. Raises ValueError for points that are not finite and of shape (m, 2).
    Source: moving least squares of first order, Lancaster & Salkauskas 1981.
    """
    x, _ = positions(sim)
    return fit(sim, points, x, sim.v[: sim.n_fluid])


def clamped(sim: "Simulation", p: Array) -> Array:
    """Return pressures p [Pa] without those that the fluid doesn't have."""
    return np.maximum(p, 0.0) if sim.scene.fluid.clamp else p


def positions(sim: "Simulation") -> tuple[Array, Array]:
    """Return float64 positions [m] of the fluid (n, 2) and of boundary particles (n_walls, 2)."""
    x = sim._local_x.astype(np.float64) + sim._origin
    return x[: sim.n_fluid], x[sim.n_fluid :]


def offsets(sim: "Simulation", points: Array, x: Array, axis: int) -> Array:
    """Return coordinates (m, n) [m] of points, seen from x, through periodic ends."""
    d: Array = points[:, None] - x
    ends = sim.scene.periods[axis]
    if ends is None:
        return d
    period: Any = make_period(ends, np.float64)
    return np.asarray(nearest_image(period, d))


def fit(
    sim: "Simulation", points: ArrayLike, x: Array, values: ArrayLike, wet: float = WET
) -> Array:
    """Return values (m, k) at points (m, 2) [m]: of planes fitted to those of particles within h.

    x, values: (n, 2) [m] and (n, k) of the particles; wet: distance [dx] from all of them beyond
    which the result is NaN. Where particles are on one line or alone, no slope is fitted across.
    """
    points, values = finite_array("points", points, ("m", 2)), np.asarray(values, np.float64)
    found = np.full((len(points), values.shape[1]), np.nan)
    step = max(CHUNK // max(len(x), 1), 1)
    for first in range(0, len(points), step):
        some = slice(first, first + step)
        # only those that any of the points can see, unless space closes upon itself
        near = np.ones(len(x), bool)
        if sim.scene.walls is None or not sim.scene.walls.is_periodic:
            low, high = points[some].min(axis=0), points[some].max(axis=0)
            near = ((x > low - sim.scene.h) & (x < high + sim.scene.h)).all(axis=1)
        if near.any():
            found[some] = _planes(sim, points[some], x[near], values[near], wet)
    return found


def _planes(sim: "Simulation", points: Array, x: Array, values: Array, wet: float) -> Array:
    """Return the values (m, k) of weighted planes through `values`, NaN at points that are dry."""
    dx = sim.scene.dx
    d = [-offsets(sim, points[:, axis], x[:, axis], axis) for axis in (0, 1)]
    r = np.hypot(*d)
    w = wendland(r / sim.scene.h)
    total = w.sum(axis=1)
    w /= np.where(total > 0, total, 1.0)[:, None]
    mean = np.stack([(w * part).sum(axis=1) for part in d], axis=-1)
    spread = np.empty((len(points), 2, 2))
    for a, b in ((0, 0), (0, 1), (1, 1)):
        spread[:, a, b] = spread[:, b, a] = (w * d[a] * d[b]).sum(axis=1) - mean[:, a] * mean[:, b]
    average = w @ values
    together = np.stack([(w * part) @ values for part in d], axis=1) - (
        mean[:, :, None] * average[:, None, :]
    )
    # damped inverse: a direction in which particles hardly differ has no slope
    size, direction = np.linalg.eigh(spread)
    inverse = size / (size**2 + (SLOPE * dx) ** 4)
    slope = np.einsum("mab,mb,mcb,mck->mak", direction, inverse, direction, together)
    result = average - np.einsum("ma,mak->mk", mean, slope)
    result[~(r.min(axis=1) <= wet * dx)] = np.nan
    return result


def wendland(q: Array) -> Array:
    """Return the shape of the Wendland C2 kernel; q: distances over the support radius."""
    q = np.minimum(q, 1.0)
    return (1 - q) ** 4 * (1 + 4 * q)


def interpolate(sim: "Simulation", points: ArrayLike, walls: bool = True) -> Array:
    """Return velocities (n, 2) [m/s] at points (n, 2) [m]: weighted means of those within h.

    walls: whether boundary particles count, with the velocity of the wall. NaN where no particle
    is within h. Weights: Wendland C2 with the scene's support radius, whatever the scene's kernel,
    since their sum is divided out. Source: Shepard 1968.
    """
    points = finite_array("points", points, ("n", 2))
    n = sim.n_particles if walls else sim.n_fluid
    x, v = sim.x[:n].astype(np.float64), sim.v[:n].astype(np.float64)
    means = np.full((len(points), 2), np.nan)
    step = max(CHUNK // n, 1)
    for first in range(0, len(points), step):
        some = slice(first, first + step)
        d = [offsets(sim, points[some, axis], x[:, axis], axis) for axis in (0, 1)]
        w = wendland(np.hypot(*d) / sim.scene.h)
        total = w.sum(axis=1)
        near = total > 0
        means[some][near] = (w @ v)[near] / total[near, None]
    return means


# --- The level of the surface ---------------------------------------------------------------


def level_at(sim: "Simulation", x: ArrayLike) -> Any:
    """Return the height y [m] of the free surface in the columns at x [m]; NaN where it is dry.

    x: a number, which gives a float, or (m,). The share of space that is filled is smoothed over
    h along x and 2 dx along y, and divided by the share that boundary particles, the box and plates
    around the fluid leave free; the surface is where it falls below one half, the first time above
    the lowest water: what flies or overhangs above doesn't count. For gravity along -y. Raises
    ValueError for x that is not finite, or neither a number nor of shape (m,).
    """
    single = not np.iterable(x)
    places = finite_array("x", [x] if single else x, ("m",))
    fluid, walls = positions(sim)
    plates = mirroring_plates(sim.scene)
    levels = np.array([_level(sim, place, fluid, walls, plates) for place in places])
    return float(levels[0]) if single else levels


def _level(
    sim: "Simulation", place: float, fluid: Array, walls: Array, plates: list[Plate]
) -> float:
    """Return the level [m] in the column at `place` [m]; plates: plates that enclose the fluid."""
    dx, reach = sim.scene.dx, SMOOTHING * sim.scene.dx
    near = [_column(sim, place, x) for x in (fluid, walls)]
    if not len(near[0][0]):
        return np.nan
    low, high = near[0][0].min() - reach, near[0][0].max() + reach
    y = np.arange(low, high + STEP * dx, STEP * dx)
    water, solid = (
        dx * dx * (wendland_1d((y[:, None] - heights) / reach) @ weights) / reach
        for heights, weights in near
    )
    free = np.minimum(1 - solid, _share_inside(sim, place, y, plates))
    filled = np.where(free > 0.1, water / np.maximum(free, 0.1), 0.0)
    wet = np.flatnonzero(filled >= 0.5)
    if not len(wet):
        return np.nan
    dry = wet[0] + int(np.argmax(filled[wet[0] :] < 0.5))
    above, below = filled[dry], filled[dry - 1]
    return float(y[dry] - STEP * dx * (0.5 - above) / (below - above))


def _column(sim: "Simulation", place: float, x: Array) -> tuple[Array, Array]:
    """Return heights y [m] of the particles within h of a column, and their weights [1/m]."""
    far = offsets(sim, np.array([place]), x[:, 0], 0)[0] / sim.scene.h
    near = np.abs(far) < 1
    return x[near, 1], wendland_1d(far[near]) / sim.scene.h


def wendland_1d(q: Array) -> Array:
    """Return the Wendland C2 kernel in one dimension with support radius 1."""
    q = np.minimum(np.abs(q), 1.0)
    return 1.25 * (1 - q) ** 3 * (1 + 3 * q)


def _share_inside(sim: "Simulation", place: float, y: Array, plates: list[Plate]) -> Array:
    """Return the share (m,) of the smoothing along x, at heights y [m], within box and plates."""
    left, right, *_ = sides(sim)
    ends = np.full((2, len(y)), [[left], [right]])
    for plate in plates:
        rise = plate.length * plate.along[1]
        if abs(rise) < sim.scene.dx:
            continue
        up = (y - plate.begin[1]) / rise
        x = plate.begin[0] + up * plate.length * plate.along[0]
        # all fluid began on one side
        is_left = (plate.place(np.asarray(sim.scene.x))[0] * rise).sum() > 0
        side = 0 if is_left else 1
        nearer = np.maximum(ends[0], x) if is_left else np.minimum(ends[1], x)
        ends[side] = np.where((up >= 0) & (up <= 1), nearer, ends[side])
    low, high = (_integral((end - place) / sim.scene.h) for end in ends)
    return high - low


def _integral(q: Array) -> Array:
    """Return the integral of `wendland_1d` from 0 to q."""
    q = np.clip(q, -1.0, 1.0)
    s = np.abs(q)
    return np.asarray(np.sign(q) * 1.25 * (s - 2 * s**3 + 2 * s**4 - 0.6 * s**5))


def sides(sim: "Simulation") -> Array:
    """Return (left, right, bottom, top) [m] of the box as it is now; infinite where it is open."""
    walls, stroke = sim.scene.walls, sim.engine.model.stroke
    if walls is None or walls.box is None:
        return np.array([-np.inf, np.inf, -np.inf, np.inf])
    if stroke is None:
        return np.array(walls.box)
    x, y, *_ = stroke_at(stroke, sim.time)
    moving = (stroke.left * x, stroke.right * x, stroke.bottom * y, stroke.top * y)
    return np.array(walls.box) + moving
