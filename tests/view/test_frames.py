"""Pictures as arrays: what they show, that they repeat, and that they need nothing."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from zlib import crc32

import numpy as np
import pygame
import pytest

from sph_gym import Simulation, scenes
from sph_gym.solver.warnings import Warning
from sph_gym.view import Painter, colors
from sph_gym.view.overlays import TIMES, arrow_carriers, arrow_unit, significant, with_unit
from sph_gym.view.particles import Discs
from sph_gym.view.toolkit import Lettering
from tests.view.conftest import user_scene


def domain(painter, picture):
    left, top, width, height = painter.layout.domain
    return picture[top : top + height, left : left + width]


@pytest.mark.parametrize("size", [320, 640, (500, 401)])
def test_a_picture_is_an_array_of_bytes_of_the_wanted_size(size, late):
    painter = Painter(late.scene, size)
    picture = painter.paint(late)
    width, height = painter.size
    assert picture.shape == (height, width, 3)
    assert picture.dtype == np.uint8
    assert width % 2 == height % 2 == 0
    assert picture.flags.c_contiguous
    assert picture.flags.writeable


def test_two_pictures_of_one_state_are_equal_and_share_no_memory(late):
    painter = Painter(late.scene)
    first, second = painter.paint(late, lines=["a"]), painter.paint(late, lines=["a"])
    np.testing.assert_array_equal(first, second)
    assert not np.shares_memory(first, second)
    np.testing.assert_array_equal(first, Painter(late.scene).paint(late, lines=["a"]))


@pytest.mark.parametrize("color", list(colors.QUANTITIES))
@pytest.mark.parametrize("arrows", [False, True])
def test_pictures_follow_the_state(color, arrows, early, late):
    painter = Painter(early.scene, color=color, arrows=arrows)
    before, after = (domain(painter, painter.paint(sim)) for sim in (early, late))
    assert (before != after).any()


def test_a_particle_is_drawn_where_it_is_in_its_color():
    scene = user_scene(x=[(0.0, 0.0), (0.5, 0.0), (0.5, 0.25)])
    painter = Painter(scene)
    picture = domain(painter, painter.paint(Simulation(scene)))
    for column, row in painter.layout.pixels(scene.x).round().astype(int):
        np.testing.assert_array_equal(picture[row, column], colors.VIRIDIS[0])
    np.testing.assert_array_equal(picture[2, 2], colors.DOMAIN)


def test_speed_keeps_its_range_over_a_run(early, late):
    painter = Painter(early.scene)
    bar = painter.layout.color_bar
    first, second = (painter.paint(sim)[bar.top :, bar.left :] for sim in (early, late))
    np.testing.assert_array_equal(first, second)


def test_text_shows_the_controls_the_title_and_the_lines():
    sim = Simulation(scenes.make("dam_break", dx=0.05))
    painter = Painter(sim.scene)
    pictures = [painter.paint(sim), painter.paint(sim, title="T"), painter.paint(sim, lines=["a"])]
    sim.controls = sim.controls._replace(dt=sim.controls.dt / 2)
    pictures.append(painter.paint(sim))
    for k, picture in enumerate(pictures):
        for other in pictures[:k]:
            assert (picture != other).any()
            np.testing.assert_array_equal(domain(painter, picture), domain(painter, other))


def test_color_and_arrows_can_be_changed(late):
    painter = Painter(late.scene)
    plain = painter.paint(late)
    painter.arrows = True
    assert (painter.paint(late) != plain).any()
    painter.arrows, painter.color = False, "pressure"
    assert (painter.paint(late) != plain).any()
    painter.color = "speed"
    np.testing.assert_array_equal(painter.paint(late), plain)


def test_no_display_is_touched_and_none_is_missed(late):
    pygame.quit()
    painter = Painter(late.scene)
    picture = painter.paint(late)
    assert not pygame.display.get_init()
    # others in the process may come and go
    pygame.display.init()
    pygame.quit()
    np.testing.assert_array_equal(painter.paint(late, title="Zq"), painter.paint(late, title="Zq"))
    np.testing.assert_array_equal(painter.paint(late), picture)


def test_painters_in_two_threads_do_not_disturb_each_other(late):
    expected = [Painter(late.scene, width).paint(late) for width in (400, 500)]

    def paint(width):
        return [Painter(late.scene, width).paint(late) for _ in range(5)]

    with ThreadPoolExecutor(2) as pool:
        for wanted, pictures in zip(expected, pool.map(paint, (400, 500)), strict=True):
            for picture in pictures:
                np.testing.assert_array_equal(picture, wanted)


def test_another_process_paints_the_same_quietly_and_imports_little():
    script = (
        "import sys, zlib\n"
        "import sph_gym.view as view\n"
        "assert not {'pygame', 'imageio', 'matplotlib'} & set(sys.modules)\n"
        "from sph_gym import Simulation, scenes\n"
        "sim = Simulation(scenes.make('dam_break', dx=0.05))\n"
        "print(zlib.crc32(view.Painter(sim.scene).paint(sim)))\n"
    )
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    sim = Simulation(scenes.make("dam_break", dx=0.05))
    assert said.stdout.strip() == str(crc32(Painter(sim.scene).paint(sim)))


def test_what_is_no_number_is_left_out_or_marked():
    surface = pygame.Surface((40, 40), 0, 32)
    discs = Discs([(255, 0, 0)], 6.0)
    nowhere = np.array([[np.nan, 5.0], [np.inf, 5.0], [-1e300, 5.0], [500.0, 5.0]])
    discs.draw(surface, nowhere, np.zeros(4, int))
    assert not pygame.surfarray.array3d(surface).any()
    discs.draw(surface, np.array([[20.0, 10.0]]), np.zeros(1, int))
    assert tuple(surface.get_at((20, 10)))[:3] == (255, 0, 0)


@pytest.mark.parametrize("diameter", [2.0, 3.3, 9.0, 40.0])
def test_discs_have_their_area_and_their_centre(diameter):
    surface = pygame.Surface((100, 100), 0, 32)
    Discs([(200, 0, 0)], diameter, rim=False).draw(
        surface, np.array([[50.25, 40.5]]), np.array([0])
    )
    weight = pygame.surfarray.array3d(surface)[:, :, 0] / 200
    assert weight.sum() == pytest.approx(np.pi * diameter**2 / 4, rel=0.1)
    centre = np.array([weight.sum(1), weight.sum(0)]) @ (np.arange(100) + 0.5) / weight.sum()
    # large discs stand on whole pixels
    np.testing.assert_allclose(centre, [50.25, 40.5], atol=0.3 if diameter < 24 else 0.6)


@pytest.mark.parametrize(
    ("dt", "text"),
    [
        (4.672e-4, "467 µs"),
        (9.999e-4, "1.00 ms"),
        (2.5e-3, "2.50 ms"),
        (3e-6, "3.00 µs"),
        (2, "2.00 s"),
    ],
)
def test_time_steps_have_a_unit_that_suits_them(dt, text):
    assert with_unit(dt, TIMES) == text


def test_numbers_keep_their_significant_digits():
    told = [significant(value) for value in (0, 44.294, 9.999, 1234.0, 1e9, 1e-9, float("inf"))]
    assert told == ["0", "44.3", "10.0", "1234", "1.00e+09", "1.00e-09", "inf"]


def test_arrows_have_a_round_unit_that_gravity_holds_up():
    at_rest = np.zeros((10, 2))
    assert arrow_unit(scenes.make("dam_break"), at_rest) == 10.0
    assert arrow_unit(user_scene(), at_rest) == 0.01
    assert arrow_unit(user_scene(), np.full((10, 2), np.nan)) == 0.01
    assert arrow_unit(user_scene(), at_rest + np.array([0.0, -30.0])) == 50.0


def test_arrows_are_few_and_evenly_strewn():
    np.testing.assert_array_equal(arrow_carriers(7), np.arange(7))
    chosen = arrow_carriers(10_000)
    assert np.diff(chosen).min() > 0
    assert np.diff(chosen).max() < 150
    assert chosen[-1] < 10_000


def test_text_that_is_too_long_ends_in_dots_and_odd_signs_do_no_harm():
    letters = Lettering(12, (0, 0, 0))
    short = letters.fitted("instance dam_break/train/17", 80)
    assert short.endswith("…")
    assert letters.width(short) <= 80
    assert letters.fitted("abc", 0) == ""
    letters.draw(pygame.Surface((50, 50)), "a\nb\0\u0301\u200b\U0001f600", 0, 0)


def test_wrong_arguments_are_named(late):
    with pytest.raises(ValueError, match="scene: expected a Scene"):
        Painter("dam_break")
    with pytest.raises(ValueError, match="color: expected one of speed"):
        Painter(late.scene, color="red")
    painter = Painter(late.scene)
    with pytest.raises(ValueError, match=r"lines: expected at most 2, got 3"):
        painter.paint(late, lines=["a", "b", "c"])


def test_a_warning_is_shown_in_the_corner(monkeypatch):
    sim = Simulation(scenes.make("dam_break", dx=0.05))
    painter = Painter(sim.scene)
    monkeypatch.setattr(Simulation, "warnings", ())
    calm = painter.paint(sim)
    told = Warning("energy", 0.39, 0.05, 0.1, "39 % of the energy at stake is spurious")
    monkeypatch.setattr(Simulation, "warnings", (told,) * 20)
    alarmed = painter.paint(sim)
    changed = np.argwhere((calm != alarmed).any(axis=2))
    left, top, width, _ = painter.layout.domain
    assert len(changed) > 100
    assert changed[:, 0].min() >= top
    assert changed[:, 0].max() <= top + 2 * painter.layout.em
    assert changed[:, 1].max() < left + width
