"""The one display of a process: opened, resized, released."""

import os
import warnings
from typing import Any

from sph_gym.view.toolkit import load

# Drivers that SDL takes where there is no screen.
UNSEEN = ("dummy", "offscreen")
NO_SCREEN = "no screen to open a window on"
INSTEAD = "Painter, --video and render_mode='rgb_array' need none"


class Display:
    """The display of pygame, of which a process has one.

    `is_seen` is False where SDL found no screen by itself and nothing can be seen; a warning says
    so. Raises RuntimeError if the video driver that SDL_VIDEODRIVER names has no screen.
    """

    def __init__(self, size: tuple[int, int], caption: str) -> None:
        self.is_seen = True
        self.resize(size, caption)

    def resize(self, size: tuple[int, int], caption: str) -> None:
        """Open it, or give it another size [pixels] and caption."""
        pygame = load()
        try:
            pygame.display.init()
            pygame.display.set_mode(size)
        except pygame.error as error:
            pygame.display.quit()
            raise RuntimeError(f"{NO_SCREEN} ({error}): {INSTEAD}") from None
        pygame.display.set_caption(caption)
        chosen = os.environ.get("SDL_VIDEODRIVER", "")
        self.is_seen = bool(chosen) or pygame.display.get_driver() not in UNSEEN
        if not self.is_seen:
            warnings.warn(f"{NO_SCREEN}, nothing can be seen: {INSTEAD}", stacklevel=5)

    @property
    def surface(self) -> Any:
        """Surface of the display; None once that is gone."""
        return load().display.get_surface()

    def close(self) -> None:
        """Release the display."""
        load().display.quit()
