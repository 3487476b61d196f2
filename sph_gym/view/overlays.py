"""Drawings around and over the fluid: walls, arrows, the colour bar, the controls."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.scene import Scene
from sph_gym.solver.state import Controls
from sph_gym.view.colors import EDGE, Quantity, Rgb, ticks, velocity_scale
from sph_gym.view.layout import FIELD, LINE, Layout, control_rows
from sph_gym.view.state import Shown
from sph_gym.view.toolkit import Lettering, load, sprite

if TYPE_CHECKING:
    from pygame import Surface

# More arrows than this hide the fluid; the same particles carry them in every frame.
MAX_ARROWS = 200
# Stands for a number that a recording doesn't have.
UNKNOWN = "?"
# Units and their sizes, the largest first.
TIMES = {"s": 1.0, "ms": 1e-3, "µs": 1e-6}
PRESSURES = {"GPa": 1e9, "MPa": 1e6, "kPa": 1e3, "Pa": 1.0}


class ArrowUnit(NamedTuple):
    """The meaning of an arrow: `size`, in `unit`, is one of unit length; color: of its kind."""

    size: float
    unit: str
    color: Rgb


def significant(value: float, digits: int = 3) -> str:
    """Return a number with so many significant digits; an exponent only if it is huge or tiny."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    decimals = digits - 1 - math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if not -3 <= decimals <= 6:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(decimals, 0)}f}"


def with_unit(value: float, units: Mapping[str, float]) -> str:
    """Return a value in the first of some units that it fills, else the last; "?" for NaN.

    units: sizes by name, the largest first.
    """
    if not math.isfinite(value):
        return UNKNOWN
    # 0.9995 has the three digits of 1.00
    unit = next((each for each in units if value >= 0.9995 * units[each]), [*units][-1])
    return f"{significant(value / units[unit])} {unit}"


def control_texts(controls: Controls, scene: Scene, off: str = "off") -> dict[str, str]:
    """Return the controls as texts with units, by name; off: epsilon of a scene without XSPH."""
    epsilon = f"{controls.xsph:.2f}" if scene.effects.xsph else off
    return {
        "dt": with_unit(controls.dt, TIMES),
        "stiffness": with_unit(controls.stiffness, PRESSURES),
        "xsph": epsilon if math.isfinite(controls.xsph) else UNKNOWN,
    }


def clock(time: float, frame: float) -> str:
    """Return a time in seconds, with digits enough to tell two frames apart; at least three."""
    decimals = 3 if frame >= 1e-3 else min(math.ceil(-math.log10(frame)) + 1, 9)
    return f"{time:.{decimals}f} s"


def draw_box(surface: "Surface", layout: Layout, scene: Scene) -> None:
    """Draw the finite sides of the box that clamps particles, as lines on the domain."""
    if scene.walls is None or scene.walls.box is None:
        return
    pygame, view = load(), layout.view
    last = np.array(layout.domain[2:]) - 1
    x_min, x_max = np.clip(scene.walls.box[:2], view.x_min, view.x_max)
    y_min, y_max = np.clip(scene.walls.box[2:], view.y_min, view.y_max)
    corners = np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]])
    # on whole pixels, or the lines would be two of them wide and pale
    at = np.clip(np.floor(layout.pixels(corners)), 0, last).tolist()
    left_below, right_below, right_above, left_above = at
    sides = (
        (left_below, left_above),
        (right_below, right_above),
        (left_below, right_below),
        (left_above, right_above),
    )
    for place, ends in zip(scene.walls.box, sides, strict=True):
        if math.isfinite(place):
            pygame.draw.line(surface, EDGE, *ends)


def arrow_unit(scene: Scene, a: NDArray[Any]) -> float:
    """Return the acceleration [m/s^2] of an arrow of unit length: round, above most of the fluid's.

    It is never below gravity, nor below what takes a thousand particle spacings to bring the
    fluid to its speed: arrows vanish in a fluid at rest, instead of showing round-off.
    """
    size = np.hypot(*a.T)
    size = size[np.isfinite(size)]
    typical = float(np.quantile(size, 0.9)) if size.size else 0.0
    typical = max(typical, velocity_scale(scene) ** 2 / (1000 * scene.dx))
    if scene.effects.field is not None:
        reach = float(np.abs(np.asarray(scene.x)).max())
        typical = max(typical, scene.effects.field.strongest(reach))
    return round_above(typical)


def round_above(value: float) -> float:
    """Return the first of 1, 2, 5, 10, ... times a power of ten that is not below the value."""
    power = 10.0 ** math.floor(math.log10(value))
    # a little leeway, or round-off would lift a round number to the next
    return next(power * step for step in (1, 2, 5, 10) if power * step >= 0.999 * value)


def arrow_length(layout: Layout, dx: float, n: int) -> float:
    """Return the length [pixels] of the arrow of `arrow_unit`, for n particles."""
    between = dx * layout.scale * math.sqrt(max(n / MAX_ARROWS, 1.0))
    return min(max(1.5 * between, 1.8 * layout.em), 4.0 * layout.em)


def arrow_carriers(n: int) -> NDArray[np.int64]:
    """Return which of n particles carry arrows: evenly strewn, always the same."""
    if n <= MAX_ARROWS:
        return np.arange(n)
    golden = (math.sqrt(5) - 1) / 2
    return np.unique((np.arange(MAX_ARROWS) * golden % 1.0 * n).astype(np.int64))


def draw_arrows(
    surface: "Surface", start: NDArray[Any], along: NDArray[Any], longest: float, color: Rgb
) -> None:
    """Draw arrows from (n, 2) pixels along (n, 2) vectors [pixels], cut off at `longest`."""
    with np.errstate(invalid="ignore", divide="ignore"):
        length = np.hypot(*along.T)
        shown = (length >= 2.0) & np.isfinite(start).all(axis=1) & np.isfinite(length)
        start, along, length = start[shown], along[shown], length[shown]
    ahead = along / length[:, None]
    length = np.minimum(length, longest)[:, None]
    head = np.clip(0.4 * length, 2.0, 6.0)
    side = np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1) * head * 0.42
    tip, neck = start + ahead * length, start + ahead * (length - head)
    pygame = load()
    parts = (part.tolist() for part in (start, neck, tip, neck + side, neck - side))
    for foot, end, point, left, right in zip(*parts, strict=True):
        pygame.draw.aaline(surface, color, foot, end)
        pygame.draw.polygon(surface, color, (point, left, right))
        pygame.draw.aalines(surface, color, True, (point, left, right))


def draw_color_bar(
    surface: "Surface",
    layout: Layout,
    quantity: Quantity,
    limits: tuple[float, float],
    lettering: Lettering,
) -> None:
    """Draw the palette with its label, its unit and round numbers."""
    pygame = load()
    left, top, width, _ = layout.color_bar
    em = layout.em
    lettering.draw(surface, lettering.fitted(quantity.title, width), left, top)
    bar_top, bar_height = round(top + LINE * em), round(0.8 * em)
    row = quantity.palette[np.linspace(0, 255, width).round().astype(int)]
    rgb = np.repeat(row[:, None], bar_height, axis=1)
    surface.blit(sprite(rgb, np.full(rgb.shape[:2], 255)), (left, bar_top))
    low, high = limits
    numbers, decimals = ticks(limits, max(2, int(width / (3.6 * em))))
    for number in numbers:
        x = left + (width - 1) * (number - low) / (high - low)
        pygame.draw.line(surface, EDGE, (x, bar_top + bar_height), (x, bar_top + bar_height + 3))
        text = f"{number:.{decimals}f}" if abs(number) < 1e6 else f"{number:.0e}"
        half = lettering.width(text) / 2
        middle = min(max(x, left + half), left + width - half)
        lettering.draw(surface, text, middle, bar_top + bar_height + 4, align=0.5)


def draw_controls(
    surface: "Surface", layout: Layout, sim: Shown, names: Lettering, values: Lettering
) -> int:
    """Draw dt, sound speed and xsph, each at a fixed place; return the rows that they took."""
    texts = control_texts(sim.controls, sim.scene)
    sound_speed = with_unit(sim.sound_speed, {"m/s": 1.0})
    shown = {"dt": texts["dt"], "c": sound_speed, "xsph": texts["xsph"]}
    left, top, width, _ = layout.footer
    n_rows = control_rows(width, layout.em)
    n_columns = -(-len(shown) // n_rows)
    for k, (name, value) in enumerate(shown.items()):
        row, column = divmod(k, n_columns)
        x = left + column * FIELD * layout.em
        y = top + row * LINE * layout.em
        end = names.draw(surface, name, x, y)
        values.draw(surface, value, end + 0.4 * layout.em, y)
    return n_rows
