"""Three integrators, which make the next state from rates, chosen at compile time.

Each moves the particles once or twice a step (`move`), after which neighbours and densities are
brought up to date, and may evaluate the forces there (`end_step`). All evaluate the pair forces
once a step. What they need of the last evaluation is kept in the columns of rates, which belong to
the state: a run that is cut into several calls goes on as if it was not.
"""

from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.confinement import confine, stop_at_plates
from sph_gym.solver.forces import Rates, rates
from sph_gym.solver.jit import dispatch, jitable
from sph_gym.solver.lanes import first_lanes, first_true, like, load, select, store, width
from sph_gym.solver.neighbors import group_size
from sph_gym.solver.periodic import first_outside, wrap

# Faster than this [m/s] is a blow-up, whatever the scene.
TOP_SPEED = 5000.0
# And densities by continuity farther from their sum than this multiple of the rest density.
TOP_COMPRESSION = 100.0


class SymplecticEuler(NamedTuple):
    """v += a dt, then x += v dt: first order, symplectic, the cheapest. The default."""


class KickDriftKick(NamedTuple):
    """v += a dt/2, x += v dt, then v += a dt/2 with the new a: second order, symplectic.

    Also called velocity Verlet. Forces that depend on velocities see those of the half step.
    Source: Swope et al. 1982.
    """


class PredictorCorrector(NamedTuple):
    """Half a step with the last rates, then a whole one with the rates found there.

    Second order; densities and neighbours twice a step. Source: Monaghan 1989, section 4.
    """


# Share of the viscous step of symplectic Euler that an integrator allows. The predictor uses
# every rate again half a step later, which makes friction diverge beyond 1 / its rate, not 2, as in
# Adams-Bashforth's scheme; and beyond 0.56 / rate where waves of 0.4 h/c are there too. Five sixths
# of 2 are usual, so that three tenths of those are 0.5.
VISCOUS_SHARES = {"predictor_corrector": 0.3}
# Integrators whose steps set out from rates that belong to the state.
KEEPING_RATES = (KickDriftKick, PredictorCorrector)
INTEGRATORS: dict[str, Any] = {
    "symplectic_euler": SymplecticEuler(),
    "kick_drift_kick": KickDriftKick(),
    "predictor_corrector": PredictorCorrector(),
}


@jitable
def load_rate(column, i, present):
    """Return the numbers of a column of rates; zero where there is no column."""
    if column is None:
        return like(present, 0.0)
    return load(column, i)


@jitable
def store_rate(column, i, value, n):
    """Store `value` in a column of rates, where there is one."""
    if column is None:
        return
    store(column, i, value, n)


@jitable
def grow(old, new, i, n, change, eos):
    """Store the offset of densities that `change` [kg/m^3] leads to, where there is one.

    Returns the first lane in which it is absurd, or -1.
    """
    if old is None:
        return -1
    offset = load(old, i) + change
    store(new, i, offset, n)
    zero, one = like(offset, 0.0), like(offset, 1.0)
    bounded = abs(offset * like(offset, eos.inv_rho0)) < like(offset, TOP_COMPRESSION)
    return first_true((select(bounded, zero, one) > zero) & first_lanes(offset, n))


@jitable
def load_rates(source, i, present):
    """Return the rates of the last evaluation."""
    return Rates(
        load_rate(source.ax, i, present),
        load_rate(source.ay, i, present),
        load_rate(source.tx, i, present),
        load_rate(source.ty, i, present),
        load_rate(source.growth, i, present),
    )


@jitable
def store_rates(target, i, new, n):
    """Store the rates that the next step needs."""
    store_rate(target.ax, i, new.ax, n)
    store_rate(target.ay, i, new.ay, n)
    store_rate(target.tx, i, new.tx, n)
    store_rate(target.ty, i, new.ty, n)
    store_rate(target.growth, i, new.growth, n)


@jitable
def place(model, i, n, source, target, x, y, u, v, time):
    """Store positions and velocities within the walls.

    Returns a lane that is insane or moved by more than a period, or -1.
    """
    # plates last: a side that moves must not push a particle through them
    x, y, u, v = confine(model.box, model.stroke, time, x, y, u, v)
    x, y, u, v = stop_at_plates(model.plates, load(source.x, i), load(source.y, i), x, y, u, v)
    period_x, period_y = model.constants.period_x, model.constants.period_y
    x, y = wrap(period_x, x), wrap(period_y, y)
    store(target.x, i, x, n)
    store(target.y, i, y, n)
    store(target.u, i, u, n)
    store(target.v, i, v, n)
    wrong = first_true(insane(x, y, u, v) & first_lanes(x, n))
    wrong = first_outside(period_x, x, n) if wrong < 0 else wrong
    return first_outside(period_y, y, n) if wrong < 0 else wrong


@jitable
def insane(x, y, u, v):
    """Return where a position is no longer finite or a speed absurd."""
    # not x - x == 0, which reassociation folds to True; nor a negated mask, for plain bools
    zero, one = like(x, 0.0), like(x, 1.0)
    slow = select(u * u + v * v < like(u, TOP_SPEED * TOP_SPEED), zero, one)
    return slow + select(abs(x) + abs(y) < like(x, np.inf), zero, one) > zero


# --- Moves ----------------------------------------------------------------------------------


@dispatch
def moves(integrator: Any) -> Any:
    """Return how often a step moves the particles."""


@moves.member(SymplecticEuler)
@moves.member(KickDriftKick)
def _one(integrator):
    return 1


@moves.member(PredictorCorrector)
def _two(integrator):
    return 2


@dispatch
def evaluates_last(integrator: Any) -> Any:
    """Return whether a step ends with forces instead of a move."""


@evaluates_last.member(SymplecticEuler)
@evaluates_last.member(PredictorCorrector)
def _moves_last(integrator):
    return False


@evaluates_last.member(KickDriftKick)
def _kicks_last(integrator):
    return True


@dispatch
def move(
    integrator: Any, part: int, first: int, last: int, cells: Any, target: Any, model: Any,
    time: Any, dt: Any,
) -> Any:  # fmt: skip
    """Make the next move, after `part` others, of the step that began at `time` [s].

    Particles first to last of `cells.fluid` become those of `target`. Return one of the first
    of them that are no longer finite, too fast or farther than a periodic domain is long, or -1.
    """


@move.member(SymplecticEuler)
def _kick_and_drift(integrator, part, first, last, cells, target, model, time, dt):
    source = cells.fluid
    # the XSPH sum is that of the velocities before the kick, so that one pair loop serves both
    for k in range(first, last):
        target.id[k] = source.id[k]
    i, bad = first, -1
    while i < last:
        n = group_size(cells.lists, i)
        new = rates(i, source, cells.walls, cells.lists, model, time)
        u, v = load(source.u, i) + dt * new.ax, load(source.v, i) + dt * new.ay
        x = load(source.x, i) + dt * (u + new.tx)
        y = load(source.y, i) + dt * (v + new.ty)
        wrong = place(model, i, n, source, target, x, y, u, v, time + dt)
        thick = grow(source.offset, target.offset, i, n, dt * new.growth, model.eos)
        wrong = thick if wrong < 0 else wrong
        if wrong >= 0 and bad < 0:
            bad = i + wrong
        i += n
    return bad


@move.member(KickDriftKick)
def _half_kick_and_drift(integrator, part, first, last, cells, target, model, time, dt):
    return _move_with_last_rates(first, last, cells.fluid, target, model, time + dt, dt * 0.5, dt)


@move.member(PredictorCorrector)
def _predict_or_correct(integrator, part, first, last, cells, target, model, time, dt):
    half = dt * 0.5
    if part == 0:
        return _move_with_last_rates(
            first, last, cells.fluid, target, model, time + half, half, half
        )
    return _correct(first, last, cells, target, model, time, dt, half)


@jitable
def _move_with_last_rates(first, last, source, target, model, now, kick, drift):
    """v += a kick, then x += v drift, with the rates of the last evaluation; now: [s] after it."""
    for k in range(first, last):
        target.id[k] = source.id[k]
    bad = -1
    for i in range(first, last, width(source.x)):
        n = min(width(source.x), last - i)
        u, v = load(source.u, i), load(source.v, i)
        old = load_rates(source, i, u)
        u, v = u + kick * old.ax, v + kick * old.ay
        x = load(source.x, i) + drift * (u + old.tx)
        y = load(source.y, i) + drift * (v + old.ty)
        wrong = place(model, i, n, source, target, x, y, u, v, now)
        thick = grow(source.offset, target.offset, i, n, drift * old.growth, model.eos)
        wrong = thick if wrong < 0 else wrong
        store_rates(target, i, old, n)
        if wrong >= 0 and bad < 0:
            bad = i + wrong
    return bad


@jitable
def _correct(first, last, cells, target, model, time, dt, half):
    source = cells.fluid
    for k in range(first, last):
        target.id[k] = source.id[k]
    i, bad = first, -1
    while i < last:
        n = group_size(cells.lists, i)
        new = rates(i, source, cells.walls, cells.lists, model, time + half)
        # the state before the prediction, from the rates that it was made with
        old = load_rates(source, i, new.ax)
        u0, v0 = load(source.u, i), load(source.v, i)
        x0, y0 = load(source.x, i) - half * (u0 + old.tx), load(source.y, i) - half * (v0 + old.ty)
        u0, v0 = u0 - half * old.ax, v0 - half * old.ay
        u, v = u0 + dt * new.ax, v0 + dt * new.ay
        x = x0 + dt * (like(u, 0.5) * (u0 + u) + new.tx)
        y = y0 + dt * (like(v, 0.5) * (v0 + v) + new.ty)
        wrong = place(model, i, n, source, target, x, y, u, v, time + dt)
        change = dt * new.growth - half * old.growth
        thick = grow(source.offset, target.offset, i, n, change, model.eos)
        wrong = thick if wrong < 0 else wrong
        store_rates(target, i, new, n)
        if wrong >= 0 and bad < 0:
            bad = i + wrong
        i += n
    return bad


# --- Forces after a move --------------------------------------------------------------------


@dispatch
def end_step(
    integrator: Any, first: int, last: int, cells: Any, target: Any, model: Any, time: Any, dt: Any
) -> Any:
    """Evaluate the rates at the end of the step from `time` to `time` + dt [s]; returns as `move`.

    dt = 0: nothing but the rates changes.
    """


@dispatch
def settle(integrator: Any, first: int, last: int, source: Any, target: Any) -> Any:
    """Copy into `target` what `end_step` wrote, when no thread needs the old values."""


@end_step.member(KickDriftKick)
def _half_kick(integrator, first, last, cells, target, model, time, dt):
    source = cells.fluid
    i, bad, half = first, -1, dt * 0.5
    while i < last:
        n = group_size(cells.lists, i)
        new = rates(i, source, cells.walls, cells.lists, model, time + dt)
        x, y = load(source.x, i), load(source.y, i)
        u, v = load(source.u, i) + half * new.ax, load(source.v, i) + half * new.ay
        store(target.u, i, u, n)
        store(target.v, i, v, n)
        wrong = first_true(insane(x, y, u, v) & first_lanes(x, n))
        store_rates(target, i, new, n)
        if wrong >= 0 and bad < 0:
            bad = i + wrong
        i += n
    return bad


@settle.member(KickDriftKick)
def _take_over(integrator, first, last, source, target):
    for i in range(first, last, width(source.x)):
        n = min(width(source.x), last - i)
        store(target.u, i, load(source.u, i), n)
        store(target.v, i, load(source.v, i), n)
        present = load(source.u, i)
        store_rates(target, i, load_rates(source, i, present), n)


@end_step.member(PredictorCorrector)
def _find_rates(integrator, first, last, cells, target, model, time, dt):
    source = cells.fluid
    # only where a run begins or a control has changed: a step finds them out on its way
    i = first
    while i < last and dt == 0.0:
        n = group_size(cells.lists, i)
        store_rates(source, i, rates(i, source, cells.walls, cells.lists, model, time), n)
        i += n
    return -1


@settle.member(PredictorCorrector)
def _settled(integrator, first, last, source, target):
    return
