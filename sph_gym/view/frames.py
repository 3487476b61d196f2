"""`Painter`: frames of a running simulation as arrays, without a display."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.scene import Scene
from sph_gym.solver.warnings import short
from sph_gym.view import colors
from sph_gym.view.colors import velocity_scale
from sph_gym.view.layout import LINE, N_LINES, View, arrange
from sph_gym.view.overlays import (
    ArrowUnit,
    arrow_carriers,
    arrow_length,
    arrow_unit,
    clock,
    draw_arrows,
    draw_box,
    draw_color_bar,
    draw_controls,
    round_above,
)
from sph_gym.view.particles import Discs
from sph_gym.view.state import Shown, columns_of
from sph_gym.view.toolkit import Lettering, load

if TYPE_CHECKING:
    from pygame import Surface

# Discs of fluid are larger than dx by so many pixels, or a fine fluid would look threadbare;
# those of walls are smaller by a share, and so stay apart.
OVERLAP, WALL_SHARE = 0.6, 0.9
# Below this diameter [pixels] discs would be lost between the pixels.
SMALLEST = 2.0


class Painter:
    """Paints pictures of one scene, all of the same size and of the same part of space.

    scene: what will be shown; size: width [pixels], from which the height follows, or (width,
    height); color: a key of `QUANTITIES`; arrows: whether to draw the forces per mass; bounds: the
    part of space to show [m], by default the whole scene with its walls.
    `color`, `arrows` and `velocities` (arrows too) may be changed at any time. Needs no display and
    touches none.

    Raises ValueError for an unknown colour and for sizes that leave no room for the fluid.
    """

    def __init__(
        self,
        scene: Scene,
        size: int | tuple[int, int] = 640,
        color: str = "speed",
        arrows: bool = False,
        bounds: View | None = None,
    ) -> None:
        if not isinstance(scene, Scene):
            raise ValueError(f"scene: expected a Scene, got {scene!r}")
        self.scene = scene
        self.color = color
        self.arrows, self.velocities = arrows, False
        self.layout = arrange(scene, size, bounds)
        spacing = scene.dx * self.layout.scale
        self._diameter = max(spacing + OVERLAP, SMALLEST)
        self._discs: dict[str, Discs] = {}
        wall_diameter = max(WALL_SHARE * spacing, SMALLEST)
        self._wall_discs = Discs([colors.WALL], wall_diameter, rim=False)
        em = self.layout.em
        self._title = Lettering(em, colors.INK, bold=True)
        self._ink = Lettering(em, colors.INK)
        self._alarm = Lettering(em, colors.BAD, bold=True)
        self._muted = Lettering(em, colors.MUTED)
        self._surface: Surface = load().Surface(self.size, 0, 32)
        self._backdrop: Surface = load().Surface(self.size, 0, 32)
        self._wall_x: NDArray[Any] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures [pixels], both even."""
        return self.layout.size

    @property
    def color(self) -> str:
        """The quantity that the colours show, a key of `QUANTITIES`; ValueError for any other."""
        return self._color

    @color.setter
    def color(self, name: str) -> None:
        self._quantity = colors.quantity(name)
        self._color = name

    def paint(self, sim: Shown, title: str = "", lines: Sequence[str] = ()) -> NDArray[np.uint8]:
        """Return a new picture, (height, width, 3), of the present state.

        title: above the fluid, by default the scene's name; lines: at most two, shown below the
        controls. Warnings of the simulation are shown in the upper left corner of the domain.
        Raises ValueError for more lines, and for what is no state.
        """
        return as_array(self.draw(sim, title, lines))

    def draw(self, sim: Shown, title: str = "", lines: Sequence[str] = ()) -> "Surface":
        """Paint onto the painter's own surface, which holds the picture until the next one."""
        if len(lines) > N_LINES:
            raise ValueError(f"lines: expected at most {N_LINES}, got {len(lines)}")
        if not isinstance(getattr(sim, "scene", None), Scene):
            raise ValueError(f"sim: expected a Simulation or a state of a recording, got {sim!r}")
        x = sim.x
        self._draw_backdrop(x[sim.n_fluid :])
        units = self._draw_fluid(sim, x[: sim.n_fluid])
        self._draw_warnings(sim)
        self._draw_header(sim, title, units)
        self._draw_footer(sim, lines)
        return self._surface

    def _draw_backdrop(self, wall_x: NDArray[Any]) -> None:
        """Draw walls and empty domain; they are made anew only after walls have moved."""
        if self._wall_x is None or not np.array_equal(wall_x, self._wall_x):
            frame = load().Rect(self.layout.domain)
            self._backdrop.fill(colors.PAGE)
            self._backdrop.fill(colors.RULE, frame.inflate(2, 2))
            self._backdrop.fill(colors.DOMAIN, frame)
            inside = self._backdrop.subsurface(frame)
            first = np.zeros(len(wall_x), np.int64)
            self._wall_discs.draw(inside, self.layout.pixels(wall_x), first)
            draw_box(inside, self.layout, self.scene)
            self._wall_x = wall_x
        self._surface.blit(self._backdrop, (0, 0))

    def _draw_fluid(self, sim: Shown, x: NDArray[Any]) -> list[ArrowUnit]:
        """Draw the fluid at x (n_fluid, 2) [m]; return the units of its arrows."""
        inside = self._surface.subsurface(load().Rect(self.layout.domain))
        at, shown = self.layout.pixels(x), self._quantity
        index = colors.palette_index(shown.values(sim), shown.limits(self.scene))
        if self._color not in self._discs:
            palette = np.concatenate([shown.palette, [colors.BAD]])
            self._discs[self._color] = Discs(palette, self._diameter)
        self._discs[self._color].draw(inside, at, index)
        units, n = [], sim.n_fluid
        if self.velocities:
            size = round_above(velocity_scale(self.scene))
            units.append(ArrowUnit(size, "m/s", colors.VELOCITY))
            self._draw_along(inside, at, sim.v[:n], units[-1])
        if self.arrows and "a" in columns_of(sim):
            a = sim.a[:n]
            units.append(ArrowUnit(arrow_unit(self.scene, a), "m/s²", colors.ARROW))
            self._draw_along(inside, at, a, units[-1])
        return units

    def _draw_along(
        self, inside: "Surface", at: NDArray[Any], along: NDArray[Any], unit: ArrowUnit
    ) -> None:
        """Draw arrows at (n, 2) pixels along (n, 2) vectors."""
        carriers = arrow_carriers(len(at))
        length = arrow_length(self.layout, self.scene.dx, len(at))
        ways = along[carriers] * (length / unit.size, -length / unit.size)
        draw_arrows(inside, at[carriers], ways, 2 * length, unit.color)

    def _draw_warnings(self, sim: Shown) -> None:
        text = ", ".join(map(short, sim.warnings))
        if text:
            left, top, width, _ = self.layout.domain
            text = self._alarm.fitted(f"warning: {text}", width - self.layout.em)
            place = left + 0.5 * self.layout.em, top + 0.4 * self.layout.em
            self._alarm.draw(self._surface, text, *place)

    def _draw_header(self, sim: Shown, title: str, units: Sequence[ArrowUnit]) -> None:
        """Draw the title on the left, the time on the right, and arrows of unit length."""
        left, _, width, _ = self.layout.domain
        em = self.layout.em
        y, right = 0.7 * em, left + width
        time = f"t = {clock(sim.time, self.scene.frame)}"
        self._ink.draw(self._surface, time, right, y, align=1.0)
        # as wide as the widest digits, so that nothing moves while time goes on
        right -= round(max(self._ink.width(time), 6 * em))
        for unit in units:
            text = f"{unit.size:g} {unit.unit}"
            right -= round(self._muted.width(text) + em)
            self._muted.draw(self._surface, text, right, y)
            length = arrow_length(self.layout, self.scene.dx, sim.n_fluid)
            right -= round(length + 0.5 * em)
            start = np.array([[right, y + 0.55 * em]])
            draw_arrows(self._surface, start, np.array([[length, 0.0]]), length, unit.color)
        title = title or self.scene.name.replace("_", " ").capitalize()
        self._title.draw(self._surface, self._title.fitted(title, right - left - em), left, y)

    def _draw_footer(self, sim: Shown, lines: Sequence[str]) -> None:
        limits = self._quantity.limits(self.scene)
        draw_color_bar(self._surface, self.layout, self._quantity, limits, self._muted)
        n_rows = draw_controls(self._surface, self.layout, sim, self._muted, self._ink)
        left, top, width, _ = self.layout.footer
        for row, line in enumerate(lines, start=n_rows):
            y = top + row * LINE * self.layout.em
            self._ink.draw(self._surface, self._ink.fitted(line, width), left, y)


def as_array(surface: "Surface") -> NDArray[np.uint8]:
    """Return a copy of a surface as (height, width, 3)."""
    data = load().image.tobytes(surface, "RGB")
    width, height = surface.get_size()
    return np.frombuffer(data, np.uint8).reshape(height, width, 3).copy()
