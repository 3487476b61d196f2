"""The forces: everything that acts between two particles, and on one.

The pair loop runs over the neighbours of a group of particles at once (neighbors.py): the group's
particles are the lanes of x, y ..., each neighbour is repeated in all lanes. Nothing is summed
across lanes, and groups do not depend on the number of threads, so neither does any sum.
"""

from typing import Any, NamedTuple

from sph_gym.solver.density import COINCIDENT
from sph_gym.solver.effects import (
    add_artificial_viscosity,
    add_crowding,
    add_density_diffusion,
    add_laminar_viscosity,
    add_pressure,
    add_quadratic_viscosity,
    add_shift,
    add_smoothing,
    add_surface_tension,
    add_tensile_correction,
    add_xsph,
)
from sph_gym.solver.gravity import add_gravity
from sph_gym.solver.images import (
    HIDDEN,
    N_IMAGES,
    image_of,
    is_at_plate,
    is_near,
    meets,
    mirror_matrix,
    through_plate,
    turned,
)
from sph_gym.solver.jit import jitable
from sph_gym.solver.kernels import gradient, weight
from sph_gym.solver.lanes import broadcast, like, load, reciprocal, rsqrt, select
from sph_gym.solver.neighbors import fluid_range, neighbor, wall_range
from sph_gym.solver.periodic import nearest_image


class Pair(NamedTuple):
    """Quantities of particle i and its neighbour j; kernel shapes are 0 from the support radius on.

    dx, dy: x_i - x_j [m]; r2: its square, r: its length; du, dv: v_i - v_j [m/s]; slip_u, slip_v:
    the same as viscosity sees it, which at a wall may be a mirrored velocity; stress_i, stress_j:
    p / rho^2; density_gap: rho_j - rho_i; density_sum: rho_i + rho_j; sum_j: rho_j as a kernel
    sum, without the offset of densities by continuity; inv_rho: 1 / (rho_i + rho_j); inv_rho_r2:
    the same divided by r^2 + eta^2; weight, gradient: kernel shapes.
    """

    dx: Any
    dy: Any
    r2: Any
    r: Any
    du: Any
    dv: Any
    slip_u: Any
    slip_v: Any
    stress_i: Any
    stress_j: Any
    density_gap: Any
    density_sum: Any
    sum_j: Any
    inv_rho: Any
    inv_rho_r2: Any
    weight: Any
    gradient: Any


class Sums(NamedTuple):
    """Sums over the neighbours of particle i.

    ax, ay: acceleration / (m gradient_scale); sx, sy: XSPH sum / (2 eps m weight_scale); growth:
    d rho/dt by diffusion / (m gradient_scale); cx, cy: - grad C / (2 m gradient_scale), see
    `add_crowding`; ox, oy: the same of the openness.
    """

    ax: Any
    ay: Any
    sx: Any
    sy: Any
    growth: Any
    cx: Any
    cy: Any
    ox: Any
    oy: Any


@jitable
def no_sums(zero):
    """Return sums over no neighbour."""
    return Sums(zero, zero, zero, zero, zero, zero, zero, zero, zero)


class Rates(NamedTuple):
    """Rates of change of a group of particles.

    ax, ay: acceleration [m/s^2]; tx, ty: what is added to the velocity that moves them [m/s];
    growth: d rho/dt by diffusion [kg/(m^3 s)].
    """

    ax: Any
    ay: Any
    tx: Any
    ty: Any
    growth: Any


class Target(NamedTuple):
    """A group of particles for which sums are taken."""

    x: Any
    y: Any
    u: Any
    v: Any
    rho: Any
    stress: Any
    nx: Any
    ny: Any


@jitable
def load_target(fluid, i):
    """Return the group that begins with fluid particle i as a target of sums."""
    x = load(fluid.x, i)
    return Target(
        x,
        load(fluid.y, i),
        load(fluid.u, i),
        load(fluid.v, i),
        load(fluid.rho, i),
        load(fluid.stress, i),
        load_or_zero(fluid.nx, i, x),
        load_or_zero(fluid.ny, i, x),
    )


# --- Pairs ----------------------------------------------------------------------------------


@jitable
def slip(ghost, own, j, difference):
    """Return v_i - v_j as viscosity sees it: at a wall that mirrors, with the mirrored velocity."""
    if ghost is None:
        return difference
    return difference + (broadcast(own, j) - broadcast(ghost, j))


@jitable
def load_or_zero(column, i, other):
    """Return the group's numbers of a column; zeros like `other` where there is none."""
    if column is None:
        return like(other, 0.0)
    return load(column, i)


@jitable
def broadcast_or_zero(column, j, zero):
    """Return particle j's number of a column; `zero` where there is none."""
    if column is None:
        return zero
    return broadcast(column, j)


@jitable
def add_pair(target, sources, j, kernel, constants, effects, sums):
    """Return sums plus everything that particle j of `sources` adds to them for `target`."""
    dx = nearest_image(constants.period_x, target.x - broadcast(sources.x, j))
    dy = nearest_image(constants.period_y, target.y - broadcast(sources.y, j))
    r2 = dx * dx + dy * dy + like(dx, COINCIDENT)
    inv_r = rsqrt(r2)
    r = r2 * inv_r
    softened_r2 = r2 + constants.eta2
    rho_j, stress_j = broadcast(sources.rho, j), broadcast(sources.stress, j)
    density_sum = target.rho + rho_j
    inv_rho_r2 = reciprocal(softened_r2 * density_sum)
    du, dv = target.u - broadcast(sources.u, j), target.v - broadcast(sources.v, j)
    near, zero = r2 < kernel.h2, like(r2, 0.0)
    pair = Pair(
        dx,
        dy,
        r2,
        r,
        du,
        dv,
        slip(sources.ghost_u, sources.u, j, du),
        slip(sources.ghost_v, sources.v, j, dv),
        target.stress,
        stress_j,
        rho_j - target.rho,
        density_sum,
        rho_j - broadcast_or_zero(sources.offset, j, zero),
        inv_rho_r2 * softened_r2,
        inv_rho_r2,
        select(near, weight(kernel, r2, r), zero),
        select(near, gradient(kernel, r2, r, inv_r), zero),
    )
    stress = add_tensile_correction(effects.tensile_correction, pair, target.stress + stress_j)
    stress = add_artificial_viscosity(effects.artificial_viscosity, pair, stress)
    stress = add_quadratic_viscosity(effects.quadratic_viscosity, pair, stress)
    ax, ay = add_pressure(stress, pair, sums.ax, sums.ay)
    ax, ay = add_laminar_viscosity(effects.laminar_viscosity, pair, ax, ay)
    ax, ay = add_surface_tension(
        effects.surface_tension, pair, target.nx, target.ny,
        broadcast_or_zero(sources.nx, j, zero), broadcast_or_zero(sources.ny, j, zero), ax, ay,
    )  # fmt: skip
    sx, sy = add_xsph(effects.xsph, pair, sums.sx, sums.sy)
    growth = add_density_diffusion(effects.density_diffusion, pair, sums.growth)
    return Sums(ax, ay, sx, sy, growth, *add_crowding(effects.shifting, pair, sums))


@jitable
def add_pairs(target, sources, lists, first, last, model, effects, sums):
    """Return sums plus everything that the listed particles of `sources` add to them."""
    if sources is None:
        return sums
    for k in range(first, last):
        j = neighbor(lists, k)
        sums = add_pair(target, sources, j, model.kernel, model.constants, effects, sums)
    return sums


@jitable
def add_images(mirrors, target, sources, lists, part, model, effects, sums):
    """Return sums plus everything that the images of the listed particles add to them.

    part: first and last-plus-one entry of the lists.
    """
    if mirrors is None:
        return sums
    zero = like(target.x, 0.0)
    for k in range(1, N_IMAGES):
        image = image_of(mirrors, k, model.kernel.h, target.x, target.y)
        if not is_near(image):
            continue
        u, sign_x = turned(mirrors.left, mirrors.right, k // 3, target.u)
        v, sign_y = turned(mirrors.bottom, mirrors.top, k % 3, target.v)
        sign_x, sign_y = like(zero, sign_x), like(zero, sign_y)
        nx, ny = sign_x * target.nx, sign_y * target.ny
        other = Target(image.x, image.y, u, v, target.rho, target.stress, nx, ny)
        seen = no_sums(zero)
        for q in range(part[0], part[1]):
            if meets(image, sources, neighbor(lists, q)):
                seen = add_pairs(other, sources, lists, q, q + 1, model, effects, seen)
        sums = add_turned(sums, seen, sign_x, zero, sign_y, like(zero, 1.0))
    return sums


@jitable
def add_plate_images(plates, target, fluid, lists, part, model, sums):
    """Return sums plus everything that images in plates add, less what the plates hide."""
    if plates is None:
        return sums
    zero = like(target.x, 0.0)
    for k in range(plates.x.size):
        if not is_at_plate(plates, k, target.x, target.y):
            continue
        for what in range(2):
            xx, xy, yy = mirror_matrix(plates, k, what)
            xx, xy, yy = like(zero, xx), like(zero, xy), like(zero, yy)
            u, v = xx * target.u + xy * target.v, xy * target.u + yy * target.v
            nx, ny = xx * target.nx + xy * target.ny, xy * target.nx + yy * target.ny
            seen = no_sums(zero)
            for q in range(part[0], part[1]):
                j = neighbor(lists, q)
                acts, x, y = through_plate(
                    plates, k, what, target.x, target.y, fluid.x[j], fluid.y[j]
                )
                if acts:
                    other = Target(x, y, u, v, target.rho, target.stress, nx, ny)
                    seen = add_pairs(
                        other, fluid, lists, q, q + 1, model, model.image_effects, seen
                    )
            sums = add_turned(sums, seen, xx, xy, yy, like(zero, -1.0 if what == HIDDEN else 1.0))
    return sums


@jitable
def add_turned(sums, seen, xx, xy, yy, sign):
    """Return sums plus the sign times those of an image, turned back by a symmetric matrix."""
    return Sums(
        sums.ax + sign * (xx * seen.ax + xy * seen.ay),
        sums.ay + sign * (xy * seen.ax + yy * seen.ay),
        sums.sx + sign * (xx * seen.sx + xy * seen.sy),
        sums.sy + sign * (xy * seen.sx + yy * seen.sy),
        sums.growth + sign * seen.growth,
        sums.cx + sign * (xx * seen.cx + xy * seen.cy),
        sums.cy + sign * (xy * seen.cx + yy * seen.cy),
        sums.ox + sign * (xx * seen.ox + xy * seen.oy),
        sums.oy + sign * (xy * seen.ox + yy * seen.oy),
    )


@jitable
def add_wall_images(mirrors, walls, target, lists, part, model, sums):
    """Return sums plus everything that the images of boundary particles add to them."""
    if walls is None:
        return sums
    return add_images(mirrors, target, walls, lists, part, model, model.wall_effects, sums)


@jitable
def pair_sums(i, fluid, walls, lists, model):
    """Return the sums of the group that begins with fluid particle i, over fluid and walls."""
    target = load_target(fluid, i)
    zero = like(target.x, 0.0)
    sums = no_sums(zero)
    begin, end = fluid_range(lists, i)
    sums = add_pairs(target, fluid, lists, begin, end, model, model.effects, sums)
    begin, end = wall_range(lists, i)
    sums = add_pairs(target, walls, lists, begin, end, model, model.wall_effects, sums)
    sums = add_wall_images(model.mirrors, walls, target, lists, (begin, end), model, sums)
    part, effects = fluid_range(lists, i), model.image_effects
    sums = add_images(model.mirrors, target, fluid, lists, part, model, effects, sums)
    return add_plate_images(model.mirror_plates, target, fluid, lists, part, model, sums)


# --- Single particles -----------------------------------------------------------------------


@jitable
def rates(i, fluid, walls, lists, model, time):
    """Return the rates of the group that begins with fluid particle i: all that acts on it."""
    sums, effects = pair_sums(i, fluid, walls, lists, model), model.effects
    scale, zero = model.constants.force_scale, like(sums.ax, 0.0)
    x, y, u, v = load(fluid.x, i), load(fluid.y, i), load(fluid.u, i), load(fluid.v, i)
    ax, ay = add_gravity(model.gravity, time, x, y, u, v, scale * sums.ax, scale * sums.ay)
    tx, ty = add_smoothing(effects.xsph, sums, zero, zero)
    density = load(fluid.rho, i) - load_or_zero(fluid.offset, i, zero)
    tx, ty = add_shift(effects.shifting, sums, density, tx, ty)
    return Rates(ax, ay, tx, ty, scale * sums.growth)
