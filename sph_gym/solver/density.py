"""Density and pressure of the fluid, and the lists of neighbours that are made on the way.

A density is the kernel sum over all neighbours, plus an offset of each particle where densities
follow the continuity equation.
"""

from sph_gym.solver.equation_of_state import pressure
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
from sph_gym.solver.jit import inlined, jitable
from sph_gym.solver.kernels import primitive, weight
from sph_gym.solver.lanes import (
    broadcast,
    like,
    load,
    maximum,
    reciprocal,
    rsqrt,
    select,
    store,
    width,
)
from sph_gym.solver.neighbors import (
    BEGIN,
    END,
    MIDDLE,
    SIZE,
    collect_images,
    compact_group,
    fluid_range,
    neighbor,
    own_part,
    rest_of_block,
    row_range,
    wall_range,
)
from sph_gym.solver.periodic import nearest_image
from sph_gym.solver.tunnelling import first_walled

# Added to r^2 [m^2]: the direction of two coincident particles is 0 / 1e-15 = 0, not NaN.
COINCIDENT = 1e-30


@jitable
def shape(continuity, kernel, r2, r):
    """Return W, or with continuity the shape whose derivative is the pressure gradient."""
    if continuity is None:
        return weight(kernel, r2, r)
    return primitive(kernel, r2, r)


@jitable
def shape_scale(continuity, constants):
    """Return the factor of a sum of shapes."""
    if continuity is None:
        return constants.density_scale
    return continuity.scale


@jitable
def add_weights(continuity, sources, lists, first, last, kernel, constants, x, y, total):
    """Return total plus the shapes between (x, y) and the listed `sources`, itself included."""
    if sources is None:
        return total
    zero = like(total, 0.0)
    for k in range(first, last):
        j = neighbor(lists, k)
        dx = nearest_image(constants.period_x, x - broadcast(sources.x, j))
        dy = nearest_image(constants.period_y, y - broadcast(sources.y, j))
        r2 = dx * dx + dy * dy
        r = r2 * rsqrt(r2 + like(r2, COINCIDENT))
        total += select(r2 < kernel.h2, shape(continuity, kernel, r2, r), zero)
    return total


@jitable
def add_image_weights(mirrors, continuity, sources, lists, part, model, x, y, total):
    """Return total plus the shapes between (x, y) and the images of the listed `sources`.

    part: first and last-plus-one entry of the lists.
    """
    if mirrors is None:
        return total
    kernel, constants = model.kernel, model.constants
    for k in range(1, N_IMAGES):
        image = image_of(mirrors, k, kernel.h, x, y)
        if not is_near(image):
            continue
        for q in range(part[0], part[1]):
            if meets(image, sources, neighbor(lists, q)):
                total = add_weights(
                    continuity, sources, lists, q, q + 1, kernel, constants, image.x, image.y, total
                )
    return total


@jitable
def add_plate_weights(plates, continuity, fluid, lists, part, model, x, y, total):
    """Return total plus what plates add to the sum of shapes, less what they hide."""
    if plates is None:
        return total
    kernel, constants = model.kernel, model.constants
    for k in range(plates.x.size):
        if not is_at_plate(plates, k, x, y):
            continue
        for what in range(2):
            share = like(x, 0.0)
            for q in range(part[0], part[1]):
                j = neighbor(lists, q)
                acts, px, py = through_plate(plates, k, what, x, y, fluid.x[j], fluid.y[j])
                if acts:
                    share = add_weights(
                        continuity, fluid, lists, q, q + 1, kernel, constants, px, py, share
                    )
            total = total - share if what == HIDDEN else total + share
    return total


@jitable
def add_wall_images(mirrors, walls, continuity, lists, part, model, x, y, total):
    """Return total plus the shapes between (x, y) and the images of boundary particles."""
    if walls is None:
        return total
    return add_image_weights(mirrors, continuity, walls, lists, part, model, x, y, total)


@jitable
def store_density(particles, i, n, rho, eos):
    """Store rho and p / rho^2 of particles i to i + n."""
    store(particles.rho, i, rho, n)
    store(particles.stress, i, pressure(eos, rho) * reciprocal(rho * rho), n)


@jitable
def density(continuity, fluid, i, walls, lists, model):
    """Return rho of the group of fluid particle i, and the contribution of walls to it."""
    kernel, constants, mirrors = model.kernel, model.constants, model.mirrors
    x, y, scale = load(fluid.x, i), load(fluid.y, i), shape_scale(continuity, constants)
    begin, end = fluid_range(lists, i)
    own = add_weights(continuity, fluid, lists, begin, end, kernel, constants, x, y, like(x, 0.0))
    begin, end = wall_range(lists, i)
    total = add_weights(continuity, walls, lists, begin, end, kernel, constants, x, y, own)
    of_walls, part = scale * (total - own), (begin, end)
    total = add_wall_images(mirrors, walls, continuity, lists, part, model, x, y, total)
    part = fluid_range(lists, i)
    total = add_image_weights(mirrors, continuity, fluid, lists, part, model, x, y, total)
    total = add_plate_weights(
        model.mirror_plates, continuity, fluid, lists, part, model, x, y, total
    )
    return add_offset(fluid.offset, i, scale * total), of_walls


@jitable
def add_offset(offset, i, rho):
    """Return rho plus the column `offset` where there is one."""
    if offset is None:
        return rho
    return rho + load(offset, i)


@jitable
def add_normals(tension, sources, lists, first, last, constants, x, y, nx, ny):
    """nx, ny + sum of grad W shapes between (x, y) and the listed `sources`."""
    zero = like(nx, 0.0)
    for k in range(first, last):
        j = neighbor(lists, k)
        dx = nearest_image(constants.period_x, x - broadcast(sources.x, j))
        dy = nearest_image(constants.period_y, y - broadcast(sources.y, j))
        r2 = dx * dx + dy * dy + like(nx, COINCIDENT)
        rest = maximum(tension.h - r2 * rsqrt(r2), zero)
        slope = rest * rest * rest
        nx, ny = nx - slope * dx, ny - slope * dy
    return nx, ny


@jitable
def add_image_normals(mirrors, tension, fluid, i, lists, constants, nx, ny):
    """nx, ny + sum of grad W shapes between the group of i and the images of its neighbours."""
    if mirrors is None:
        return nx, ny
    x, y = load(fluid.x, i), load(fluid.y, i)
    zero, (begin, end) = like(x, 0.0), fluid_range(lists, i)
    for k in range(1, N_IMAGES):
        image = image_of(mirrors, k, constants.h, x, y)
        if not is_near(image):
            continue
        ox, oy = zero, zero
        for q in range(begin, end):
            if meets(image, fluid, neighbor(lists, q)):
                ox, oy = add_normals(
                    tension, fluid, lists, q, q + 1, constants, image.x, image.y, ox, oy
                )
        _, sign_x = turned(0.0, 0.0, k // 3, zero)
        _, sign_y = turned(0.0, 0.0, k % 3, zero)
        nx, ny = nx + like(zero, sign_x) * ox, ny + like(zero, sign_y) * oy
    return nx, ny


@jitable
def add_plate_normals(plates, tension, fluid, i, lists, constants, nx, ny):
    """nx, ny + sum of grad W shapes that plates add, less those that they hide."""
    if plates is None:
        return nx, ny
    x, y = load(fluid.x, i), load(fluid.y, i)
    zero, (begin, end) = like(x, 0.0), fluid_range(lists, i)
    for k in range(plates.x.size):
        if not is_at_plate(plates, k, x, y):
            continue
        for what in range(2):
            ox, oy = zero, zero
            for q in range(begin, end):
                j = neighbor(lists, q)
                acts, px, py = through_plate(plates, k, what, x, y, fluid.x[j], fluid.y[j])
                if acts:
                    ox, oy = add_normals(tension, fluid, lists, q, q + 1, constants, px, py, ox, oy)
            sign = like(zero, -1.0 if what == HIDDEN else 1.0)
            xx, xy, yy = mirror_matrix(plates, k, what)
            nx = nx + sign * (like(zero, xx) * ox + like(zero, xy) * oy)
            ny = ny + sign * (like(zero, xy) * ox + like(zero, yy) * oy)
    return nx, ny


@jitable
def store_normals(tension, mirrors, plates, fluid, i, n, lists, constants):
    """Store n / sqrt|n|, n the gradient of the share of space that the fluid fills, of a group.

    Mirror images count as fluid, boundary particles do not and are not wetted. Were they to count,
    the pull would end at them, and without a counterforce a drop on a plate would boil.
    """
    if tension is None:
        return
    x, y = load(fluid.x, i), load(fluid.y, i)
    zero = like(x, 0.0)
    begin, end = fluid_range(lists, i)
    nx, ny = add_normals(tension, fluid, lists, begin, end, constants, x, y, zero, zero)
    nx, ny = add_image_normals(mirrors, tension, fluid, i, lists, constants, nx, ny)
    nx, ny = add_plate_normals(plates, tension, fluid, i, lists, constants, nx, ny)
    nx, ny = tension.volume_scale * nx, tension.volume_scale * ny
    inv_size = rsqrt(nx * nx + ny * ny + tension.disorder2)
    # 1 / sqrt|n|: the square root of 1 / |n|
    inv_root = inv_size * rsqrt(inv_size)
    store(fluid.nx, i, inv_root * nx, n)
    store(fluid.ny, i, inv_root * ny, n)


@jitable
def compute_fluid_density(rank, n_threads, first, last, cells, model, grid, dt):
    """Compute lists, rho and p / rho^2 of fluid particles first to last.

    Return the end of the thread's list, beyond `list_end` if that was too short, in which case not
    all of it was done; and the first particle that is inside a wall, or -1.
    """
    fluid, walls, lists, constants = cells.fluid, cells.walls, cells.lists, model.constants
    k, list_end = own_part(lists, rank, n_threads)
    walled = -1
    for row in range(grid.n_rows):
        low, high = row_range(grid, cells.start, row)
        i, high = max(low, first), min(high, last)
        while i < high:
            n = rest_of_block(i - low, width(fluid.x), high - i)
            n, k = list_group(cells, grid, constants, i, n, k, list_end)
            if k > list_end:
                return k, walled
            rho, of_walls = density(model.effects.continuity, fluid, i, walls, lists, model)
            inside = first_walled(walls, model, cells, i, n, of_walls, dt)
            if inside >= 0 and walled < 0:
                walled = i + inside
            store_density(fluid, i, n, rho, model.eos)
            store_normals(
                model.effects.surface_tension,
                model.mirrors,
                model.mirror_plates,
                fluid,
                i,
                n,
                lists,
                constants,
            )
            i += n
    return k, walled


@inlined
def list_group(cells, grid, constants, i, n, k, list_end):
    """Write down the neighbours of a group of at most n. Return its size and the list's end."""
    fluid, lists = cells.fluid, cells.lists
    n, box = compact_group(fluid, i, n, constants.widest)
    middle = collect_images(constants, box, grid, cells.start, fluid, lists, k, list_end)
    end = collect_images(
        constants, box, grid, cells.wall_start, cells.walls, lists, middle, list_end
    )
    groups = lists.groups
    groups[4 * i + BEGIN], groups[4 * i + MIDDLE] = k, middle
    groups[4 * i + END], groups[4 * i + SIZE] = end, n
    return n, end
