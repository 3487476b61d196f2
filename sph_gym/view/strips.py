"""Numbers over time: one strip each, with a mark at the moment that is shown."""

import math
from typing import TYPE_CHECKING

import numpy as np

from sph_gym.view.colors import ARROW, DOMAIN, INK, MUTED, RULE, VELOCITY
from sph_gym.view.history import Source
from sph_gym.view.layout import Area
from sph_gym.view.overlays import significant
from sph_gym.view.toolkit import Lettering, load

if TYPE_CHECKING:
    from pygame import Rect, Surface

# Height of the text over a strip, and the least height of a strip with it [em].
TEXT, LEAST = 1.4, 2.1


class Strips:
    """Draws the measures of all moments of a source below each other.

    area: in the window [pixels]; em: size of the text. Strips that don't fit are left out, and a
    line says how many.
    """

    def __init__(self, area: Area, em: int) -> None:
        self._area, self._em = area, em
        self._title, self._ink = Lettering(em, INK, bold=True), Lettering(em, INK)
        self._muted = Lettering(em, MUTED)

    def draw(self, surface: "Surface", source: Source) -> None:
        """Draw the strips of a source."""
        em, (left, top, width, height) = self._em, self._area
        moments = [source.numbers(k) for k in range(source.n)]
        titles = list(moments[source.at])
        room = height - round(2.2 * em)
        n_shown = min(len(titles), max(int(room / (LEAST * em)), 1))
        heading = f"over {source.n} {source.unit}s" if source.n != 1 else f"1 {source.unit}"
        if n_shown < len(titles):
            heading += f", {len(titles) - n_shown} more not shown"
        text = self._title.fitted(heading, width - 2 * em)
        self._title.draw(surface, text, left + em, top + 0.5 * em)
        each = room // max(n_shown, 1)
        for k, title in enumerate(titles[:n_shown]):
            values = [moment.get(title, math.nan) for moment in moments]
            place = Area(left + em, top + round(2.0 * em) + k * each, width - 2 * em, each)
            self._draw_strip(surface, place, title, values, source.at)

    def _draw_strip(
        self, surface: "Surface", place: Area, title: str, values: list[float], at: int
    ) -> None:
        pygame, em, (left, top, width, height) = load(), self._em, place
        text, unit = _split(title)
        now = f"{significant(values[at])} {unit}".strip()
        start = left + width - self._ink.width(now)
        self._ink.draw(surface, now, left + width, top, align=1.0)
        self._muted.draw(surface, self._muted.fitted(text, start - left - 0.5 * em), left, top)
        below = round(TEXT * em)
        frame = pygame.Rect(left, top + below, width, max(height - below - em // 3, 3))
        surface.fill(DOMAIN, frame)
        at_x, at_y = _points(values, frame.width, frame.height)
        _draw_line(surface, frame, at_x, at_y)
        mark = frame.left + round((frame.width - 1) * at / max(len(values) - 1, 1))
        pygame.draw.line(surface, ARROW, (mark, frame.top), (mark, frame.bottom - 1))
        pygame.draw.rect(surface, RULE, frame, 1)


def _split(title: str) -> tuple[str, str]:
    """Return the words and the unit of a title such as "largest speed [m/s]"."""
    words, bracket, unit = title.partition(" [")
    return words, unit.rstrip("]") if bracket else ""


def _points(values: list[float], width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels (k,), (k,) of values: zero or the least at the bottom, the largest on top.

    Of more values than pixels, the largest and the least of each pixel are kept.
    """
    numbers = np.array(values, float)
    numbers[~np.isfinite(numbers)] = np.nan
    places = np.linspace(0, width - 1, len(numbers))
    if np.isnan(numbers).all():
        return np.zeros(0), np.zeros(0)
    low, high = min(float(np.nanmin(numbers)), 0.0), max(float(np.nanmax(numbers)), 0.0)
    share = (numbers - low) / (high - low) if high > low else np.zeros_like(numbers)
    return places, (height - 3) * (1 - share) + 1


def _draw_line(surface: "Surface", frame: "Rect", x: np.ndarray, y: np.ndarray) -> None:
    """Draw a line through the points of a strip, broken where a value is missing."""
    pygame = load()
    inside = surface.subsurface(frame)
    present = np.flatnonzero(np.isfinite(y))
    for part in np.split(present, np.flatnonzero(np.diff(present) > 1) + 1):
        points = np.stack([x[part], y[part]], axis=-1).tolist()
        if len(points) == 1:
            pygame.draw.circle(inside, VELOCITY, points[0], 2)
        elif points:
            pygame.draw.lines(inside, VELOCITY, False, points, 2)
