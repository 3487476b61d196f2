"""Velocity noise on the scale of particles: what makes a fluid swirl like a gas.

Around each particle an affine flow is fitted to the velocities of its fluid neighbours and its own,
by least squares with the weights (1 - r^2/h^2)^2. The fit is the flow: translation, rotation and
shear are in it. What a particle's velocity has beyond it is noise.
"""

from typing import Any, NamedTuple

from sph_gym.solver.jit import jitable
from sph_gym.solver.lanes import broadcast, like, load, maximum, reciprocal, select, store
from sph_gym.solver.neighbors import fluid_range, group_size, neighbor
from sph_gym.solver.periodic import nearest_image

# With no more particles within h, itself included, or with all of them nearly on a line, a particle
# counts as free of noise: any velocities would fit. FLAT: lowest determinant of their spread, as a
# share of the largest that it could have.
TOO_FEW, FLAT = 6.5, 0.02


class _Moments(NamedTuple):
    """Weighted sums over the particles of a fit: of 1, x, y, xx, xy, yy; of u times 1, x, y; of v
    times 1, x, y; and their number. Positions and velocities are from those of the particle.
    """

    w: Any
    x: Any
    y: Any
    xx: Any
    xy: Any
    yy: Any
    u: Any
    ux: Any
    uy: Any
    v: Any
    vx: Any
    vy: Any
    count: Any


@jitable
def split_velocities(cells, model, noise, flow):
    """Fill two columns: the squared noise and the squared flow velocity [m^2/s^2] of each particle.

    The flow velocity of a particle that no fit is possible for is its own.
    """
    i, fluid, lists = 0, cells.fluid, cells.lists
    while i < fluid.id.size:
        n = group_size(lists, i)
        x, y = load(fluid.x, i), load(fluid.y, i)
        u, v = load(fluid.u, i), load(fluid.v, i)
        begin, end = fluid_range(lists, i)
        moments = _moments(x, y, u, v, fluid, lists, begin, end, model)
        du, dv = _at_the_particle(moments)
        store(noise, i, du * du + dv * dv, n)
        u, v = u + du, v + dv
        store(flow, i, u * u + v * v, n)
        i += n


@jitable
def _moments(x, y, u, v, fluid, lists, first, last, model):
    zero, one = like(x, 0.0), like(x, 1.0)
    sw = sx = sy = sxx = sxy = syy = zero
    su = sux = suy = sv = svx = svy = count = zero
    constants, h2 = model.constants, model.kernel.h2
    inv_h2 = 1 / h2
    for k in range(first, last):
        j = neighbor(lists, k)
        dx = nearest_image(constants.period_x, broadcast(fluid.x, j) - x)
        dy = nearest_image(constants.period_y, broadcast(fluid.y, j) - y)
        w = maximum(one - (dx * dx + dy * dy) * inv_h2, zero)
        count += select(w > zero, one, zero)
        w *= w
        wx, wy = w * dx, w * dy
        sw, sx, sy = sw + w, sx + wx, sy + wy
        sxx, sxy, syy = sxx + wx * dx, sxy + wx * dy, syy + wy * dy
        du, dv = broadcast(fluid.u, j) - u, broadcast(fluid.v, j) - v
        su, sux, suy = su + w * du, sux + wx * du, suy + wy * du
        sv, svx, svy = sv + w * dv, svx + wx * dv, svy + wy * dv
    return _Moments(sw, sx, sy, sxx, sxy, syy, su, sux, suy, sv, svx, svy, count)


@jitable
def _at_the_particle(m):
    """Return the fit (u, v) where the particle is, from its velocity; 0 if there is no fit."""
    zero = like(m.w, 0.0)
    # the normal equations by Cramer's rule
    a, b, c = m.xx * m.yy - m.xy * m.xy, m.xy * m.y - m.x * m.yy, m.x * m.xy - m.xx * m.y
    determinant = m.w * a + m.x * b + m.y * c
    spread = m.w * (m.xx + m.yy)
    wide = m.w * determinant > like(zero, 0.25 * FLAT) * spread * spread
    fits = wide & (m.count > like(zero, TOO_FEW))
    inverse = reciprocal(select(fits, determinant, like(zero, 1.0)))
    du = (m.u * a + m.ux * b + m.uy * c) * inverse
    dv = (m.v * a + m.vx * b + m.vy * c) * inverse
    return select(fits, du, zero), select(fits, dv, zero)
