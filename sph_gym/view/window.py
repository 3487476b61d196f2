"""`Window`: a running simulation on the screen, with keys to pause it and to look closer."""

import os
import warnings
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.view import colors
from sph_gym.view.frames import Painter
from sph_gym.view.toolkit import Lettering, load

if TYPE_CHECKING:
    from pygame.event import Event

HELP = (
    ("space", "pause"),
    ("S", "step"),
    ("C", "colour"),
    ("N", "neighbours"),
    ("F", "forces"),
    ("P", "picture"),
    ("Q", "quit"),
)
# How long a paused window sleeps at most [ms], so that Ctrl-C in the terminal works.
NAP = 200
FASTEST = 60.0
# Drivers that SDL takes where there is no screen.
UNSEEN = ("dummy", "offscreen")
NO_SCREEN = "no screen to open a window on"
INSTEAD = "Painter, --video and render_mode='rgb_array' need none"


class Window:
    """Shows a scene in motion: call `show` after every frame, in real time or slower.

    scene: what will be shown; size, color, arrows: as for `Painter`.

    Keys: space pauses and goes on, S or the right arrow goes one frame further, C takes the next
    quantity for the colours, N colours by neighbours and back, F draws the forces, P saves the
    picture as PNG in the working directory, Esc or Q closes.

    pygame has one display a process: a new window closes the one before. Without that variable and
    without a screen, nothing can be seen, and a warning says so. Raises ValueError as `Painter`
    does, and RuntimeError if the video driver that SDL_VIDEODRIVER names has no screen.
    """

    _latest: "weakref.ref[Window] | None" = None

    def __init__(
        self,
        scene: Scene,
        size: int | tuple[int, int] = 960,
        color: str = "speed",
        arrows: bool = False,
    ) -> None:
        self._size = size
        self.paused = False
        self._one_step = False
        self._notice = ""
        self._closed = False
        self._shown: tuple[Simulation, tuple[str, ...], str]
        self._painter = Painter(scene, size, color, arrows)
        self._color_before = color
        before = Window._latest() if Window._latest is not None else None
        if before is not None:
            before.close()
        self._open()
        load().display.set_caption(scene.name)
        Window._latest = weakref.ref(self)
        self._clock = load().time.Clock()
        self._actions = self._make_actions()

    @property
    def closed(self) -> bool:
        """True once the window is gone, by key, mouse or `close`, or with the display."""
        return self._closed or load().display.get_surface() is None

    def show(self, sim: Simulation, lines: Sequence[str] = (), title: str = "") -> None:
        """Paint the present state, react to the keys, and wait as long as the window is paused.

        lines, title: as for `Painter.paint`. A simulation of another scene is followed there.
        Does nothing once the window is closed: ask `closed` whether to go on.
        """
        if self.closed:
            return
        if sim.scene is not self._painter.scene:
            self._follow(sim.scene)
        self._one_step = False
        self._shown = sim, tuple(lines), title
        self._redraw()
        # one by one: every S that was pressed is a step of its own
        while not self._one_step and (event := self._next_event()):
            self._react(event)
        while self.paused and not self._one_step and not self.closed:
            self._react(load().event.wait(NAP))
        if not self.closed:
            self._clock.tick(min(1.0 / sim.scene.frame, FASTEST))

    def wait_until_closed(self) -> None:
        """Leave the last picture on the screen, if there is one; keys that change it still work."""
        while not self.closed and self._on_screen:
            self._react(load().event.wait(NAP))

    def close(self) -> None:
        """Close the window and release the display; more than once does no harm."""
        if not self.closed:
            load().display.quit()
        self._closed = True

    # --- the screen -------------------------------------------------------------------------

    def _open(self) -> None:
        pygame = load()
        self._letters = Lettering(self._painter.layout.em, colors.MUTED)
        self._keys = Lettering(self._painter.layout.em, colors.INK, bold=True)
        width, height = self._painter.size
        try:
            pygame.display.init()
            pygame.display.set_mode((width, height + self._strip))
        except pygame.error as error:
            pygame.display.quit()
            raise RuntimeError(f"{NO_SCREEN} ({error}): {INSTEAD}") from None
        chosen = os.environ.get("SDL_VIDEODRIVER", "")
        self._on_screen = bool(chosen) or pygame.display.get_driver() not in UNSEEN
        if not self._on_screen:
            warnings.warn(f"{NO_SCREEN}, nothing can be seen: {INSTEAD}", stacklevel=4)

    @property
    def _strip(self) -> int:
        """Height [pixels] of the line of help below the picture."""
        return 2 * self._painter.layout.em

    def _follow(self, scene: Scene) -> None:
        old = self._painter
        self._painter = Painter(scene, self._size, old.color, old.arrows)
        if self._painter.size != old.size:
            self._open()
        load().display.set_caption(scene.name)

    def _redraw(self) -> None:
        pygame = load()
        sim, lines, title = self._shown
        screen = pygame.display.get_surface()
        if screen is None:
            return
        screen.blit(self._painter.draw(sim, title, lines), (0, 0))
        width, height = self._painter.size
        screen.fill(colors.RULE, pygame.Rect(0, height, width, self._strip))
        self._draw_help(screen, self._painter.layout.em, height + 0.4 * self._painter.layout.em)
        pygame.display.flip()

    def _draw_help(self, screen: Any, x: float, y: float) -> None:
        em, width = self._painter.layout.em, self._painter.size[0]
        if self._notice:
            self._letters.draw(screen, self._letters.fitted(self._notice, width - 2 * em), x, y)
            return
        for key, meaning in HELP:
            meaning = "run" if self.paused and meaning == "pause" else meaning
            if x + self._keys.width(key) + self._letters.width(meaning) + 2 * em > width:
                break
            x = self._keys.draw(screen, key, x, y) + 0.4 * em
            x = self._letters.draw(screen, meaning, x, y) + 1.2 * em

    # --- the keys ---------------------------------------------------------------------------

    def _make_actions(self) -> dict[int, Callable[[], None]]:
        pygame = load()
        return {
            pygame.K_SPACE: self._toggle_pause,
            pygame.K_s: self._step,
            pygame.K_RIGHT: self._step,
            pygame.K_c: self._next_color,
            pygame.K_n: self._toggle_neighbors,
            pygame.K_f: self._toggle_arrows,
            pygame.K_p: self._save,
            pygame.K_ESCAPE: self.close,
            pygame.K_q: self.close,
        }

    def _next_event(self) -> "Event | None":
        pygame = load()
        event = pygame.event.poll() if not self.closed else None
        return None if event is None or event.type == pygame.NOEVENT else event

    def _react(self, event: "Event") -> None:
        pygame = load()
        if self.closed:
            return
        if event.type == pygame.QUIT:
            self.close()
        elif event.type == pygame.KEYDOWN and event.key in self._actions:
            self._notice = ""
            self._actions[event.key]()
        elif event.type != pygame.WINDOWEXPOSED:
            return
        if not self.closed:
            self._redraw()

    def _toggle_pause(self) -> None:
        self.paused = not self.paused

    def _step(self) -> None:
        # a single step of what runs means: stop after it
        self.paused = self._one_step = True

    def _next_color(self) -> None:
        names = list(colors.QUANTITIES)
        after = names.index(self._painter.color) + 1
        self._painter.color = names[after % len(names)]

    def _toggle_neighbors(self) -> None:
        present = self._painter.color
        self._painter.color = self._color_before if present == "neighbors" else "neighbors"
        self._color_before = "speed" if present == "neighbors" else present

    def _toggle_arrows(self) -> None:
        self._painter.arrows = not self._painter.arrows

    def _save(self) -> None:
        """Save the picture under the scene's name and time; a failure must not end the run."""
        pygame = load()
        sim, lines, title = self._shown
        stem, number = f"{sim.scene.name}_{sim.time:.3f}s", 2
        path = Path(f"{stem}.png")
        while path.exists():
            path = Path(f"{stem}-{number}.png")
            number += 1
        try:
            pygame.image.save(self._painter.draw(sim, title, lines), str(path))
        except (OSError, pygame.error) as error:
            self._notice = f"not saved: {error}"
        else:
            self._notice = f"saved {path}"
