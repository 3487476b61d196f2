"""Numbers over time: one strip each, with a mark at the moment that is shown."""

from typing import TYPE_CHECKING

import numpy as np

from sph_gym.view.colors import ARROW, DOMAIN, INK, MUTED, RULE, VELOCITY
from sph_gym.view.layout import Area
from sph_gym.view.overlays import significant
from sph_gym.view.playback import Source
from sph_gym.view.state import Array
from sph_gym.view.toolkit import Lettering, load

if TYPE_CHECKING:
    from pygame import Rect, Surface

# Height of the text over a strip, and the least height of a strip with it [em].
TEXT, LEAST = 1.4, 2.1
# Width of the scale beside a strip, and size of its numbers [em].
SCALE, SMALL = 3.4, 0.8


class Strips:
    """Draws the measures of all moments of a source below each other.

    area: in the window [pixels]; em: size of the text. Strips that don't fit are left out, and a
    line says how many.
    """

    def __init__(self, area: Area, em: int) -> None:
        self._area, self._em = area, em
        self._title, self._ink = Lettering(em, INK, bold=True), Lettering(em, INK)
        self._muted, self._small = Lettering(em, MUTED), Lettering(round(SMALL * em), MUTED)

    def draw(self, surface: "Surface", source: Source) -> None:
        """Draw the strips of a source."""
        em, (left, top, width, height) = self._em, self._area
        series = source.series()
        titles = list(series)
        room = height - round(2.2 * em)
        n_shown = min(len(titles), max(int(room / (LEAST * em)), 1))
        heading = f"over {source.n} {source.unit}s" if source.n != 1 else f"1 {source.unit}"
        if n_shown < len(titles):
            heading += f", {len(titles) - n_shown} more not shown"
        text = self._title.fitted(heading, width - 2 * em)
        self._title.draw(surface, text, left + em, top + 0.5 * em)
        each = room // max(n_shown, 1)
        for k, title in enumerate(titles[:n_shown]):
            place = Area(left + em, top + round(2.0 * em) + k * each, width - 2 * em, each)
            self._draw_strip(surface, place, title, series[title], source.at)

    def _draw_strip(
        self, surface: "Surface", place: Area, title: str, values: Array, at: int
    ) -> None:
        pygame, em, (left, top, width, height) = load(), self._em, place
        text, unit = _split(title)
        now = f"{significant(float(values[at]))} {unit}".strip()
        start = left + width - self._ink.width(now)
        self._ink.draw(surface, now, left + width, top, align=1.0)
        self._muted.draw(surface, self._muted.fitted(text, start - left - 0.5 * em), left, top)
        below = round(TEXT * em)
        scale = round(SCALE * em)
        frame = pygame.Rect(left, top + below, width - scale, max(height - below - em // 3, 3))
        surface.fill(DOMAIN, frame)
        low, high = _range(values)
        share = (values - low) / (high - low)
        _draw_line(surface, frame, (frame.height - 3) * (1 - share) + 1)
        pygame.draw.rect(surface, RULE, frame, 1)
        mark = frame.left + round((frame.width - 1) * at / max(len(values) - 1, 1))
        pygame.draw.line(surface, ARROW, (mark, frame.top), (mark, frame.bottom - 1))
        self._draw_scale(surface, frame, left + width, (low, high))

    def _draw_scale(
        self, surface: "Surface", frame: "Rect", right: int, ends: tuple[float, float]
    ) -> None:
        """Draw the numbers at the lower and, if there is room, at the upper end of a strip."""
        small = self._small
        low, high = (significant(end, 2) for end in ends)
        small.draw(surface, high, right, frame.top - 1, align=1.0)
        if frame.height >= 2 * small.em:
            small.draw(surface, low, right, frame.bottom - small.em, align=1.0)


def _split(title: str) -> tuple[str, str]:
    """Return the words and the unit of a title such as "largest speed [m/s]"."""
    words, bracket, unit = title.partition(" [")
    return words, unit.rstrip("]") if bracket else ""


def _range(numbers: Array) -> tuple[float, float]:
    """Return the ends of the scale of a strip: the least and the largest number, or zero."""
    finite = numbers[np.isfinite(numbers)]
    low, high = min(finite.min(initial=0.0), 0.0), max(finite.max(initial=0.0), 0.0)
    return float(low), float(high) if high > low else float(low) + 1.0


def _draw_line(surface: "Surface", frame: "Rect", y: Array) -> None:
    """Draw a line through evenly spaced heights (k,) [pixels], broken where one is no number."""
    pygame = load()
    inside = surface.subsurface(frame)
    x = np.linspace(0, frame.width - 1, len(y))
    present = np.flatnonzero(np.isfinite(y))
    for part in np.split(present, np.flatnonzero(np.diff(present) > 1) + 1):
        points = np.stack([x[part], y[part]], axis=-1).tolist()
        if len(points) == 1:
            pygame.draw.circle(inside, VELOCITY, points[0], 2)
        elif points:
            pygame.draw.lines(inside, VELOCITY, False, points, 2)
