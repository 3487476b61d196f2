"""The force of the fluid on walls: on boundary particles, on sides of the box, on plates."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.checks import known
from sph_gym.solver.forces import add_pair, load_target, no_sums
from sph_gym.solver.jit import jit, jitable
from sph_gym.solver.lanes import broadcast, like, minimum, select, store, unpack
from sph_gym.solver.loads import OUTWARD, side_forces, stretches
from sph_gym.solver.model import with_controls
from sph_gym.solver.neighbors import group_size, neighbor, wall_range
from sph_gym.solver.pressures import pressure_at
from sph_gym.solver.sampling import clamped, fit, positions, sides
from sph_gym.solver.state import column
from sph_gym.solver.walls import SIDES

if TYPE_CHECKING:
    from sph_gym.solver.simulation import Simulation

Array = NDArray[np.float64]

# No side: every pair counts, wherever its line leads.
ANY_SIDE = -1
# Points on a side or a plate at which the pressure is taken, in spacings.
EVERY = 0.5
# Multiple of dx: fluid particles beside a plate that are farther apart leave it dry in between.
GAP = 1.5


def force_on(sim: "Simulation", walls: Any) -> Array:
    """Return the force (2,) [N/m] of the fluid on walls, pressure and friction.

    walls: "particles", all boundary particles; an array of their indices, 0 for the first of
    `walls.particles`, or a mask (n_walls,); a side of the box as it is now, "left", "right",
    "bottom" or "top"; a plate, "plate0" for the first of `walls.plates`.

    On boundary particles: minus the sum of the pair forces that the solver applies to the fluid
    now, so that momentum balances to rounding. On a side with boundary particles beyond it: of
    those pairs whose line passes that side of the box, the method of planes (Todd, Evans, Daivis
    1995); within h of a corner each component counts for the side that it is normal to. On a side
    that mirrors the fluid: of the images behind it, and of particles that lie where the box clamps.
    On both faces of a plate: `pressure_at` integrated along it, normal to it. What the box or a
    plate takes from particles that hit it is in none of them.

    Raises ValueError for other words, a side where the box is open, an index out of range, a mask
    of another length, and a scene that doesn't have such walls.
    """
    if not isinstance(walls, str):
        return _of_particles(sim, _chosen(sim, walls))
    if walls == "particles":
        return _of_particles(sim, np.ones(_count(sim), bool))
    plates = () if sim.scene.walls is None else sim.scene.walls.plates
    names = [f"plate{k}" for k in range(0 if plates is None else len(np.asarray(plates)))]
    name = known("walls", walls, ["particles", *SIDES, *names])
    if name in names:
        return _of_plate(sim, np.asarray(plates)[names.index(name)])
    return _of_side(sim, SIDES.index(name))


# --- Boundary particles ---------------------------------------------------------------------


def _count(sim: "Simulation") -> int:
    """Return the number of boundary particles; ValueError without any."""
    n = sim.n_particles - sim.n_fluid
    if n == 0:
        raise ValueError(
            f"walls: expected a scene with walls.particles, {sim.scene.name!r} has none"
        )
    return n


def _chosen(sim: "Simulation", walls: Any) -> NDArray[np.bool_]:
    """Return a mask (n_walls,) of boundary particles from indices or a mask."""
    n = _count(sim)
    try:
        given = np.asarray(walls)
    except ValueError:
        given = np.asarray(walls, dtype=object)
    if given.dtype == bool and given.shape == (n,):
        return given
    if given.dtype.kind not in "iu" or given.ndim != 1:
        raise ValueError(
            f"walls: expected a name, indices (m,) of boundary particles or a mask ({n},), "
            f"got an array of {given.dtype} of shape {given.shape}"
        )
    if len(given) and not (given.min() >= 0 and given.max() < n):
        raise ValueError(
            f"walls: expected indices from 0 to {n - 1}, got {given.min()} to {given.max()}"
        )
    chosen = np.zeros(n, bool)
    chosen[given] = True
    return chosen


def _of_particles(sim: "Simulation", chosen: Any, side: int = ANY_SIDE) -> Array:
    """Return the force [N/m] on chosen boundary particles, of the pairs that pass `side`."""
    engine = sim.engine
    columns = np.stack([column(engine.n, engine.dtype) for _ in range(2)])
    box = sides(sim) - np.repeat(sim._origin, 2)
    reach = np.minimum(sim.scene.h, (box[1::2] - box[::2]) / 2)
    box = np.append(box, reach).astype(engine.dtype)
    press(*engine.records(), engine.controls, chosen, side, box, columns)
    return -sim.mass * columns[:, : engine.n].sum(axis=1, dtype=np.float64)


@jit
def press(worlds, models, world, model, controls, chosen, side, box, columns):
    """Compute the acceleration (2, n) [m/s^2] of the fluid by chosen boundary particles.

    worlds, models: records; world, model: their shapes; chosen: (n_walls,) True or False, in
    public order; side: place in `SIDES` that the line of a pair must pass, or `ANY_SIDE`; box:
    (6,) left, right, bottom, top, reach of corners along x and y [m]; columns: filled, in the
    order of the fluid's cells.
    """
    cells = unpack(worlds, 0, world).cells
    rules, _ = with_controls(unpack(models, 0, model), controls[0])
    fluid, lists, scale = cells.fluid, cells.lists, rules.constants.force_scale
    i = 0
    while i < fluid.id.size:
        n = group_size(lists, i)
        target = load_target(fluid, i)
        begin, end = wall_range(lists, i)
        ax, ay = add_contacts(target, cells.walls, lists, begin, end, rules, chosen, side, box)
        store(columns[0], i, scale * ax, n)
        store(columns[1], i, scale * ay, n)
        i += n


@jitable
def add_contacts(target, walls, lists, first, last, model, chosen, side, box):
    """Return what the chosen listed boundary particles add to the sums ax, ay of `target`."""
    zero = like(target.x, 0.0)
    ax, ay = zero, zero
    if walls is None:
        return ax, ay
    for k in range(first, last):
        j = neighbor(lists, k)
        if chosen[walls.id[j]]:
            none = no_sums(zero)
            pair = add_pair(
                target, walls, j, model.kernel, model.constants, model.wall_effects, none
            )
            on_x, on_y = shares_through(side, box, target.x, target.y, walls, j)
            ax, ay = ax + on_x * pair.ax, ay + on_y * pair.ay
    return ax, ay


@jitable
def shares_through(side, box, x, y, walls, j):
    """Return the shares, 0 or 1, of the components of a pair force that act on `side`.

    The pair is (x, y) and boundary particle j. Within reach of a corner each component belongs to
    the side that it is normal to: there the line of a pair may lead past either side.
    """
    one, zero = like(x, 1.0), like(x, 0.0)
    if side < 0:
        return one, one
    wall_x, wall_y = broadcast(walls.x, j), broadcast(walls.y, j)
    left, right = _passed(x - box[0], box[0] - wall_x), _passed(box[1] - x, wall_x - box[1])
    bottom, top = _passed(y - box[2], box[2] - wall_y), _passed(box[3] - y, wall_y - box[3])
    first = minimum(minimum(left, right), minimum(bottom, top))
    leaves = select(first < one + one, one, zero)
    exit_x, exit_y = x + first * (wall_x - x), y + first * (wall_y - y)
    if side < 2:
        passed, gap = select_side(side == 0, left, right, exit_x - box[0], box[1] - exit_x)
        corner = minimum(exit_y - box[2], box[3] - exit_y)
        normal, along = leaves * _below(gap, box[4]), leaves * (one - _below(corner, box[5]))
        return normal, select(first < passed, zero, along)
    passed, gap = select_side(side == 2, bottom, top, exit_y - box[2], box[3] - exit_y)
    corner = minimum(exit_x - box[0], box[1] - exit_x)
    normal, along = leaves * _below(gap, box[5]), leaves * (one - _below(corner, box[4]))
    return select(first < passed, zero, along), normal


@jitable
def select_side(is_lower, lower, upper, lower_gap, upper_gap):
    """Return what belongs to one of two opposite sides."""
    if is_lower:
        return lower, lower_gap
    return upper, upper_gap


@jitable
def _below(gap, limit):
    """Return 1 where a gap is smaller than a limit, else 0."""
    return select(gap < like(gap, limit), like(gap, 1.0), like(gap, 0.0))


@jitable
def _passed(before, beyond):
    """Return the share of a line after which it passes a side; 2 if it doesn't.

    before, beyond: distances of its two ends from the side, inside and outside.
    """
    one, zero = like(before, 1.0), like(before, 0.0)
    outside = like(before, 0.0) + beyond
    passes = outside > zero
    return select(passes, before / select(passes, before + outside, one), one + one)


# --- Sides and plates -----------------------------------------------------------------------


def _of_side(sim: "Simulation", side: int) -> Array:
    """Return the force [N/m] on a side of the box."""
    box, along = sides(sim), 1 - side // 2
    if not np.isfinite(box[side]):
        raise ValueError(f"walls: expected a side that walls.box has, got {SIDES[side]!r}")
    fluid, walls = positions(sim)
    beyond = (walls - box[side]) @ OUTWARD[side] > 0 if len(walls) else np.zeros(0, bool)
    beside = walls[:, along]
    low, high = box[2 * along : 2 * along + 2]
    if (beyond & (beside > low) & (beside < high)).any():
        return _of_particles(sim, np.ones(len(walls), bool), side)
    mirrors = sim.engine.model.mirrors
    if mirrors is not None and np.isfinite(mirrors[side]):
        return side_forces(sim, [side]).sum() * OUTWARD[side]
    low = max(low, fluid[:, along].min() - sim.scene.dx)
    high = min(high, fluid[:, along].max() + sim.scene.dx)
    ends = np.full((2, 2), box[side])
    ends[:, along] = low, high
    points, length = _points(sim, *ends)
    return pressure_at(sim, points).sum() * length * OUTWARD[side]


def _of_plate(sim: "Simulation", plate: Array) -> Array:
    """Return the force [N/m] on both faces of a plate, by the fluid before each of them."""
    x, _ = positions(sim)
    start, end = plate[:2], plate[2:]
    points, length = _points(sim, start, end)
    tangent = (end - start) / np.hypot(*(end - start))
    normal = np.array([-tangent[1], tangent[0]])
    total = 0.0
    for face in (1.0, -1.0):
        distance = face * ((x - start) @ normal)
        before = distance > 0
        beside = (x[before & (distance < sim.scene.h)] - start) @ tangent
        if not len(beside):
            continue
        # boundary particles may keep the fluid at a distance
        reach = sim.scene.h / sim.scene.dx
        p = fit(sim, points, x[before], sim.p[: sim.n_fluid][before, None], reach)[:, 0]
        wet = _covered((points - start) @ tangent, length, beside, sim.scene.dx)
        total -= face * float(wet @ clamped(sim, np.nan_to_num(p, nan=0.0))) * length
    return total * normal


def _covered(places: Array, length: float, beside: Array, dx: float) -> Array:
    """Return the shares (m,) of pieces of a line that are wet.

    places: (m,) their middles, each of this length; beside: (n,) places of fluid particles dx
    apart, n >= 1, along the line, which is wet up to dx / 2 beyond them; all in [m].
    """
    begins, ends = stretches(beside, dx, GAP)
    low, high = (places + sign * length / 2 for sign in (-1, 1))
    wet = np.minimum(high[:, None], ends) - np.maximum(low[:, None], begins)
    return np.asarray(np.maximum(wet, 0.0).sum(axis=1) / length)


def _points(sim: "Simulation", start: Array, end: Array) -> tuple[Array, float]:
    """Return the middles (m, 2) [m] of equal pieces of a segment, and the length of each [m]."""
    length = float(np.hypot(*(end - start)))
    n = max(int(np.ceil(length / (EVERY * sim.scene.dx))), 1)
    shares = (np.arange(n) + 0.5) / n
    return start + shares[:, None] * (end - start), length / n
