"""Time: how long a step may be, and all the substeps of one call inside one compiled function."""

import math
from typing import Any, NamedTuple

from sph_gym.solver.density import (
    Alone,
    Constants,
    Extrapolation,
    add_weights,
    compute_fluid_density,
    compute_wall_density,
    compute_wall_sums,
    extrapolate,
    store_density,
)
from sph_gym.solver.diagnostics import sum_up, survey
from sph_gym.solver.effects import PairEffects
from sph_gym.solver.integrators import end_step, evaluates_last, move, moves, rates, settle
from sph_gym.solver.jit import jit, jitable
from sph_gym.solver.lanes import like, load, store, unpack, width
from sph_gym.solver.neighbors import (
    Lists,
    Sorting,
    group_size,
    lay_grid,
    own_blocks,
    own_part,
    read_grid,
    sort_into_cells,
)
from sph_gym.solver.state import Indices, Particles
from sph_gym.solver.teams import meet
from sph_gym.solver.walls import Box, Plates, Stroke, stroke_at, wrap_far

# The article's limits. Its 0.4 h^2/nu diverges where h is the support radius; 0.125: Morris 1997.
COURANT = 0.4
FORCE = 0.25
VISCOUS = 0.125

# Columns of `World.status`: steps done by thread 0, the first particle in a thread's share that
# failed or -1, whether a thread's list was too short; the particles that are its share; where in
# a step the call ended, see below; where the fluid's part of the thread's list ends; the first
# particle in its share that is inside of a wall or -1.
STEPS, BAD, FULL, FIRST, LAST, STAGE, LISTED, WALLED = 0, 1, 2, 3, 4, 5, 6, 7
N_STATUS = 8
# What is to be done before the next step: nothing; densities and lists, from `spare`; rates too,
# since they depend on what has changed; densities and the second half of the present step.
FRESH, UNSORTED, UNKNOWN, HALFWAY = 0, 1, 2, 3
# Steps after which the grid follows the fluid within a call.
LAY_EVERY = 64


class Model(NamedTuple):
    """All that doesn't change within a call; absent parts are None and compiled away.

    halves: the integrator once more, if its steps have a second half.
    """

    kernel: Any
    eos: Any
    constants: Constants
    effects: PairEffects
    wall_effects: PairEffects
    gravity: Any
    box: Box | None
    plates: Plates | None
    alone: Alone | None
    extrapolation: Extrapolation | None
    stroke: Stroke | None
    integrator: Any
    halves: Any


def stable_dt(
    h: float, c: float, a_max: float, nu: float | None, viscous: float = VISCOUS
) -> float:
    """The largest step [s] that the article allows: min(CFL, force limit, viscous limit).

    h: support radius [m]; c: sound speed [m/s]; a_max: largest |a| [m/s^2]; nu: kinematic
    viscosity [m^2/s] or None; viscous: share of h^2 / nu, which depends on the kernel
    (`Scene.viscous_share`). Source: the playbook; Morris, Fox, Zhu 1997 for the viscous limit.
    """
    limit = COURANT * h / c
    if a_max > 0:
        limit = min(limit, FORCE * math.sqrt(h / a_max))
    if nu:
        limit = min(limit, viscous * h * h / nu)
    return limit


class World(NamedTuple):
    """All arrays of a simulation. Absent parts are None.

    fluid: the state, in the order of its cells, with densities and pressures; spare: the same
    state as the last step left it, or scratch; start, wall_start: (n_cells + 1,) first particle
    of every cell; walls: in the order of the cells; wall_source: in public order; wall_rest: the
    same before they moved, moves: (n,) 1 for those that move; wall_sums, source_sums: kernel sums
    of wall particles over each other, in the two orders; status: (n_threads, 8) int64, see the
    constants above; team: flags of the threads; totals: (9,) of the state, see
    `diagnostics.Totals`; clock: (1,) time [s] of the state and of the walls.
    """

    fluid: Particles
    spare: Particles
    start: Indices
    walls: Particles | None
    wall_source: Particles | None
    wall_rest: Particles | None
    moves: Any
    wall_start: Indices | None
    wall_sums: Any
    source_sums: Any
    sorting: Sorting
    lists: Lists | None
    status: Any
    team: Any
    totals: Any
    clock: Any


# --- Sorting --------------------------------------------------------------------------------


@jitable
def sort_all(rank, n_threads, laying, world, model, time):
    """The fluid from `spare` to `fluid` in the order of its cells, on a new grid if `laying`.

    The walls are sorted only where they or the grid have moved, and always from the same order,
    so that a restored run sums in the order of the first. Returns False if the team was told to
    stop.
    """
    sorting, team, h = world.sorting, world.team, float(model.constants.h)
    moved = is_there(model.stroke)
    if laying or moved:
        if rank == 0:
            moved = move_walls(
                model.stroke, world.wall_source, world.wall_rest, world.moves, model.constants,
                time,
            )  # fmt: skip
            if laying:
                moved = lay_grid(sorting.frame, world.spare, h, world.start.size - 1) or moved
            if moved:
                _sort_walls(
                    world.walls, world.wall_source, world.wall_sums, world.source_sums,
                    rank, rank + 1, team, read_grid(sorting.frame), sorting, world.wall_start,
                )  # fmt: skip
        if not meet(team, n_threads):
            return False
    grid = read_grid(sorting.frame)
    return sort_into_cells(
        rank, n_threads, team, grid, world.spare, world.fluid, sorting, world.start
    )  # fmt: skip


@jitable
def is_there(part):
    """Whether a part of the model is not absent; known when this is compiled."""
    return part is not None


@jitable
def move_walls(stroke, source, rest, moves, constants, time):
    """Boundary particles to where they are at a time [s]; whether there are any that move."""
    if stroke is None:
        return False
    _displace(source, rest, moves, constants, stroke, time)
    return True


@jitable
def _displace(source, rest, moves, constants, stroke, time):
    if source is None:
        return
    x, y, u, v = stroke_at(stroke, time)
    square = stroke.omega * stroke.omega * math.sin(stroke.omega * time)
    for i in range(source.id.size):
        share = moves[i]
        source.x[i] = wrap_far(constants.period_x, rest.x[i] + share * x)
        source.y[i] = wrap_far(constants.period_y, rest.y[i] + share * y)
        source.u[i], source.v[i] = rest.u[i] + share * u, rest.v[i] + share * v
        source.ax[i], source.ay[i] = -share * stroke.ax * square, -share * stroke.ay * square


@jitable
def _sort_walls(
    walls, source, wall_sums, source_sums, rank, n_threads, team, grid, sorting, wall_start
):
    if walls is None:
        return
    sort_into_cells(rank, n_threads, team, grid, source, walls, sorting, wall_start)
    for i in range(walls.id.size):
        wall_sums[i] = source_sums[walls.id[i]]


# --- Densities ------------------------------------------------------------------------------


@jitable
def renew_wall_sums(
    stroke, rank, n_threads, walls, wall_sums, wall_start, grid, lists, kernel, constants, team
):  # fmt: skip
    """The sums of boundary particles over each other, where these move; True: list too short."""
    if stroke is None or walls is None:
        return False
    full = False
    if rank == 0:
        full = compute_wall_sums(
            rank, n_threads, walls, wall_sums, wall_start, grid, lists, kernel, constants
        )
    # a failure at this barrier is found at the next one
    meet(team, n_threads)
    return full


@jitable
def compute_like_fluid(
    extrapolation, stroke, rank, n_threads, walls, wall_sums, wall_start, fluid, start, grid,
    lists, kernel, eos, constants, team,
):  # fmt: skip
    """Densities of boundary particles that are like fluid. Returns whether a list was too short."""
    if extrapolation is None:
        full = renew_wall_sums(
            stroke, rank, n_threads, walls, wall_sums, wall_start, grid, lists, kernel, constants,
            team,
        )  # fmt: skip
        return full or compute_wall_density(
            rank, n_threads, walls, wall_sums, wall_start, fluid, start, grid, lists,
            kernel, eos, constants,
        )  # fmt: skip
    return False


# --- Steps ----------------------------------------------------------------------------------


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
    return _first(status, n_threads, BAD)


@jitable
def _first(status, n_threads, kind):
    for t in range(n_threads):
        if status[t, kind] >= 0:
            return status[t, kind]
    return -1


@jit
def sum_walls(i, walls, sums, kernel, constants):
    """Fill `sums` from i on: kernel sums of boundary particles over each other, by brute force."""
    while i < walls.id.size:
        x, y = load(walls.x, i), load(walls.y, i)
        total = add_weights(
            None, walls, None, 0, walls.id.size, kernel, constants, x, y, like(x, 0.0)
        )
        n = min(width(sums), walls.id.size - i)
        store(sums, i, total, n)
        i += n


@jit
def renew_pressures(worlds, models, world, model):
    """Pressures that belong to the present densities, after the stiffness has changed.

    worlds, models: records; world, model: their shapes.
    """
    state, rules = unpack(worlds, 0, world), unpack(models, 0, model)
    _press(state.fluid, rules.eos)
    _press(state.walls, rules.eos)
    sum_up(state.fluid, state.walls, rules.extrapolation, rules.eos, state.totals)


@jitable
def _press(particles, eos):
    if particles is None:
        return
    i, n = 0, particles.id.size
    while i < n:
        store_density(particles, i, min(width(particles.rho), n - i), load(particles.rho, i), eos)
        i += width(particles.rho)


@jit
def evaluate_acceleration(i, fluid, walls, lists, model, time, ax, ay):
    """Acceleration [m/s^2] of the fluid particles from i on, in the order of `fluid`."""
    n_fluid = fluid.id.size
    while i < n_fluid:
        n = group_size(lists, i, min(width(ax), n_fluid - i))
        here = rates(i, fluid, walls, lists, model, time)
        store(ax, i, here.ax, n)
        store(ay, i, here.ay, n)
        i += n


@jit
def examine(
    worlds, models, world, model, stale, time, ax, ay, gravity, com, clumped, work, numbers
):
    """Fill `numbers` with a `diagnostics.Survey`, and ax and ay, if they are `stale`, before.

    worlds, models: records; world, model: their shapes; gravity, com: (2,). One call for both:
    from Python, a call costs as much as a look at some hundred particles.
    """
    state, rules = unpack(worlds, 0, world), unpack(models, 0, model)
    fluid, walls, lists = state.fluid, state.walls, state.lists
    if stale:
        evaluate_acceleration(0, fluid, walls, lists, rules, time, ax, ay)
    survey(
        fluid, walls, lists, rules.constants, rules.kernel.h2, ax, ay, gravity[0], gravity[1],
        com[0], com[1], clumped, float(rules.eos.inv_rho0), work, numbers,
    )  # fmt: skip


@jitable
def finish_step(halves, rank, n_threads, fluid, spare, walls, lists, status, team, model, time, dt):
    """Evaluate forces after particles have moved, where the integrator does; `time`: of the step.

    Returns False if it failed or the team was told to stop.
    """
    if halves is None:
        return True
    first, last = status[rank, FIRST], status[rank, LAST]
    status[rank, BAD] = end_step(halves, first, last, fluid, spare, walls, lists, model, time, dt)
    if not meet(team, n_threads) or first_bad(status, n_threads) >= 0:
        return False
    settle(halves, first, last, spare, fluid, model)
    return meet(team, n_threads)


@jitable
def complete_step(rank, n_threads, world, model, began, length, shown):
    """What is left of the step from `began` to `began` + `length` [s], after particles have moved.

    shown: whether somebody may look at what walls without slip are like then, which follow
    velocities. Returns False if it failed, a list was too short or the team was told to stop.
    """
    fluid, walls, lists, status = world.fluid, world.walls, world.lists, world.status
    if not finish_step(
        model.halves, rank, n_threads, fluid, world.spare, walls, lists, status, world.team, model,
        began, length,
    ):  # fmt: skip
        return False
    return not (is_there(model.halves) and shown) or follow_fluid(
        model.extrapolation, rank, n_threads, walls, world.wall_start, fluid, world.start,
        read_grid(world.sorting.frame), lists, status, world.team, model, began + length,
    )  # fmt: skip


@jitable
def follow_fluid(
    extrapolation, rank, n_threads, walls, wall_start, fluid, start, grid, lists, status, team,
    model, time,
):  # fmt: skip
    """Give boundary particles the pressure of the fluid, where they wait for it.

    Returns False if a list was too short or the team was told to stop.
    """
    if extrapolation is None:
        return True
    status[rank, FULL] = extrapolate(
        extrapolation, rank, n_threads, status[rank, LISTED], walls, wall_start, fluid, start,
        grid, lists, model.kernel, model.eos, model.constants, model.gravity, time,
    )  # fmt: skip
    return meet(team, n_threads) and not any_full(status, n_threads)


@jit
def advance(rank, n_threads, bounds, worlds, models, world, model, legs, dts):
    """`_advance` for simulations bounds[rank] to bounds[rank + 1], each on one thread.

    Without bounds for the first one, on all threads. worlds, models: records; world, model: their
    shapes; legs: (n, 4) stale, time [s], done and n_substeps of each; dts: (n,) [s].
    The only way in: the same machine code, and so the same bits, for one simulation and for many.
    """
    begin, end, part, n_parts = 0, 1, rank, n_threads
    if bounds.size > 0:
        begin, end, part, n_parts = bounds[rank], bounds[rank + 1], 0, 1
    for i in range(begin, end):
        _advance(
            part, n_parts, unpack(worlds, i, world), unpack(models, i, model),
            int(legs[i, 0]), legs[i, 1], dts[i], int(legs[i, 2]), int(legs[i, 3]),
        )  # fmt: skip


@jitable
def _advance(rank, n_threads, world, model, stale, time, dt, done, n_substeps):
    """n_substeps steps of the whole chain: force, integration, neighbours, density, pressure.

    time: [s] before the first of them; done: how many of them an earlier call did, whose list was
    too short. A step consists of one or two moves of the particles, depending on the integrator,
    each followed by the rest of the chain. `world.fluid` holds the state before and after, with
    densities, pressures and lists; `stale` says what of it is not up to date (see FRESH and the
    others). When a step fails, `fluid` holds the last finite state; when a list was too short,
    `spare` holds a state for another call with larger lists; when a particle ends within a wall,
    `fluid` holds the state with it there. `world.status` says so.
    """
    fluid, spare, start = world.fluid, world.spare, world.start
    walls, wall_start, wall_sums = world.walls, world.wall_start, world.wall_sums
    lists, status, team = world.lists, world.status, world.team
    kernel, eos, constants = model.kernel, model.eos, model.constants
    status[rank, STEPS], status[rank, BAD], status[rank, FULL] = done, -1, 0
    n_moves = moves(model.integrator)
    # a step that an earlier call began is finished first
    first_move = done * n_moves - (n_moves - 1 if stale == HALFWAY else 0)
    last_move = n_substeps * n_moves
    for k in range(first_move, last_move + 1):
        step, part = divmod(k - 1, n_moves)
        began, length = time + step * float(dt), dt * 1.0
        if k > first_move:
            first, last = status[rank, FIRST], status[rank, LAST]
            bad = move(
                model.integrator, part, first, last, fluid, spare, walls, lists, model, began, dt
            )
            status[rank, STEPS], status[rank, BAD] = step + 1, bad
            halfway = part + 1 < n_moves or evaluates_last(model.integrator)
            status[rank, STAGE] = HALFWAY if halfway else UNSORTED
            if not meet(team, n_threads) or first_bad(status, n_threads) >= 0:
                return
        elif stale == FRESH:
            continue
        else:
            status[rank, STAGE] = stale
            if stale != HALFWAY:
                began, length = world.clock[0] if stale == UNSORTED else time, dt * 0.0
        now = began + length * (part + 1) / n_moves
        laying = k == last_move or k % LAY_EVERY == 0
        if not sort_all(rank, n_threads, laying, world, model, now):
            return
        # not before all have read it
        world.clock[0] = now
        grid = read_grid(world.sorting.frame)
        first, last = own_blocks(grid, start, fluid.id.size, width(fluid.x), rank, n_threads)
        status[rank, FIRST], status[rank, LAST] = first, last
        full = compute_like_fluid(
            model.extrapolation, model.stroke, rank, n_threads, walls, wall_sums, wall_start,
            fluid, start, grid, lists, kernel, eos, constants, team,
        )  # fmt: skip
        _, room = own_part(lists, rank, n_threads)
        end, walled = room, -1
        if not full:
            end, walled = compute_fluid_density(
                rank, n_threads, first, last, fluid, start, walls, wall_start, grid, lists,
                kernel, eos, constants, model.effects, model.alone, length,
            )  # fmt: skip
        status[rank, FULL], status[rank, LISTED] = full or end > room, end
        status[rank, WALLED] = walled
        if not meet(team, n_threads) or any_full(status, n_threads):
            return
        if not follow_fluid(
            model.extrapolation, rank, n_threads, walls, wall_start, fluid, start, grid, lists,
            status, team, model, now,
        ):  # fmt: skip
            return
        if part + 1 < n_moves:
            continue
        if status[rank, STAGE] != UNSORTED and not complete_step(
            rank, n_threads, world, model, began, length, k == last_move
        ):
            return
        # a whole step that put somebody into a wall is the last one
        if k > 0 and _first(status, n_threads, WALLED) >= 0:
            status[rank, BAD] = status[rank, WALLED]
            break
    status[rank, STAGE] = FRESH
    if rank == 0:
        sum_up(fluid, walls, model.extrapolation, eos, world.totals)
