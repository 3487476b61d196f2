"""`Window`: a simulation or a recording on the screen; to steer, to go back, to look closer."""

import gc
import weakref
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from sph_gym.files import atomic_write
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.view import colors
from sph_gym.view.desk import furnish
from sph_gym.view.display import Display
from sph_gym.view.film import Film, free_path
from sph_gym.view.frames import Painter, as_array
from sph_gym.view.history import History, Numbers, Steer, Substeps
from sph_gym.view.layout import View
from sph_gym.view.marks import draw_cells, draw_picked, particle_at
from sph_gym.view.playback import Source
from sph_gym.view.sliders import ControlPanel
from sph_gym.view.state import columns_of
from sph_gym.view.strips import Strips
from sph_gym.view.texts import Texts
from sph_gym.view.timeline import Timeline
from sph_gym.view.toolkit import load

if TYPE_CHECKING:
    from pygame.event import Event

# How long a paused window sleeps at most [ms], so that Ctrl-C in the terminal works.
NAP = 200
FASTEST = 60.0
# Pictures a second in a film.
FILM_FPS = 30.0
YOU = "you"


class Window:
    """Shows a scene in motion; `?` lists the keys.

    There are two ways to use it. A program that runs a simulation calls `show` after every frame,
    in real time or slower; one can go back in the picture, the simulation itself stays as it is.
    `play` is given a source of moments, a `History` or a `Recording`, and goes through it until the
    window is closed; there, the controls can be changed and handed over, and what is odd stops it.

    scene: what will be shown; size, color, arrows, bounds: as for `Painter`; controllers: by name,
    to which the controls can be handed over.

    pygame has one display a process: a new window closes the one before. Without SDL_VIDEODRIVER
    and without a screen, nothing can be seen, and a warning says so. Raises ValueError as `Painter`
    does, and RuntimeError if the video driver that SDL_VIDEODRIVER names has no screen.
    """

    _latest: "weakref.ref[Window] | None" = None

    def __init__(
        self,
        scene: Scene,
        size: int | tuple[int, int] = 960,
        color: str = "speed",
        arrows: bool = False,
        controllers: Mapping[str, Steer] | None = None,
        bounds: View | None = None,
    ) -> None:
        self._size = size
        self._controllers = dict(controllers or {})
        self.source: Source
        self.picked: int | None = None
        self.paused = False
        self._one_step = self._is_playing = self._backwards = self._closed = False
        self._cells, self._help, self._drag = False, False, ""
        self._notice, self._message, self._steered = "", "", YOU
        self._film: Film | None = None
        self._history: History | None = None
        self._words: tuple[tuple[str, ...], str] = (), ""
        self._numbers: Numbers = {}
        self._painter = Painter(scene, size, color, arrows, bounds)
        self._color_before = color
        before = Window._latest() if Window._latest is not None else None
        if before is not None:
            before.close()
        self._furnish()
        self._display = Display(self._desk.size, scene.name)
        Window._latest = weakref.ref(self)
        self._clock = load().time.Clock()
        self._actions = self._make_actions()

    @property
    def closed(self) -> bool:
        """True once the window is gone, by key, mouse or `close`, or with the display."""
        return self._closed or self._display.surface is None

    def show(
        self,
        sim: Simulation,
        lines: Sequence[str] = (),
        title: str = "",
        numbers: Numbers | None = None,
    ) -> None:
        """Paint the present state, react to the keys, and wait as long as the window is paused.

        lines, title: as for `Painter.paint`; numbers: to be drawn over time besides those of the
        simulation, by title, such as "reward" or "height [m]". A simulation of another scene is
        followed there. Whatever is looked at, the simulation is left as it came. Does nothing once
        the window is closed: ask `closed` whether to go on.
        """
        if self.closed:
            return
        if sim.scene is not self._painter.scene:
            self._follow(sim.scene)
        self._one_step = False
        self._words, self._numbers = (tuple(lines), title), numbers or {}
        if self._history is None or self._history.sim is not sim:
            self._history = History(sim, more=lambda: self._numbers)
        else:
            self._history.follow()
        self.source, history = self._history, self._history
        self._shoot()
        self._redraw()
        # one by one: every S that was pressed is a step of its own
        while not self._one_step and (event := self._next_event()):
            self._react(event)
        while self.paused and not self._one_step and not self.closed:
            self._react(load().event.wait(NAP))
        self._close_substeps()
        history.go(history.n - 1)
        if not self.closed:
            self._clock.tick(min(1.0 / sim.scene.frame, FASTEST))

    def play(self, source: Source, message: str = "", steered: str = "") -> None:
        """Go through a source until the window is closed.

        message: shown at the start; steered: name of the controller that begins, by default you.
        Where nothing can be seen it ends with the source.
        """
        self.source, self._is_playing = source, True
        self._message = self._message or message
        self._history = source if isinstance(source, History) else None
        if steered and self._history is not None:
            self._steered, self._history.steer = steered, self._controllers[steered]
        self._shoot()
        self._redraw()
        # the collector would look at all that numba has loaded, a tenth of a second every so often
        gc.freeze()
        try:
            self._play()
        finally:
            gc.unfreeze()
            self._is_playing = False

    def _play(self) -> None:
        # where nothing can be seen, there is nothing to wait for
        while not (self.closed or (self.paused and not self._display.is_seen)):
            while event := self._next_event():
                self._react(event)
            if self.closed:
                break
            if self.paused or self._drag == "timeline":
                self._react(load().event.wait(NAP))
                continue
            self._go_on()
            self._redraw()
            self._clock.tick(min(1.0 / self.source.state.scene.frame, FASTEST))

    def close(self) -> None:
        """Close the window and release the display; more than once does no harm."""
        self._end_film()
        if not self.closed:
            self._display.close()
        self._closed = True

    # --- the screen -------------------------------------------------------------------------

    def _furnish(self) -> None:
        em = self._painter.layout.em
        self._desk = desk = furnish(self._painter.size, em)
        self._sliders, self._texts = ControlPanel(desk.controls, em), Texts(em)
        self._strips, self._timeline = Strips(desk.strips, em), Timeline(desk.timeline, em)

    def _follow(self, scene: Scene) -> None:
        old = self._painter
        self._painter = Painter(scene, self._size, old.color, old.arrows)
        self._painter.velocities, self.picked = old.velocities, None
        self._end_film()
        self._furnish()
        self._display.resize(self._desk.size, scene.name)

    def _picture(self) -> Any:
        """Return the painter's surface with the present state and the marks on it."""
        state, (lines, title) = self.source.state, self._words
        surface = self._painter.draw(state, title, lines)
        if self._cells:
            words = draw_cells(surface, self._painter.layout, state)
            self._notice = self._notice or words
        if self.picked is not None:
            draw_picked(surface, self._painter.layout, state, self.picked)
        return surface

    def _redraw(self) -> None:
        screen, desk, source = self._display.surface, self._desk, self.source
        if screen is None:
            return
        picture = self._picture()
        screen.fill(colors.PAGE)
        screen.blit(picture, (0, 0))
        self._sliders.draw(screen, source.state, self._steering())
        self._texts.draw_particle(screen, desk.particle, source.state, self.picked)
        self._strips.draw(screen, source)
        self._timeline.draw(screen, source, self._doing())
        self._texts.draw_line(screen, desk.help, self._notice, self.paused)
        if self._message:
            domain = self._painter.layout.domain
            self._texts.draw_message(screen, domain, self._message, self._is_low(self.picked))
        if self._help:
            self._texts.draw_help(screen)
        load().display.flip()

    def _is_low(self, i: int | None) -> bool:
        """Return whether particle i is in the lower half of the picture."""
        if i is None:
            return False
        view, y = self._painter.layout.view, float(self.source.state.x[i, 1])
        return y < (view.y_min + view.y_max) / 2

    def _doing(self) -> str:
        doing = "paused" if self.paused else "running"
        return f"{doing}, recording" if self._film is not None else doing

    def _steering(self) -> str:
        if self._history is None:
            return "controls as recorded"
        if not self._is_playing:
            return "controls of the program"
        if isinstance(self.source, Substeps):
            return "controls as they were"
        return f"controls set by {self._steered}"

    def _shoot(self) -> None:
        """Append the present picture to the film, if there is one."""
        if self._film is None:
            return
        self._film.add(as_array(self._picture()))

    # --- time -------------------------------------------------------------------------------

    def _go_on(self) -> None:
        """Go to the next moment, and stop at what is odd and at the end."""
        source = self.source
        if not source.forward():
            self.paused = True
            back = ": L goes back to the run" if isinstance(source, Substeps) else ""
            self._notice = f"this is the last {source.unit}{back}"
            return
        self._shoot()
        seen = self._display.is_seen
        if isinstance(source, History) and source.trouble is not None and seen:
            trouble, source.trouble = source.trouble, None
            self.paused, self._message = True, trouble.message
            self.picked = trouble.particle if trouble.particle >= 0 else None
            self._open_substeps()

    def _toggle_pause(self) -> None:
        self.paused = not self.paused

    def _step(self) -> None:
        # a single step of what runs means: stop after it
        self.paused = True
        if self._is_playing or self.source.at < self.source.n - 1:
            self._go_on()
        else:
            self._one_step = True

    def _step_back(self) -> None:
        self._go(self.source.at - 1)

    def _go(self, k: int) -> None:
        self.paused = True
        self.source.go(k)

    def _toggle_substeps(self) -> None:
        if isinstance(self.source, Substeps):
            self._close_substeps()
        elif self._history is not None:
            self.paused = True
            self._open_substeps()
        else:
            self._notice = "a recording has no more than what was recorded"

    def _open_substeps(self) -> None:
        if self._history is not None:
            self.source = self._history.last_substeps()
            self._notice = f"the last {self.source.n - 1} substeps: L goes back to the run"

    def _close_substeps(self) -> None:
        if isinstance(self.source, Substeps) and self._history is not None:
            self.source.close()
            self.source = self._history

    # --- the mouse --------------------------------------------------------------------------

    def _press(self, pixel: tuple[int, int]) -> None:
        if self._help or self._message:
            self._help, self._message = False, ""
        if self._desk.timeline.holds(pixel):
            self._drag = "timeline"
        elif self._can_steer and self._sliders.press(pixel):
            self._drag = "slider"
        elif self._painter.layout.domain.holds(pixel):
            self.picked = particle_at(self.source.state, self._painter.layout, pixel)
        self._move(pixel)

    def _move(self, pixel: tuple[int, int]) -> None:
        if self._drag == "timeline":
            self._go(self._timeline.moment(pixel, self.source.n))
        elif self._drag == "slider" and self._history is not None:
            controls = self._sliders.drag(pixel, self._history.sim.controls)
            if controls is not None:
                self._steered, self._history.steer = YOU, None
                self._history.set_controls(controls)

    def _release(self) -> None:
        self._drag = ""
        self._sliders.release()

    @property
    def _can_steer(self) -> bool:
        return self._is_playing and self._history is not None and self.source is self._history

    # --- the keys ---------------------------------------------------------------------------

    def _make_actions(self) -> dict[int, Callable[[], None]]:
        pygame = load()
        return {
            pygame.K_SPACE: self._toggle_pause,
            pygame.K_s: self._step,
            pygame.K_RIGHT: self._step,
            pygame.K_LEFT: self._step_back,
            pygame.K_HOME: lambda: self._go(0),
            pygame.K_END: lambda: self._go(self.source.n - 1),
            pygame.K_l: self._toggle_substeps,
            pygame.K_c: self._next_color,
            pygame.K_n: self._toggle_neighbors,
            pygame.K_f: self._toggle_arrows,
            pygame.K_v: self._toggle_velocities,
            pygame.K_g: self._toggle_cells,
            pygame.K_h: self._hand_over,
            pygame.K_p: self._save,
            pygame.K_r: self._toggle_film,
            pygame.K_F1: self._toggle_help,
            pygame.K_QUESTION: self._toggle_help,
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
        elif event.type == pygame.KEYDOWN:
            self._press_key(event)
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == 1:
            self._notice = ""
            self._press(event.pos)
        elif event.type == pygame.MOUSEMOTION and self._drag:
            self._move(event.pos)
        elif event.type == pygame.MOUSEBUTTONUP:
            self._release()
        elif event.type != pygame.WINDOWEXPOSED:
            return
        if not self.closed:
            self._redraw()

    def _press_key(self, event: "Event") -> None:
        # on many keyboards ? is another key with shift
        key = load().K_QUESTION if getattr(event, "unicode", "") == "?" else event.key
        action = self._actions.get(key)
        if action is None:
            return
        self._notice = self._message = ""
        self._backwards = bool(getattr(event, "mod", 0) & load().KMOD_SHIFT)
        self._help = self._help and key in (load().K_QUESTION, load().K_F1)
        action()

    def _toggle_help(self) -> None:
        self._help = not self._help

    def _next_color(self) -> None:
        names = colors.available(self.source.state)
        present = self._painter.color
        step = -1 if self._backwards else 1
        after = names.index(present) + step if present in names else 0
        self._painter.color = names[after % len(names)]

    def _toggle_neighbors(self) -> None:
        present = self._painter.color
        self._painter.color = self._color_before if present == "neighbors" else "neighbors"
        self._color_before = "speed" if present == "neighbors" else present

    def _toggle_arrows(self) -> None:
        self._painter.arrows = not self._painter.arrows
        if self._painter.arrows and "a" not in columns_of(self.source.state):
            self._notice = "the recording has no accelerations, so there are no forces to draw"

    def _toggle_velocities(self) -> None:
        self._painter.velocities = not self._painter.velocities

    def _toggle_cells(self) -> None:
        self._cells = not self._cells

    def _hand_over(self) -> None:
        if not self._can_steer or self._history is None:
            self._notice = "here the controls can't be handed over"
            return
        names = [YOU, *self._controllers]
        self._steered = names[(names.index(self._steered) + 1) % len(names)]
        self._history.steer = self._controllers.get(self._steered)
        self._notice = f"from the next frame on, {self._steered} set" + (
            " the controls" if self._steered == YOU else "s the controls"
        )

    def _save(self) -> None:
        """Save the picture under the scene's name and time; a failure must not end the run."""
        pygame, path = load(), free_path(self._stem(), ".png")
        try:
            with atomic_write(path) as draft:
                pygame.image.save(self._picture(), str(draft))
        except (OSError, pygame.error) as error:
            self._notice = f"not saved: {error}"
        else:
            self._notice = f"saved {path}"

    def _stem(self) -> str:
        state = self.source.state
        return f"{state.scene.name}_{state.time:.3f}s"

    def _toggle_film(self) -> None:
        if self._film is not None:
            self._end_film()
            return
        self._film = Film(free_path(self._stem(), ".mp4"), FILM_FPS)
        self._shoot()
        self._notice = f"recording {self._film.path}: R ends it"

    def _end_film(self) -> None:
        if self._film is not None:
            film, self._film = self._film, None
            self._notice = film.close()
