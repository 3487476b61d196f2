"""A picked particle and the cell grid: what is drawn over the fluid, and the numbers beside it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from sph_gym.solver.neighbors import read_grid
from sph_gym.solver.origin import origin
from sph_gym.solver.simulation import Simulation
from sph_gym.view.colors import BAD, EDGE, INK, MUTED
from sph_gym.view.layout import Layout
from sph_gym.view.nearby import nearest_images, neighbors_of
from sph_gym.view.overlays import significant
from sph_gym.view.state import Shown, columns_of, periods
from sph_gym.view.toolkit import load

if TYPE_CHECKING:
    from pygame import Surface

# A click hits a particle within so many of its spacings, and at least so many pixels.
HIT, HIT_PIXELS = 1.0, 8.0
# Lines of the grid that are nearer to each other than so many pixels aren't drawn.
CLOSEST = 4.0
# Rings around discs of at least this radius [pixels] are two pixels wide.
THICK = 4.0
# Radius of the mark for a particle outside of the picture [pixels].
STRAY = 10.0


def particle_at(state: Shown, layout: Layout, pixel: tuple[float, float]) -> int | None:
    """Return the index of the particle at a pixel of the picture, None if there is none."""
    if not layout.domain.holds(pixel):
        return None
    with np.errstate(invalid="ignore"):
        distance = np.hypot(*(state.x - layout.metres(pixel)).T)
    if not np.isfinite(distance).any():
        return None
    i = int(np.nanargmin(distance))
    reach = max(HIT * state.scene.dx, HIT_PIXELS / layout.scale)
    return i if distance[i] <= reach else None


def describe(state: Shown, i: int) -> list[tuple[str, str]]:
    """Return the numbers of particle i as names and texts with units."""
    columns, scene = columns_of(state), state.scene
    x, v = state.x, state.v
    wall = i >= state.n_fluid
    near, distance = neighbors_of(x, i, scene.h, periods(scene))
    lines = [
        ("particle", f"{i}, boundary" if wall else f"{i}"),
        ("x, y", f"{_pair(x[i])} m"),
        ("velocity", f"{_pair(v[i])} m/s"),
        ("speed", f"{_number(np.hypot(*v[i]))} m/s"),
    ]
    if "rho" in columns:
        rho = float(state.rho[i])
        lines.append(("density", f"{_number(rho, 5)} kg/m³"))
        lines.append(("above rest", f"{_number(100 * (rho / scene.fluid.rho0 - 1))} %"))
    if "p" in columns:
        lines.append(("pressure", f"{_number(state.p[i], 4)} Pa"))
    if "a" in columns and not wall:
        lines.append(("acceleration", f"{_pair(state.a[i])} m/s²"))
    lines.append(("neighbours", f"{len(near)} within h"))
    if len(near):
        lines.append(("nearest", f"{int(near[0])}, at {_number(distance[0] / scene.dx)} dx"))
    return lines


def _number(value: Any, digits: int = 3) -> str:
    return significant(float(value), digits)


def _pair(vector: Any) -> str:
    return f"{_number(vector[0])}, {_number(vector[1])}"


def draw_picked(surface: "Surface", layout: Layout, state: Shown, i: int) -> None:
    """Draw the support of particle i as a circle, rings around its neighbours, a dot on it."""
    pygame, x, scene = load(), state.x, state.scene
    if not np.isfinite(x[i]).all():
        return
    inside = surface.subsurface(pygame.Rect(layout.domain))
    centre = layout.pixels(x[i][None])[0]
    last = np.array(layout.domain[2:]) - 1
    if (centre < 0).any() or (centre > last).any():
        # far away: half a disc at the edge that is nearest to it
        pygame.draw.circle(inside, BAD, np.clip(centre, 0, last).tolist(), STRAY)
        return
    near, _ = neighbors_of(x, i, scene.h, periods(scene))
    # at the image that is near: across a periodic side they lie on this one
    at = layout.pixels(x[i] + nearest_images(x[near] - x[i], periods(scene)))
    radius = max(0.5 * scene.dx * layout.scale, 2.0)
    for pixel in at.tolist():
        pygame.draw.circle(inside, BAD, pixel, radius + 1, 2 if radius >= THICK else 1)
    pygame.draw.circle(inside, BAD, centre.tolist(), scene.h * layout.scale, 2)
    pygame.draw.circle(inside, INK, centre.tolist(), radius + 3, 3)
    pygame.draw.circle(inside, BAD, centre.tolist(), max(radius / 2, 2.0), 0)


def draw_cells(surface: "Surface", layout: Layout, state: Shown) -> str:
    """Draw the cells of the neighbour search; return a few words about them.

    Of a simulation, its own cells, h high and h / 4 wide; of a recording, squares as wide as the
    support.
    """
    pygame, scene = load(), state.scene
    inside = surface.subsurface(pygame.Rect(layout.domain))
    if isinstance(state, Simulation):
        grid = read_grid(state.engine.world.sorting.frame)
        if grid.n_columns * grid.n_rows <= 1:
            return "all pairs: there is no cell grid"
        start = np.array([grid.x0, grid.y0]) + origin(scene, np.dtype(state.dtype).type)
        width = np.array([1 / grid.columns_per_m, 1 / grid.rows_per_m])
        n, text = (grid.n_columns, grid.n_rows), f"{grid.n_columns} x {grid.n_rows} cells"
    else:
        width = np.full(2, scene.h)
        view = layout.view
        start = np.array([view.x_min, view.y_min])
        n = (int(view.width / scene.h) + 1, int(view.height / scene.h) + 1)
        text = "squares of the support"
    if (width * layout.scale < CLOSEST).any():
        return f"{text}, too narrow to be drawn"
    first, last = layout.pixels(np.array([start, start + width * n]))
    for axis, color in ((0, MUTED), (1, EDGE)):
        ends = np.linspace(first[axis], last[axis], n[axis] + 1)
        for place in ends[(ends > -1) & (ends < layout.domain[2 + axis])].tolist():
            a, b = (place, first[1]), (place, last[1])
            if axis == 1:
                a, b = (first[0], place), (last[0], place)
            pygame.draw.line(inside, color, a, b)
    return text


def offender_of(sim: Simulation, kind: str) -> int:
    """Return the particle that a kind of warning is about, -1 if it is about none in particular."""
    if kind in ("mach", "energy"):
        return int(np.argmax(np.hypot(*sim.v[: sim.n_fluid].T)))
    if kind == "clumping":
        nearest = np.empty(sim.n_fluid)
        nearest[sim.engine.fluid.id] = sim.engine.nearest_and_count()[0]
        return int(np.argmin(nearest))
    if kind == "walls":
        return _deepest(sim)
    return -1


def _deepest(sim: Simulation) -> int:
    """Return the fluid particle that is nearest to a boundary particle, -1 without any."""
    x, n = sim.x, sim.n_fluid
    if len(x) == n:
        return -1
    # boundary particles take the place of the fluid, the fluid that of the others
    found, least = -1, np.inf
    for i in range(n):
        distance = float(np.min(((x[n:] - x[i]) ** 2).sum(axis=1)))
        if distance < least:
            found, least = i, distance
    return found
