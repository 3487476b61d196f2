"""The panel of the controls: sliders for dt, stiffness and epsilon, with what is still stable."""

import math
from typing import TYPE_CHECKING, NamedTuple

from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls
from sph_gym.solver.stepping import COURANT
from sph_gym.view.colors import ARROW, EDGE, INK, MUTED, RULE
from sph_gym.view.layout import Area
from sph_gym.view.overlays import control_texts
from sph_gym.view.state import Shown
from sph_gym.view.toolkit import Lettering, load

if TYPE_CHECKING:
    from pygame import Surface

# Ends of the sliders, as multiples of the scene's nominal values, and of epsilon itself.
DT_SPAN, STIFFNESS_SPAN, XSPH_SPAN = (1 / 30, 6.0), (1 / 100, 20.0), (0.0, 1.5)
# Beyond it a particle overshoots the mean velocity of its neighbours.
XSPH_LIMIT = 1.0
# Places in a row [em]: its height, the text, and the track.
ROW, TRACK_TOP, KNOB = 3.3, 2.0, 0.42
# Height of a row without a track.
SHORT = 1.5
OFF = "off: the scene has no XSPH"


class Slider(NamedTuple):
    """One control. name: its field of `Controls`; low, high: the ends; log: of the scale."""

    name: str
    low: float
    high: float
    log: bool

    def share(self, value: float) -> float:
        """Return the place of a value on the track, 0 to 1."""
        if self.log:
            value = max(value, 1e-300)
            share = math.log(value / self.low) / math.log(self.high / self.low)
        else:
            share = (value - self.low) / (self.high - self.low)
        return min(max(share, 0.0), 1.0)

    def value(self, share: float) -> float:
        """Return the value at a place of the track; beyond its ends that of the end."""
        share = min(max(share, 0.0), 1.0)
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return self.low + share * (self.high - self.low)


def make_sliders(nominal: Controls) -> list[Slider]:
    """Return the sliders around the nominal controls of a scene."""
    spans = {"dt": DT_SPAN, "stiffness": STIFFNESS_SPAN}
    sliders = [
        Slider(name, low * getattr(nominal, name), high * getattr(nominal, name), True)
        for name, (low, high) in spans.items()
    ]
    return [*sliders, Slider("xsph", *XSPH_SPAN, False)]


def limits(sim: Simulation) -> dict[str, float]:
    """Return the largest stable value of each control while the others stay as they are.

    dt: `Simulation.stable_dt`; stiffness: at which the present dt is the Courant limit 0.4 h / c;
    xsph: 1, beyond which particles overshoot the mean velocity of their neighbours.
    """
    fluid, h = sim.scene.fluid, sim.scene.h
    return {
        "dt": sim.stable_dt(),
        "stiffness": fluid.stiffness(COURANT * h / sim.controls.dt),
        "xsph": XSPH_LIMIT,
    }


class ControlPanel:
    """Shows the controls, and changes them by the mouse where that is wanted.

    area: its place in the window [pixels]; em: size of the text [pixels].
    """

    def __init__(self, area: Area, em: int) -> None:
        self.area, self._em = area, em
        self._title, self._ink = Lettering(em, INK, bold=True), Lettering(em, INK)
        self._muted, self._alarm = Lettering(em, MUTED), Lettering(em, ARROW)
        self._sliders: list[Slider] = []
        self._held: Slider | None = None

    def press(self, pixel: tuple[int, int]) -> bool:
        """Take hold of the slider at a pixel; return whether there is one."""
        for k, slider in enumerate(self._sliders):
            left, top, width, _ = self._track(k)
            margin = round(0.7 * self._em)
            reach = Area(left - margin, top - margin, width + 2 * margin, 2 * margin + 1)
            if reach.holds(pixel):
                self._held = slider
                return True
        return False

    def release(self) -> None:
        """Let go of the slider."""
        self._held = None

    def drag(self, pixel: tuple[int, int], present: Controls) -> Controls | None:
        """Return the controls with the slider at a pixel, None if no slider is held."""
        if self._held is None:
            return None
        left, _, width, _ = self._track(0)
        value = self._held.value((pixel[0] - left) / width)
        return present._replace(**{self._held.name: value})

    def _track(self, k: int) -> Area:
        em, (left, top, width, _) = self._em, self.area
        y = top + round((2.2 + k * ROW + TRACK_TOP) * em)
        return Area(left + em, y, width - 2 * em, 1)

    def draw(self, surface: "Surface", state: Shown, steered: str) -> None:
        """Draw the controls of a state; those of a simulation as sliders with limits.

        steered: a few words about where the controls come from.
        """
        left, top, width, _ = self.area
        room = width - 2 * self._em
        y = top + 0.5 * self._em
        self._title.draw(surface, self._title.fitted(steered, room), left + self._em, y)
        if isinstance(state, Simulation):
            if not self._sliders:
                self._sliders = make_sliders(state.nominal_controls)
            stable = limits(state)
            for k, slider in enumerate(self._sliders):
                self._draw_slider(surface, k, slider, state, stable[slider.name])
        else:
            texts = control_texts(state.controls, state.scene, OFF)
            for k, (name, text) in enumerate(texts.items()):
                self._draw_text(surface, k * SHORT / ROW, name, text)

    def _draw_text(self, surface: "Surface", k: float, name: str, text: str) -> tuple[float, float]:
        left, top, _, _ = self.area
        y = top + (2.2 + k * ROW + 0.3) * self._em
        end = self._muted.draw(surface, name, left + self._em, y)
        return self._ink.draw(surface, text, end + 0.5 * self._em, y), y

    def _draw_slider(
        self, surface: "Surface", k: int, slider: Slider, sim: Simulation, limit: float
    ) -> None:
        pygame, em = load(), self._em
        value = getattr(sim.controls, slider.name)
        text = control_texts(sim.controls, sim.scene, OFF)[slider.name]
        end, y = self._draw_text(surface, k, slider.name, text)
        left, track, width, _ = self._track(k)
        pygame.draw.line(surface, EDGE, (left, track), (left + width, track), 2)
        if slider.name == "xsph" and not sim.scene.effects.xsph:
            return
        # what is beyond the limit is marked as such, in colour and by the words beside the number
        x = left + round(width * slider.share(limit))
        letters = self._alarm if value > limit * (1 + 1e-9) else self._muted
        if x < left + width:
            pygame.draw.line(surface, ARROW, (x, track), (left + width, track), 2)
        pygame.draw.line(surface, ARROW, (x, track - round(0.5 * em)), (x, track + em // 2), 2)
        end_of_stable = control_texts(Controls(limit, limit, limit), sim.scene)[slider.name]
        words = "beyond" if letters is self._alarm else "stable to"
        text = letters.fitted(f"{words} {end_of_stable}", left + width - end - em)
        letters.draw(surface, text, left + width, y, align=1.0)
        knob = left + width * slider.share(value)
        pygame.draw.circle(surface, INK, (knob, track + 1), round(KNOB * em))
        pygame.draw.circle(surface, RULE, (knob, track + 1), max(round(KNOB * em) - 3, 1))
