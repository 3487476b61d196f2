"""Time: how long a step may be, and all the substeps of one call inside one compiled function."""

import math
from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.diagnostics import sum_up
from sph_gym.solver.effects import PairEffects, UniformGravity, add_gravity, smoothed
from sph_gym.solver.forces import (
    Constants,
    compute_fluid_density,
    compute_wall_density,
    compute_wall_sums,
    force_sums,
)
from sph_gym.solver.jit import jit, jitable
from sph_gym.solver.lanes import first_lanes, first_true, like, load, select, store, width
from sph_gym.solver.neighbors import (
    Lists,
    Sorting,
    group_size,
    lay_grid,
    own_blocks,
    read_grid,
    sort_into_cells,
)
from sph_gym.solver.state import Indices, Particles
from sph_gym.solver.teams import meet
from sph_gym.solver.walls import Box, confine

# The article's limits. Its 0.4 h^2/nu diverges where h is the support radius; 0.125: Morris 1997.
COURANT = 0.4
FORCE = 0.25
VISCOUS = 0.125

# Columns of `World.status`: steps done by thread 0, the first particle in a thread's share that
# failed or -1, whether a thread's list was too short; the particles that are its share.
STEPS, BAD, FULL, FIRST, LAST = 0, 1, 2, 3, 4
# Steps after which the grid follows the fluid within a call.
LAY_EVERY = 64

# Faster than this [m/s] is a blow-up, whatever the scene.
TOP_SPEED = 5000.0


class Model(NamedTuple):
    """All that doesn't change within a call; absent parts are None and compiled away."""

    kernel: Any
    eos: Any
    constants: Constants
    effects: PairEffects
    wall_effects: PairEffects
    gravity: UniformGravity | None
    box: Box | None


def stable_dt(h: float, c: float, a_max: float, nu: float | None) -> float:
    """The largest step [s] that the article allows: min(CFL, force limit, viscous limit).

    h: support radius [m]; c: sound speed [m/s]; a_max: largest |a| [m/s^2]; nu: kinematic
    viscosity [m^2/s] or None. Source: the playbook; Morris, Fox, Zhu 1997 for the viscous limit.
    """
    limit = COURANT * h / c
    if a_max > 0:
        limit = min(limit, FORCE * math.sqrt(h / a_max))
    if nu:
        limit = min(limit, VISCOUS * h * h / nu)
    return limit


class World(NamedTuple):
    """All arrays of a simulation. Absent parts are None.

    fluid: the state, in the order of its cells, with densities and pressures; spare: the same
    state as the last step left it, or scratch; start, wall_start: (n_cells + 1,) first particle
    of every cell; walls: in the order of the cells; wall_source: in public order; wall_sums,
    source_sums: kernel sums of wall particles over each other, in the two orders, below 0 while
    unknown; status: (n_threads, 5) int64, see the constants above; team: flags of the threads;
    totals: (9,) of the state, see `diagnostics.Totals`.
    """

    fluid: Particles
    spare: Particles
    start: Indices
    walls: Particles | None
    wall_source: Particles | None
    wall_start: Indices | None
    wall_sums: Any
    source_sums: Any
    sorting: Sorting
    lists: Lists | None
    status: Any
    team: Any
    totals: Any


@jitable
def sort_all(rank, n_threads, laying, world, h):
    """The fluid from `spare` to `fluid` in the order of its cells, on a new grid if `laying`.

    The walls are sorted only where the grid has moved, and always from the same order, so that a
    restored run sums in the order of the first. Returns False if the team was told to stop.
    """
    sorting, team = world.sorting, world.team
    if laying:
        if rank == 0 and lay_grid(sorting.frame, world.spare, h, world.start.size - 1):
            _sort_walls(
                world.walls, world.wall_source, world.wall_sums, world.source_sums,
                rank, rank + 1, team, read_grid(sorting.frame), sorting, world.wall_start,
            )  # fmt: skip
        if not meet(team, n_threads):
            return False
    grid = read_grid(sorting.frame)
    return sort_into_cells(
        rank, n_threads, team, grid, world.spare, world.fluid, sorting, world.start
    )


@jitable
def _sort_walls(
    walls, source, wall_sums, source_sums, rank, n_threads, team, grid, sorting, wall_start
):
    if walls is None:
        return
    sort_into_cells(rank, n_threads, team, grid, source, walls, sorting, wall_start)
    for i in range(walls.id.size):
        wall_sums[i] = source_sums[walls.id[i]]


@jitable
def prepare_walls(
    rank, n_threads, walls, wall_sums, source_sums, wall_start, grid, lists, kernel, constants
):
    """Find out the walls' sums over each other if they are unknown; True: list too short."""
    if walls is None or rank > 0 or source_sums[0] >= 0.0:
        return False
    if compute_wall_sums(
        rank, n_threads, walls, wall_sums, wall_start, grid, lists, kernel, constants
    ):
        return True
    for i in range(walls.id.size):
        source_sums[walls.id[i]] = wall_sums[i]
    return False


@jitable
def any_full(status, n_threads):
    """Whether any thread's list was too short."""
    full = False
    for t in range(n_threads):
        full = full or status[t, FULL] != 0
    return full


@jitable
def first_bad(status, n_threads):
    """The first particle that failed in any thread's share; -1 if none did."""
    for t in range(n_threads):
        if status[t, BAD] >= 0:
            return status[t, BAD]
    return -1


@jit
def evaluate_acceleration(i, fluid, walls, lists, model, time, ax, ay):
    """Acceleration [m/s^2] of the fluid particles from i on, in the order of `fluid`."""
    n_fluid = fluid.id.size
    scale = model.constants.force_scale
    while i < n_fluid:
        n = group_size(lists, i, min(width(ax), n_fluid - i))
        sums = force_sums(
            i, fluid, walls, lists,
            model.kernel, model.constants, model.effects, model.wall_effects,
        )  # fmt: skip
        x, y = add_gravity(model.gravity, time, scale * sums.ax, scale * sums.ay)
        store(ax, i, x, n)
        store(ay, i, y, n)
        i += n


@jitable
def kick_and_drift(first, last, source, target, walls, lists, model, time, dt):
    """Symplectic Euler for particles first to last: v += a dt, then x += (smoothed v) dt.

    The XSPH sum is that of the velocities before the kick, so that one pair loop serves both.
    Returns the first of them that is no longer finite or too fast, or -1.
    """
    for k in range(first, last):
        target.id[k] = source.id[k]
    i = first
    scale = model.constants.force_scale
    bad = -1
    while i < last:
        n = group_size(lists, i, min(width(source.x), last - i))
        sums = force_sums(
            i, source, walls, lists,
            model.kernel, model.constants, model.effects, model.wall_effects,
        )  # fmt: skip
        ax, ay = add_gravity(model.gravity, time, scale * sums.ax, scale * sums.ay)
        u = load(source.u, i) + dt * ax
        v = load(source.v, i) + dt * ay
        drift_u, drift_v = smoothed(model.effects.xsph, u, v, sums)
        x = load(source.x, i) + dt * drift_u
        y = load(source.y, i) + dt * drift_v
        x, y, u, v = confine(model.box, x, y, u, v)
        store(target.x, i, x, n)
        store(target.y, i, y, n)
        store(target.u, i, u, n)
        store(target.v, i, v, n)
        wrong = first_true(insane(x, y, u, v) & first_lanes(x, n))
        if wrong >= 0 and bad < 0:
            bad = i + wrong
        i += n
    return bad


@jitable
def insane(x, y, u, v):
    """Where a position is no longer finite or a speed absurd."""
    # not x - x == 0, which reassociation folds to True; nor a negated mask, for plain bools
    zero, one = like(x, 0.0), like(x, 1.0)
    slow = select(u * u + v * v < like(u, TOP_SPEED * TOP_SPEED), zero, one)
    return slow + select(abs(x) + abs(y) < like(x, np.inf), zero, one) > zero


@jit
def advance(rank, n_threads, world, model, stale, time, dt, n_substeps):
    """n_substeps steps of the whole chain: force, integration, neighbours, density, pressure.

    `world.fluid` holds the state before and after, with densities, pressures and lists; `stale`
    says that these are not up to date, and that the state is to be taken from `spare`. When a
    step fails, `fluid` still holds the state before it; when a list was too short, `spare` holds
    the state after the last step, for another call with larger lists. `world.status` says so.
    """
    fluid, spare, start = world.fluid, world.spare, world.start
    walls, wall_start, wall_sums = world.walls, world.wall_start, world.wall_sums
    lists, status, team = world.lists, world.status, world.team
    kernel, eos, constants = model.kernel, model.eos, model.constants
    status[rank, STEPS], status[rank, BAD], status[rank, FULL] = 0, -1, 0
    for k in range(n_substeps + 1):
        if k > 0:
            now = time + (k - 1) * float(dt)
            first, last = status[rank, FIRST], status[rank, LAST]
            bad = kick_and_drift(first, last, fluid, spare, walls, lists, model, now, dt)
            status[rank, STEPS], status[rank, BAD] = k, bad
            if not meet(team, n_threads) or first_bad(status, n_threads) >= 0:
                return
        elif not stale:
            continue
        laying = k == n_substeps or k % LAY_EVERY == 0
        if not sort_all(rank, n_threads, laying, world, float(constants.h)):
            return
        grid = read_grid(world.sorting.frame)
        first, last = own_blocks(grid, start, fluid.id.size, width(fluid.x), rank, n_threads)
        status[rank, FIRST], status[rank, LAST] = first, last
        full = prepare_walls(
            rank, n_threads, walls, wall_sums, world.source_sums, wall_start, grid, lists,
            kernel, constants,
        )  # fmt: skip
        full = full or compute_wall_density(
            rank, n_threads, walls, wall_sums, wall_start, fluid, start, grid, lists,
            kernel, eos, constants,
        )  # fmt: skip
        full = full or compute_fluid_density(
            rank, n_threads, first, last, fluid, start, walls, wall_start, grid, lists,
            kernel, eos, constants,
        )  # fmt: skip
        status[rank, FULL] = full
        if not meet(team, n_threads) or any_full(status, n_threads):
            return
    if rank == 0:
        sum_up(fluid, walls, eos, world.totals)
