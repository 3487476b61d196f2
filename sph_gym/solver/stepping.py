"""Time: how long a step may be, and all the substeps of one call inside one compiled function."""

import math
from typing import Any, NamedTuple

from sph_gym.solver.boundary import (
    compute_wall_density,
    compute_wall_sums,
    extrapolate,
    move_walls,
)
from sph_gym.solver.density import compute_fluid_density, store_density
from sph_gym.solver.diagnostics import sum_up, survey
from sph_gym.solver.forces import rates
from sph_gym.solver.images import with_mirrors
from sph_gym.solver.integrators import (
    KickDriftKick,
    PredictorCorrector,
    SymplecticEuler,
    end_step,
    evaluates_last,
    move,
    moves,
    settle,
)
from sph_gym.solver.jit import dispatch, jit, jitable
from sph_gym.solver.lanes import load, store, unpack, width
from sph_gym.solver.model import with_controls
from sph_gym.solver.neighbors import (
    Lists,
    Sorting,
    copy_state,
    group_size,
    lay_grid,
    own_blocks,
    own_part,
    read_grid,
    sort_into_cells,
)
from sph_gym.solver.state import Indices, Particles
from sph_gym.solver.teams import meet, share

# The article's limits. Its 0.4 h^2/nu diverges where h is the support radius; 0.125: Morris 1997.
COURANT = 0.4
FORCE = 0.25
VISCOUS = 0.125

# Columns of `World.status`, one row a thread: steps done; the first particle of its share that
# failed, or -1; whether its list was too short; whether `fluid` is the whole state at the end of
# the last step; the particles that are its share; where the fluid's part of its list ends; the
# first particle of its share that is inside a wall, or -1.
STEPS, BAD, FULL, WHOLE, FIRST, LAST, LISTED, WALLED = range(8)
N_STATUS = 8
# Parts that are not up to date when a call begins: none; the pressures; densities and lists, for
# the state in `spare`; the same and the rates, since they depend on what has changed.
FRESH, UNPRESSED, UNSORTED, UNKNOWN = 0, 1, 2, 3
# Steps after which the grid follows the fluid within a call.
LAY_EVERY = 64


def stable_dt(
    h: float, c: float, a_max: float, nu: float | None, viscous: float = VISCOUS
) -> float:
    """Return the largest step [s] that the article allows: min(CFL, force limit, viscous limit).

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


class Cells(NamedTuple):
    """The particles in the order of their cells, and the lists of their neighbours.

    fluid: with densities and pressures; start, wall_start: (n_cells + 1,) first particle of every
    cell; wall_sums: kernel sums of boundary particles over each other. Absent parts are None.
    """

    fluid: Particles
    start: Indices
    walls: Particles | None
    wall_start: Indices | None
    wall_sums: Any
    lists: Lists


class WallSource(NamedTuple):
    """Boundary particles in public order; all are None where there are none.

    particles: as they are now; rest: the same before they moved, moves: (n,) 1 for those that
    move, None if none do; sums: kernel sums over each other.
    """

    particles: Particles | None
    rest: Particles | None
    moves: Any
    sums: Any


class World(NamedTuple):
    """All arrays of a simulation.

    cells: the state; spare: the state that the last move made, or scratch; backup: the state when
    the last call began; walls: what the walls of `cells` are sorted from; status: (n_threads, 8)
    int64, see the constants above; team: flags of the threads; totals: (9,) of the state, see
    `diagnostics.Totals`; clock: (1,) time [s] of the state and of the walls.
    """

    cells: Cells
    spare: Particles
    backup: Particles
    walls: WallSource
    sorting: Sorting
    status: Any
    team: Any
    totals: Any
    clock: Any


# --- Sorting --------------------------------------------------------------------------------


@jitable
def sort_all(rank, n_threads, laying, world, model, time):
    """Sort the fluid from `spare` to `cells`, on a new grid if `laying`.

    The walls are sorted only where they or the grid have moved, and always from the same order,
    so that a restored run sums in the order of the first. Return False if the team was told to
    stop.
    """
    cells, sorting, team, h = world.cells, world.sorting, world.team, float(model.constants.h)
    moved = is_there(model.stroke)
    if laying or moved:
        if rank == 0:
            moved = move_walls(model.stroke, world.walls, model.constants, time)
            if laying:
                moved = lay_grid(sorting.frame, world.spare, h, cells.start.size - 1) or moved
            if moved:
                _sort_walls(cells.walls, rank, cells, world.walls, sorting, team)
        if not meet(team, n_threads):
            return False
    return sort_into_cells(rank, n_threads, team, world.spare, cells.fluid, sorting, cells.start)


@jitable
def is_there(part):
    """Return whether a part of the model is not absent; known when this is compiled."""
    return part is not None


@jitable
def _sort_walls(walls, rank, cells, source, sorting, team):
    if walls is None:
        return
    sort_into_cells(rank, rank + 1, team, source.particles, walls, sorting, cells.wall_start)
    for i in range(walls.id.size):
        cells.wall_sums[i] = source.sums[walls.id[i]]


# --- Densities ------------------------------------------------------------------------------


@jitable
def compute_boundary(extrapolation, rank, n_threads, cells, team, model, grid):
    """Compute densities of boundary particles that are like fluid.

    Return whether a list was too short.
    """
    if extrapolation is None:
        full = renew_wall_sums(model.stroke, rank, n_threads, cells, team, model, grid)
        return full or compute_wall_density(cells.walls, rank, n_threads, cells, model, grid)
    return False


@jitable
def renew_wall_sums(stroke, rank, n_threads, cells, team, model, grid):
    """Compute the sums of boundary particles over each other, where these move.

    Return whether a list was too short.
    """
    if stroke is None:
        return False
    full = False
    if rank == 0:
        full = compute_wall_sums(cells.walls, n_threads, cells, model, grid)
    # a failure at this barrier is found at the next one
    meet(team, n_threads)
    return full


@jitable
def follow_fluid(extrapolation, rank, n_threads, world, model, grid, time):
    """Give boundary particles the pressure of the fluid, where they wait for it.

    Return False if a list was too short or the team was told to stop.
    """
    if extrapolation is None:
        return True
    status = world.status
    status[rank, FULL] = extrapolate(
        extrapolation, rank, n_threads, status[rank, LISTED], world.cells, model, grid, time
    )
    return meet(world.team, n_threads) and not any_full(status, n_threads)


@jitable
def compute_densities(rank, n_threads, cells, status, team, model, grid, length):
    """Compute lists, densities and pressures, after a sort.

    Boundary particles that follow the fluid come later; length: of the step [s]. Return False if
    a list was too short or the team was told to stop.
    """
    fluid = cells.fluid
    first, last = own_blocks(grid, cells.start, fluid.id.size, width(fluid.x), rank, n_threads)
    status[rank, FIRST], status[rank, LAST] = first, last
    full = compute_boundary(model.extrapolation, rank, n_threads, cells, team, model, grid)
    _, list_end = own_part(cells.lists, rank, n_threads)
    end, walled = list_end, -1
    if not full:
        end, walled = compute_fluid_density(
            rank, n_threads, first, last, cells, model, grid, length
        )
    status[rank, FULL], status[rank, LISTED] = full or end > list_end, end
    note_walled(cells.walls, status, rank, walled)
    return meet(team, n_threads) and not any_full(status, n_threads)


# --- Steps ----------------------------------------------------------------------------------


@jitable
def any_full(status, n_threads):
    """Return whether any thread's list was too short."""
    full = False
    for t in range(n_threads):
        full = full or status[t, FULL] != 0
    return full


@jitable
def first_bad(status, n_threads):
    """Return the first particle that failed in any thread's share; -1 if none did."""
    return _first(status, n_threads, BAD)


@jitable
def _first(status, n_threads, kind):
    for t in range(n_threads):
        if status[t, kind] >= 0:
            return status[t, kind]
    return -1


@jitable
def note_walled(walls, status, rank, walled):
    """Write down the first particle of a thread's share that is inside a wall."""
    if walls is None:
        return
    status[rank, WALLED] = walled


@jitable
def any_walled(walls, status, n_threads):
    """Return whether any particle is inside a wall."""
    if walls is None:
        return False
    return _first(status, n_threads, WALLED) >= 0


@jitable
def back_up(rank, n_threads, source, backup):
    """Copy a thread's share of the state with which a call begins."""
    first, last = share(source.id.size, rank, n_threads)
    for i in range(first, last):
        copy_state(source, backup, i, i)


@jitable
def renew_pressures(fluid, walls, model, totals):
    """Compute the pressures that belong to the present densities, and the totals."""
    _press(fluid, model.eos)
    _press(walls, model.eos)
    sum_up(fluid, walls, model.extrapolation, model.eos, totals)


@jitable
def _press(particles, eos):
    if particles is None:
        return
    i, n = 0, particles.id.size
    while i < n:
        store_density(particles, i, min(width(particles.rho), n - i), load(particles.rho, i), eos)
        i += width(particles.rho)


@dispatch
def complete_step(
    integrator: Any, rank: int, n_threads: int, world: Any, model: Any, began: Any, length: Any,
    shown: bool,
) -> Any:  # fmt: skip
    """Evaluate forces after the particles have moved from `began` to `began` + `length` [s].

    shown: whether walls without slip may be looked at, which follow velocities. Return False if
    it failed, a list was too short or the team was told to stop.
    """


@complete_step.member(SymplecticEuler)
def _complete(integrator, rank, n_threads, world, model, began, length, shown):
    return True


@complete_step.member(KickDriftKick)
@complete_step.member(PredictorCorrector)
def _evaluate_and_settle(integrator, rank, n_threads, world, model, began, length, shown):
    status = world.status
    first, last = status[rank, FIRST], status[rank, LAST]
    cells, spare = world.cells, world.spare
    status[rank, BAD] = end_step(integrator, first, last, cells, spare, model, began, length)
    if not meet(world.team, n_threads) or first_bad(status, n_threads) >= 0:
        return False
    settle(integrator, first, last, spare, cells.fluid)
    if not meet(world.team, n_threads):
        return False
    grid = read_grid(world.sorting.frame)
    return not shown or follow_fluid(
        model.extrapolation, rank, n_threads, world, model, grid, began + length
    )


@jit
def advance(rank, n_threads, bounds, worlds, models, world, model, chunks, controls):
    """Run one chunk of substeps of each simulation bounds[rank] to bounds[rank + 1].

    Each of them runs on one thread; without bounds the first one runs on all threads. worlds,
    models: records; world, model: their shapes; chunks: (n, 3) stale, time [s] and n_substeps;
    controls: (n, 5) see `model.control_row`. It is the only way in: the same machine code, and so
    the same bits, for one simulation and for many.
    """
    begin, end, part, n_parts = 0, 1, rank, n_threads
    if bounds.size > 0:
        begin, end, part, n_parts = bounds[rank], bounds[rank + 1], 0, 1
    for i in range(begin, end):
        rules, dt = with_controls(unpack(models, i, model), controls[i])
        stale, time, n_substeps = int(chunks[i, 0]), chunks[i, 1], int(chunks[i, 2])
        _advance(part, n_parts, unpack(worlds, i, world), rules, stale, time, dt, n_substeps)


@jitable
def _advance(rank, n_threads, world, model, stale, time, dt, n_substeps):
    """Run n_substeps steps of the chain: force, integration, neighbours, density, pressure.

    time: [s] before the first of them. A step consists of one or two moves of the particles,
    depending on the integrator, each followed by the rest of the chain. `cells.fluid` holds the
    state before and after, with densities, pressures and lists; `stale` says what of it is not up
    to date. When a step fails, `fluid` holds the last finite state; when a list was too short,
    `backup` holds the state to begin again from; when a particle ends within a wall, `fluid`
    holds the state with it there. `world.status` says so.
    """
    cells, spare, status, team = world.cells, world.spare, world.status, world.team
    status[rank, STEPS], status[rank, BAD] = 0, -1
    status[rank, FULL], status[rank, WHOLE] = 0, 0
    if stale == UNPRESSED:
        renew_pressures(cells.fluid, cells.walls, model, world.totals)
        return
    if stale == FRESH:
        back_up(rank, n_threads, cells.fluid, world.backup)
    else:
        back_up(rank, n_threads, spare, world.backup)
    n_moves = moves(model.integrator)
    last_move = n_substeps * n_moves
    # the model with its mirrors where they are at the present positions
    here = with_mirrors(model.mirrors, model.stroke, model, world.clock[0])
    for k in range(last_move + 1):
        step, part = divmod(k - 1, n_moves)
        began, length = time + step * float(dt), dt * 1.0
        if k > 0:
            first, last = status[rank, FIRST], status[rank, LAST]
            bad = move(model.integrator, part, first, last, cells, spare, here, began, dt)
            status[rank, STEPS], status[rank, BAD] = step + 1, bad
            if not meet(team, n_threads) or first_bad(status, n_threads) >= 0:
                return
        elif stale == FRESH:
            continue
        else:
            began, length = world.clock[0] if stale == UNSORTED else time, dt * 0.0
        now = began + length * (part + 1) / n_moves
        laying = k == last_move or k % LAY_EVERY == 0
        if not sort_all(rank, n_threads, laying, world, model, now):
            return
        # not before all have read it
        world.clock[0] = now
        here = with_mirrors(model.mirrors, model.stroke, model, now)
        grid = read_grid(world.sorting.frame)
        if not compute_densities(rank, n_threads, cells, status, team, here, grid, length):
            return
        if not follow_fluid(model.extrapolation, rank, n_threads, world, here, grid, now):
            return
        if part + 1 < n_moves:
            continue
        evaluating = evaluates_last(model.integrator) if k > 0 else stale == UNKNOWN
        if evaluating and not complete_step(
            model.integrator, rank, n_threads, world, here, began, length, k == last_move
        ):
            return
        # a whole step that put a particle into a wall is the last one; the part that may be absent
        # is asked first: only so nothing is left of the condition
        if any_walled(cells.walls, status, n_threads) and k > 0:
            status[rank, BAD] = status[rank, WALLED]
            break
    status[rank, WHOLE] = 1
    if rank == 0:
        sum_up(cells.fluid, cells.walls, model.extrapolation, model.eos, world.totals)


# --- A look at the state --------------------------------------------------------------------


@jit
def examine(worlds, models, world, model, controls, stale, request, columns, numbers):
    """Look at every particle of the present state.

    worlds, models: records; world, model: their shapes; stale: whether the accelerations are not
    known; request: see `diagnostics.Request`; columns: (6, n) of `diagnostics.survey`, ax and
    ay [m/s^2] filled if they are stale, the others by what is wanted;
    numbers: filled with a `diagnostics.Survey` if all is wanted.
    """
    cells = unpack(worlds, 0, world).cells
    rules, _ = with_controls(unpack(models, 0, model), controls[0])
    rules = with_mirrors(rules.mirrors, rules.stroke, rules, request[1])
    if stale:
        evaluate_acceleration(cells, rules, request[1], columns[0], columns[1])
    survey(cells, rules, request, columns, numbers)


@jitable
def evaluate_acceleration(cells, model, time, ax, ay):
    """Compute the acceleration [m/s^2] of the fluid particles, in the order of `fluid`."""
    i, fluid, lists = 0, cells.fluid, cells.lists
    while i < fluid.id.size:
        n = group_size(lists, i)
        here = rates(i, fluid, cells.walls, lists, model, time)
        store(ax, i, here.ax, n)
        store(ay, i, here.ay, n)
        i += n
