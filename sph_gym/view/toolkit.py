"""The drawing library, imported on first use, and lettering that looks the same everywhere."""

import math
import os
import threading
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.view.colors import Rgb

if TYPE_CHECKING:
    from pygame import Surface

# Glyphs are drawn this many times too large and averaged: without a display's font hinting, and
# at fractions of a pixel, so that small text is evenly spaced.
OVERSAMPLED = 8
# pygame's own font is given a size that is scaled by this to get at the em.
FONT_SCALE = 0.6875
# Number of texts and of glyphs that are kept: most of them stand there for a whole run.
KEPT = 5000
GREETING = "PYGAME_HIDE_SUPPORT_PROMPT"

_font_lock = threading.Lock()


@lru_cache(maxsize=1)
def load() -> Any:
    """Return the module pygame, imported without the greeting that it prints."""
    silent_before = GREETING in os.environ
    os.environ.setdefault(GREETING, "1")
    try:
        pygame = import_module("pygame")
        import_module("pygame.surfarray")
    finally:
        if not silent_before:
            os.environ.pop(GREETING, None)
    return pygame


def _thinned(mask: NDArray[np.float32], times: int) -> NDArray[np.float32]:
    """Return the mask with its strokes thinner by two large pixels each time."""
    for _ in range(times):
        wide = np.pad(mask, 1)
        rows = np.minimum(np.minimum(wide[:-2], wide[1:-1]), wide[2:])
        mask = np.minimum(np.minimum(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:])
    return mask


@lru_cache(maxsize=KEPT)
def _glyph(char: str, em: int, bold: bool) -> tuple[NDArray[np.float32], float]:
    """Return the coverage (w, h) of a glyph, oversampled, and its advance [pixels]."""
    pygame = load()
    with _font_lock:
        # idempotent, needs no display; the font is not kept, since others may quit the module
        pygame.font.init()
        font = pygame.font.Font(None, round(em * OVERSAMPLED / FONT_SCALE))
        char = char if char.isprintable() else " "
        drawn = font.render(char, True, (255, 255, 255))
        advance = font.size(char)[0] / OVERSAMPLED
    mask = pygame.surfarray.array_alpha(drawn).astype(np.float32)
    # pygame brings a bold font only; letters and digits can be made regular, thin signs not
    regular = not bold and (char.isalpha() or char.isdecimal())
    return _thinned(mask, max(1, OVERSAMPLED * em // 65) if regular else 0), advance


class Lettering(NamedTuple):
    """Text of one size, weight and colour.

    em: size [pixels]; bold: heavy strokes. What was drawn is kept, so that text is cheap to redraw.
    """

    em: int
    color: Rgb
    bold: bool = False

    def width(self, text: str) -> float:
        """Return the width of the text [pixels]."""
        return _width(text, self.em, self.bold)

    def fitted(self, text: str, room: float) -> str:
        """Return the text, cut off with an ellipsis if it is wider than `room` [pixels]."""
        if self.width(text) <= room:
            return text
        while text and self.width(text + "…") > room:
            text = text[:-1]
        return text.rstrip() + "…" if text else ""

    def draw(self, surface: "Surface", text: str, x: float, y: float, align: float = 0.0) -> float:
        """Draw at x (left end for align 0, middle for 0.5, right end for 1) and the top y.

        Returns the x [pixels] at which the text ends.
        """
        pen = x - align * self.width(text)
        start, top = math.floor(pen), round(y)
        line = _line(text, pen - start, self)
        surface.fblits([(glyph, (start + offset, top)) for glyph, offset in line])
        return pen + self.width(text)


@lru_cache(maxsize=KEPT)
def _width(text: str, em: int, bold: bool) -> float:
    return sum(_glyph(char, em, bold)[1] for char in text)


@lru_cache(maxsize=KEPT)
def _line(text: str, pen: float, style: Lettering) -> "list[tuple[Surface, int]]":
    """Return the glyphs of a text that begins at a part of a pixel, and their places."""
    placed = []
    for char in text:
        whole, part = divmod(round(pen * OVERSAMPLED), OVERSAMPLED)
        placed.append((_glyph_sprite(char, part, style), whole))
        pen += _glyph(char, style.em, style.bold)[1]
    return placed


@lru_cache(maxsize=KEPT)
def _glyph_sprite(char: str, part: int, style: Lettering) -> "Surface":
    """Return a glyph that begins so many large pixels after a whole one."""
    mask, _ = _glyph(char, style.em, style.bold)
    width = -(-(mask.shape[0] + part) // OVERSAMPLED)
    height = -(-mask.shape[1] // OVERSAMPLED)
    shifted = np.zeros((width * OVERSAMPLED, height * OVERSAMPLED), np.float32)
    shifted[part : part + mask.shape[0], : mask.shape[1]] = mask
    alpha = shifted.reshape(width, OVERSAMPLED, height, OVERSAMPLED).mean(axis=(1, 3))
    return sprite(np.broadcast_to(style.color, (width, height, 3)), alpha)


def sprite(rgb: NDArray[Any], alpha: NDArray[Any]) -> "Surface":
    """Return a surface with (w, h, 3) colours and (w, h) coverage, both in [0, 255]."""
    pygame = load()
    surface = pygame.Surface(alpha.shape, pygame.SRCALPHA, 32)
    pygame.surfarray.pixels3d(surface)[...] = np.asarray(rgb).round()
    pygame.surfarray.pixels_alpha(surface)[...] = np.asarray(alpha).round()
    return surface
