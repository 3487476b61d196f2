import pygame
import pytest

from sph_gym import Controls
from sph_gym.view.layout import Area
from sph_gym.view.sliders import XSPH_LIMIT, ControlPanel, limits, make_sliders
from sph_gym.view.state import Still

NOMINAL = Controls(1e-3, 2e5, 0.3)


def test_a_slider_finds_its_values_again_and_stops_at_its_ends():
    for slider in make_sliders(NOMINAL):
        for share in (0.0, 0.3, 1.0):
            assert slider.share(slider.value(share)) == pytest.approx(share)
        assert slider.value(-1.0) == pytest.approx(slider.low)
        assert slider.value(2.0) == pytest.approx(slider.high)
        assert slider.share(0.0) == 0.0
        assert slider.low < getattr(NOMINAL, slider.name) < slider.high


def test_limits_are_where_the_step_is_stable(late):
    found = limits(late)
    assert found["dt"] == late.stable_dt()
    assert found["xsph"] == XSPH_LIMIT
    c = late.scene.fluid.sound_speed(found["stiffness"])
    assert late.controls.dt == pytest.approx(0.4 * late.scene.h / c)


def test_a_slider_follows_the_mouse(late):
    panel, surface = ControlPanel(Area(0, 0, 300, 200), 12), pygame.Surface((300, 200))
    assert panel.drag((0, 0), late.controls) is None
    panel.draw(surface, late, "controls")
    left, top, width, _ = panel._track(2)
    assert not panel.press((left, top - 30))
    assert panel.press((left + 5, top))
    assert panel.drag((left + width, top), late.controls).xsph == pytest.approx(1.5)
    assert panel.drag((left, top + 90), late.controls) == late.controls._replace(xsph=0.0)
    panel.release()
    assert panel.drag((left, top), late.controls) is None


def test_what_is_beyond_the_limit_is_drawn_in_another_way(late):
    panel, pictures = ControlPanel(Area(0, 0, 300, 200), 12), []
    before = late.snapshot()
    for dt in (0.5, 1.0, 3.0):
        late.controls = late.controls._replace(dt=dt * before["controls"][0])
        surface = pygame.Surface((300, 200))
        panel.draw(surface, late, "controls")
        pictures.append(pygame.image.tobytes(surface, "RGB"))
    late.restore(before)
    assert len(set(pictures)) == 3


def test_a_recording_has_texts_and_no_sliders(late):
    columns = {"x": late.x, "v": late.v}
    state = Still(late.scene, 0.0, columns, late.n_fluid, Controls(1e-3, float("nan"), 0.3))
    panel, surface = ControlPanel(Area(0, 0, 300, 200), 12), pygame.Surface((300, 200))
    panel.draw(surface, state, "controls as recorded")
    assert not any(panel.press((x, y)) for x in range(0, 300, 7) for y in range(0, 200, 3))
    assert pygame.transform.average_color(surface) != (0, 0, 0, 0)
