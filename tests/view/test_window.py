"""The window under SDL's dummy driver: what its keys do."""

import os

import numpy as np
import pygame
import pytest

from sph_gym import Simulation, scenes
from sph_gym.view import Window
from sph_gym.view.colors import QUANTITIES
from sph_gym.view.display import UNSEEN


@pytest.fixture
def open_window(monkeypatch, late, tmp_path):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.chdir(tmp_path)
    windows = []

    def opened(scene=late.scene, **arguments):
        windows.append(Window(scene, **{"size": 480, **arguments}))
        pygame.event.clear()
        return windows[-1]

    yield opened
    for window in windows:
        window.close()


def press(*keys):
    for key in keys:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key))


def screen():
    return pygame.surfarray.array3d(pygame.display.get_surface())


def test_show_puts_the_picture_and_the_keys_on_the_screen(open_window, early, late):
    window = open_window()
    window.show(late, lines=["step 1"])
    first = screen()
    assert first.any()
    window.show(early)
    assert (screen() != first).any()
    assert not window.closed
    assert not window.paused


def test_space_pauses_and_steps_go_on_one_by_one(open_window, late):
    window = open_window()
    press(pygame.K_SPACE, pygame.K_s, pygame.K_RIGHT, pygame.K_SPACE)
    window.show(late)
    assert window.paused
    window.show(late)
    assert window.paused
    window.show(late)
    assert not window.paused


def test_a_step_stops_a_run(open_window, late):
    window = open_window()
    press(pygame.K_s)
    window.show(late)
    assert window.paused


def test_a_pause_blocks_until_a_key_comes(open_window, late, monkeypatch):
    window = open_window()
    naps = []

    def wait(milliseconds):
        naps.append(milliseconds)
        if len(naps) == 3:
            press(pygame.K_SPACE)
        return pygame.event.poll()

    monkeypatch.setattr(pygame.event, "wait", wait)
    press(pygame.K_SPACE)
    window.show(late)
    assert len(naps) == 3
    assert min(naps) >= 50


def test_keys_change_what_is_seen(open_window, late):
    window = open_window()
    window.show(late)
    views = [screen()]
    for key in (pygame.K_c, pygame.K_c, pygame.K_n, pygame.K_f):
        press(key)
        window.show(late)
        assert all((screen() != view).any() for view in views)
        views.append(screen())
    press(pygame.K_f, pygame.K_n)
    window.show(late)
    np.testing.assert_array_equal(screen(), views[2])


def test_all_colors_come_round(open_window, late):
    window = open_window()
    window.show(late)
    first = screen()
    press(*[pygame.K_c] * len(QUANTITIES))
    window.show(late)
    np.testing.assert_array_equal(screen(), first)
    press(pygame.K_c)
    window.show(late)
    assert (screen() != first).any()
    pygame.event.post(
        pygame.event.Event(pygame.KEYDOWN, key=pygame.K_c, mod=pygame.KMOD_LSHIFT, unicode="C")
    )
    window.show(late)
    np.testing.assert_array_equal(screen(), first)


def test_pictures_are_saved_without_replacing_older_ones(open_window, late, tmp_path):
    window = open_window()
    press(pygame.K_p, pygame.K_p)
    window.show(late)
    saved = sorted(path.name for path in tmp_path.glob("*.png"))
    assert saved == ["dam_break_0.300s-2.png", "dam_break_0.300s.png"]
    picture = pygame.image.load(tmp_path / saved[0])
    assert picture.get_width() == 480


def test_a_picture_that_cannot_be_saved_does_not_end_the_run(open_window, late, monkeypatch):
    def full(*arguments):
        raise OSError("disk full")

    monkeypatch.setattr(pygame.image, "save", full)
    window = open_window()
    window.show(late)
    before = screen()
    press(pygame.K_p)
    window.show(late)
    assert not window.closed
    assert (screen() != before).any()


@pytest.mark.parametrize("key", [pygame.K_q, pygame.K_ESCAPE, None])
def test_closing_releases_the_display_and_show_does_nothing_more(open_window, late, key):
    window = open_window()
    if key is None:
        pygame.event.post(pygame.event.Event(pygame.QUIT))
    else:
        press(pygame.K_SPACE, key)
    window.show(late)
    assert window.closed
    assert not pygame.display.get_init()
    window.show(late)
    window.close()
    assert not pygame.display.get_init()


def test_a_new_window_closes_the_one_before(open_window, late):
    first = open_window()
    second = open_window()
    assert first.closed
    first.close()
    second.show(late)
    assert not second.closed


def test_a_display_that_others_shut_down_is_closed(open_window, late):
    window = open_window()
    pygame.quit()
    assert window.closed
    window.show(late)


def test_another_scene_is_followed(open_window, late):
    window = open_window()
    window.show(late)
    before = pygame.display.get_surface().get_size()
    window.show(Simulation(scenes.make("relaxation", dx=0.05)))
    assert pygame.display.get_surface().get_size() != before


def test_without_a_screen_the_error_says_so(monkeypatch, late):
    monkeypatch.setenv("SDL_VIDEODRIVER", "nonsense")
    with pytest.raises(RuntimeError, match="no screen"):
        Window(late.scene)


@pytest.mark.parametrize("driver", UNSEEN)
def test_nothing_waits_for_a_window_that_cannot_be_seen(monkeypatch, late, driver):
    monkeypatch.setattr(pygame.display, "get_driver", lambda: driver)
    monkeypatch.setattr(pygame.display, "init", as_in_a_void(pygame.display.init))
    with pytest.warns(UserWarning, match="no screen to open a window on, nothing can be seen"):
        window = Window(late.scene, size=480)
    window.show(late)
    assert not window.closed
    window.close()


def as_in_a_void(init):
    """Return an `init` that takes the dummy driver, without the variable that chooses it."""

    def changed():
        os.environ["SDL_VIDEODRIVER"] = "dummy"
        init()
        del os.environ["SDL_VIDEODRIVER"]

    return changed
