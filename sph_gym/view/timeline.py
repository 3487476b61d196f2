"""The timeline: where among the moments of a source the window is, and the way to another one."""

from typing import TYPE_CHECKING

from sph_gym.view.colors import EDGE, INK, MUTED, RULE
from sph_gym.view.layout import Area
from sph_gym.view.playback import Source
from sph_gym.view.toolkit import Lettering, load

if TYPE_CHECKING:
    from pygame import Surface

# Width of the text on the left, and radius of the knob [em].
TEXT, KNOB = 16.0, 0.5


class Timeline:
    """A track with a knob that can be dragged. area: in the window; em: size of the text."""

    def __init__(self, area: Area, em: int) -> None:
        self.area, self._em = area, em
        self._ink, self._muted = Lettering(em, INK), Lettering(em, MUTED)

    @property
    def track(self) -> Area:
        """The line on which the knob moves."""
        left, top, width, height = self.area
        start = left + round(TEXT * self._em)
        return Area(start, top + height // 2, left + width - round(1.2 * self._em) - start, 1)

    def moment(self, pixel: tuple[int, int], n: int) -> int:
        """Return which of n moments is at a pixel; beyond the ends, that of the end."""
        left, _, width, _ = self.track
        share = (pixel[0] - left) / width
        return round(min(max(share, 0.0), 1.0) * (n - 1))

    def draw(self, surface: "Surface", source: Source, words: str) -> None:
        """Draw the place of the present moment; words: what the window is doing."""
        pygame, em = load(), self._em
        left, top, width, _ = self.area
        surface.fill(RULE, pygame.Rect(left, top, width, 1))
        y = top + 0.6 * em
        text = f"{source.unit} {source.at + 1} of {source.n}"
        end = self._ink.draw(surface, text, left + em, y)
        room = self.track.left - end - 1.2 * em
        self._muted.draw(surface, self._muted.fitted(words, room), end + 0.5 * em, y)
        start, middle, long, _ = self.track
        knob = start + long * (source.at / (source.n - 1) if source.n > 1 else 1.0)
        pygame.draw.line(surface, RULE, (start, middle), (start + long, middle), 4)
        pygame.draw.line(surface, EDGE, (start, middle), (knob, middle), 4)
        pygame.draw.circle(surface, INK, (knob, middle + 1), round(KNOB * em))
