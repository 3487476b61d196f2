"""The texts of the window: numbers of the picked particle, the line of keys, and the help."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from sph_gym.view.colors import DOMAIN, EDGE, INK, MUTED, PAGE, RULE
from sph_gym.view.layout import Area
from sph_gym.view.marks import describe
from sph_gym.view.state import Shown
from sph_gym.view.toolkit import Lettering, load

if TYPE_CHECKING:
    from pygame import Surface

# Keys and what they do: short for the line below the picture, long for the help.
KEYS = (
    ("?", "help", "show or hide this help"),
    ("space", "run", "run, or pause"),
    ("S, right", "on", "one frame on (computed, or one that is kept)"),
    ("left", "back", "one frame back; the states are exact"),
    ("Home, End", "", "to the first and to the newest frame; the timeline below can be dragged"),
    ("L", "substeps", "the last 100 substeps one by one; again: back to the frames"),
    ("C", "colour", "next quantity for the colours; shift C: the one before"),
    ("N", "", "colour by the number of neighbours, and back"),
    ("F", "forces", "arrows of forces per mass"),
    ("V", "velocities", "arrows of velocities"),
    ("G", "cells", "the cells of the neighbour search"),
    ("click", "", "a particle: its numbers, its neighbours, its support; beside it: let go"),
    ("sliders", "", "drag dt, stiffness, xsph; the red part is beyond what is stable"),
    ("H", "hand over", "let the next controller set the controls; after the last one, you again"),
    ("P", "picture", "save the picture as PNG in the working directory"),
    ("R", "record", "begin and end an mp4 film in the working directory"),
    ("Q, Esc", "quit", "close the window"),
)
# Height of a line, and width of the names [em].
LINE, NAMES = 1.45, 6.6
# The help is so wide [em].
HELP_WIDTH = 44.0


class Texts:
    """Draws the texts. em: their size [pixels]."""

    def __init__(self, em: int) -> None:
        self._em = em
        self._muted, self._ink = Lettering(em, MUTED), Lettering(em, INK)
        self._bold = Lettering(em, INK, bold=True)

    def draw_particle(self, surface: "Surface", area: Area, state: Shown, i: int | None) -> None:
        """Draw the numbers of particle i; without one, how to pick one."""
        em, (left, top, width, _) = self._em, area
        y = top + 0.5 * em
        if i is None:
            text = "click a particle to see its numbers"
            self._muted.draw(surface, self._muted.fitted(text, width - 2 * em), left + em, y)
            return
        (_, first), *rest = describe(state, i)
        self._bold.draw(surface, f"particle {first}", left + em, y)
        for k, (name, text) in enumerate(rest, start=1):
            y = top + (0.8 + k * LINE) * em
            self._muted.draw(surface, name, left + em, y)
            room = width - (NAMES + 1.5) * em
            self._ink.draw(surface, self._ink.fitted(text, room), left + (NAMES + 1) * em, y)

    def draw_line(self, surface: "Surface", area: Area, notice: str, paused: bool) -> None:
        """Draw the line of keys, or the notice if there is one; paused: what space would end."""
        em, (left, top, width, _) = self._em, area
        surface.fill(RULE, load().Rect(area))
        x, y = float(left + em), top + 0.4 * em
        if notice:
            self._ink.draw(surface, self._ink.fitted(notice, width - 2 * em), x, y)
            return
        for key, meaning, _ in KEYS:
            if not meaning:
                continue
            meaning = "pause" if key == "space" and not paused else meaning
            if x + self._bold.width(key) + self._muted.width(meaning) + 1.4 * em > left + width:
                break
            x = self._bold.draw(surface, key, x, y) + 0.4 * em
            x = self._muted.draw(surface, meaning, x, y) + 1.2 * em

    def draw_help(self, surface: "Surface") -> None:
        """Draw all keys in a box in the middle of the window."""
        pygame, em = load(), self._em
        width = min(round(HELP_WIDTH * em), surface.get_width() - 2 * em)
        height = round((len(KEYS) * LINE + 2.0) * em)
        box = pygame.Rect(0, 0, width, height)
        box.center = surface.get_rect().center
        surface.fill(PAGE, box)
        pygame.draw.rect(surface, EDGE, box, 1)
        for k, (key, _, meaning) in enumerate(KEYS):
            y = box.top + (1.0 + k * LINE) * em
            self._bold.draw(surface, key, box.left + em, y)
            start = box.left + 7.5 * em
            text = self._ink.fitted(meaning, box.right - start - em)
            self._ink.draw(surface, text, start, y)

    def draw_message(self, surface: "Surface", area: Area, text: str, above: bool) -> None:
        """Draw a message into an area, in as many lines as it takes; above: at its upper edge."""
        em, (left, top, width, height) = self._em, area
        lines = self._wrapped(text, width - 2 * em)
        high = round((len(lines) * LINE + 0.8) * em)
        box = load().Rect(left, top if above else top + height - high, width, high)
        surface.fill(DOMAIN, box)
        load().draw.rect(surface, EDGE, box, 1)
        for k, line in enumerate(lines):
            self._bold.draw(surface, line, left + em, box.top + (0.5 + k * LINE) * em)

    def _wrapped(self, text: str, room: float) -> Sequence[str]:
        """Return the text in lines that are no wider than `room` [pixels]."""
        lines = [""]
        for word in text.split():
            longer = f"{lines[-1]} {word}".strip()
            if self._bold.width(longer) > room and lines[-1]:
                lines.append(word)
            else:
                lines[-1] = longer
        return [self._bold.fitted(line, room) for line in lines]
