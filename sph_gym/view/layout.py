"""Layout of a picture: which part of space is seen, and where on the picture; no drawing here."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.scene import Scene

# How much larger than the fluid the view is where no walls hold it.
OPEN_SPACE = 1.5
# Share of the height that is kept free above walls without a lid.
SPLASH = 0.12
# The smallest picture [pixels] in which the text can still be read.
MIN_WIDTH = 240
MIN_DOMAIN = 48
# Height of the domain over width of the picture, where only the width is asked for.
FLATTEST, TALLEST = 0.15, 0.7
# One line of text and one setting of the controls [em].
LINE, FIELD = 1.6, 8.0
# Rows of text that are kept free besides those of the controls.
N_LINES = 2


class View(NamedTuple):
    """The part of space that is seen, a rectangle [m]."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float

    @property
    def width(self) -> float:
        """Horizontal extent [m]."""
        return self.x_max - self.x_min

    @property
    def height(self) -> float:
        """Vertical extent [m]."""
        return self.y_max - self.y_min


class Area(NamedTuple):
    """A rectangle on the picture [pixels], y downwards."""

    left: int
    top: int
    width: int
    height: int

    def holds(self, pixel: tuple[float, float]) -> bool:
        """Return whether a pixel is in the area."""
        x, y = pixel[0] - self.left, pixel[1] - self.top
        return 0 <= x < self.width and 0 <= y < self.height


class Layout(NamedTuple):
    """Places of everything on a picture.

    size: width and height [pixels], both even; em: size of the text [pixels]; domain: where the
    fluid is seen; footer: what is left for text below it; color_bar: its right-hand end;
    view: what the domain shows [m]; scale: [pixels/m].
    """

    size: tuple[int, int]
    em: int
    domain: Area
    footer: Area
    color_bar: Area
    view: View
    scale: float

    def pixels(self, x: NDArray[Any]) -> NDArray[np.float64]:
        """Return (n, 2) positions [m] as (n, 2) pixels from the domain's upper left corner."""
        origin = np.array([self.view.x_min, self.view.y_max])
        return (np.asarray(x, dtype=float) - origin) * (self.scale, -self.scale)

    def metres(self, pixel: tuple[float, float]) -> NDArray[np.float64]:
        """Return the place (2,) [m] of a pixel, counted from the picture's upper left corner."""
        across, down = pixel[0] - self.domain.left, pixel[1] - self.domain.top
        x = self.view.x_min + across / self.scale
        return np.array([x, self.view.y_max - down / self.scale])


def view_bounds(scene: Scene) -> View:
    """Return what to show for a whole run: walls and fluid, or the blob and space around it."""
    walls, margin = scene.walls, scene.dx
    points = np.asarray(scene.x)
    if walls is not None and walls.particles is not None:
        points = np.concatenate([points, np.asarray(walls.particles)])
    low, high = points.min(axis=0) - scene.dx / 2, points.max(axis=0) + scene.dx / 2
    if walls is None:
        half = np.maximum(OPEN_SPACE * (high - low) / 2, 4 * scene.dx)
        low, high = (low + high) / 2 - half, (low + high) / 2 + half
        return View(low[0], high[0], low[1], high[1])
    sides = (low[0], high[0], low[1], high[1])
    if walls.box is not None:
        # a side at infinity is open: there the particles alone decide
        box = np.where(np.isfinite(walls.box), walls.box, sides)
        outward = np.array([-1, 1, -1, 1])
        sides = tuple(outward * np.maximum(outward * sides, outward * box))
    x_min, x_max, y_min, y_max = (float(side) for side in sides)
    if walls.box is None or not math.isfinite(walls.box[3]):
        y_max += SPLASH * (y_max - y_min)
    return View(x_min - margin, x_max + margin, y_min - margin, y_max + margin)


def arrange(scene: Scene, size: int | tuple[int, int], bounds: View | None = None) -> Layout:
    """Return the layout of a picture of a scene.

    size: width [pixels], from which the height follows, or width and height; odd numbers are
    rounded up; bounds: what to show [m], by default `view_bounds`. Raises ValueError for sizes that
    leave no room.
    """
    width, height = requested(size)
    em = max(9, round(5 + width / 90))
    room = width - 2 * em
    bar_width = min(max(round(0.36 * width), 9 * em), 22 * em)
    text_width = room - bar_width - 2 * em
    n_rows = control_rows(text_width, em) + N_LINES
    header, footer = round(2.4 * em), round((1.1 + LINE * n_rows) * em)
    bounds = view_bounds(scene) if bounds is None else bounds
    height = total_height(height, header + footer, room * bounds.height / bounds.width, room)
    domain = Area(em, header, room, height - header - footer)
    scale = min(room / bounds.width, domain.height / bounds.height)
    below = header + domain.height + round(0.6 * em)
    return Layout(
        (width, height),
        em,
        domain,
        Area(em, below, text_width, height - below),
        Area(width - em - bar_width, below, bar_width, height - below),
        widened(bounds, room / scale, domain.height / scale, scene.walls is not None),
        scale,
    )


def total_height(wanted: int | None, text: int, domain: float, width: int) -> int:
    """Return the height of a picture [pixels]: `wanted`, or what text and domain take.

    domain: the height at which the domain fills the width. Raises ValueError if the text leaves
    no room.
    """
    if wanted is None:
        inner = min(max(domain, FLATTEST * width, MIN_DOMAIN), TALLEST * width)
        return even(round(text + inner))
    if wanted < text + MIN_DOMAIN:
        raise ValueError(
            f"size: expected a height of at least {text + MIN_DOMAIN} pixels for this width and "
            f"the lines of text, got {wanted}"
        )
    return wanted


def control_rows(room: float, em: int) -> int:
    """Return how many rows the three controls take in a column of that many pixels."""
    return math.ceil(3 / min(max(int(room / (FIELD * em)), 1), 3))


def requested(size: int | tuple[int, int]) -> tuple[int, int | None]:
    """Return even width and, if given, even height; ValueError for anything that is no size."""
    sides = tuple(size) if isinstance(size, Sequence) else (size,)
    whole = all(isinstance(side, (int, np.integer)) for side in sides)
    if not whole or len(sides) not in (1, 2) or sides[0] < MIN_WIDTH or min(sides) < 1:
        raise ValueError(
            f"size: expected a width of at least {MIN_WIDTH} pixels, or (width, height), "
            f"got {size!r}"
        )
    return even(sides[0]), even(sides[1]) if len(sides) == 2 else None


def even(n: int) -> int:
    """Return the smallest even number that isn't below n: video encoders want no others."""
    return int(n) + int(n) % 2


def widened(bounds: View, width: float, height: float, on_floor: bool) -> View:
    """Return the view enlarged to width and height [m]: sideways evenly, upwards if `on_floor`."""
    aside = max(width - bounds.width, 0.0) / 2
    above = max(height - bounds.height, 0.0)
    below = 0.0 if on_floor else above / 2
    return View(
        bounds.x_min - aside,
        bounds.x_max + aside,
        bounds.y_min - below,
        bounds.y_max + above - below,
    )
