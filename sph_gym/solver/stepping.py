"""Time: how long a step may be, and all the substeps of one call inside one compiled function."""

import math
from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.effects import PairEffects, UniformGravity, add_gravity, smoothed
from sph_gym.solver.forces import Constants, compute_fluid_density, compute_wall_density, force_sums
from sph_gym.solver.jit import jit
from sph_gym.solver.lanes import like
from sph_gym.solver.neighbors import sort_into_cells
from sph_gym.solver.walls import Box, confine

# The article's limits. Its 0.4 h^2/nu diverges where h is the support radius; 0.125: Morris 1997.
COURANT = 0.4
FORCE = 0.25
VISCOUS = 0.125

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


@jit
def compute_density(fluid, start, walls, wall_start, grid, model):
    """rho and p / rho^2 of fluid and walls, for particles that are in the order of their cells."""
    kernel, eos, constants = model.kernel, model.eos, model.constants
    compute_wall_density(walls, fluid, start, grid, kernel, eos, constants)
    compute_fluid_density(fluid, start, walls, wall_start, grid, kernel, eos, constants)


@jit
def evaluate_density(source, target, start, cells, walls, wall_start, grid, model):
    """Sort `source` into `target` and compute its densities and pressures."""
    sort_into_cells(grid, source, target, start, cells)
    compute_density(target, start, walls, wall_start, grid, model)


@jit
def evaluate_acceleration(fluid, start, walls, wall_start, grid, model, time, ax, ay):
    """Acceleration [m/s^2] of every fluid particle, in the order of `fluid`."""
    for i in range(fluid.x.size):
        sums = force_sums(i, fluid, start, walls, wall_start, grid, model)
        scale = model.constants.force_scale
        ax[i], ay[i] = add_gravity(model.gravity, time, scale * sums.ax, scale * sums.ay)


@jit
def kick_and_drift(source, target, start, walls, wall_start, grid, model, time, dt):
    """Symplectic Euler from `source` to `target`: v += a dt, then x += (smoothed v) dt.

    The XSPH sum is that of the velocities before the kick, so that one pair loop serves both.
    Returns the place of the first particle that is no longer finite or too fast, or -1.
    """
    bad = -1
    for i in range(source.x.size):
        sums = force_sums(i, source, start, walls, wall_start, grid, model)
        scale = model.constants.force_scale
        ax, ay = add_gravity(model.gravity, time, scale * sums.ax, scale * sums.ay)
        u = source.u[i] + dt * ax
        v = source.v[i] + dt * ay
        drift_u, drift_v = smoothed(model.effects.xsph, u, v, sums)
        x, y, u, v = confine(
            model.box, source.x[i] + dt * drift_u, source.y[i] + dt * drift_v, u, v
        )
        target.x[i], target.y[i], target.u[i], target.v[i] = x, y, u, v
        target.id[i] = source.id[i]
        # not x - x == 0, which reassociation folds to True
        sane = u * u + v * v < like(u, TOP_SPEED * TOP_SPEED) and abs(x) + abs(y) < np.inf
        if not sane and bad < 0:
            bad = i
    return bad


@jit
def advance(
    fluid, spare, start, cells, walls, wall_start, grid, model, time, dt, n_substeps, progress
):
    """n_substeps steps of the whole chain: neighbours, density, pressure, force, integration.

    `fluid` holds the state before and after; `spare` is the same state sorted into cells. When a
    step fails, `spare` still holds the state before that step, with densities and pressures.
    progress: (2,) int64, kept up to date: the number of steps begun, and the place in `spare` of
    the particle that failed, or -1.
    """
    for k in range(n_substeps):
        sort_into_cells(grid, fluid, spare, start, cells)
        compute_density(spare, start, walls, wall_start, grid, model)
        now = time + k * float(dt)
        bad = kick_and_drift(spare, fluid, start, walls, wall_start, grid, model, now, dt)
        progress[0], progress[1] = k + 1, bad
        if bad >= 0:
            return
