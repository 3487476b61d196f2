"""Which part of space is seen, and how large the picture is."""

import numpy as np
import pytest

from sph_gym import scenes
from sph_gym.view.layout import arrange, view_bounds
from tests.view.conftest import user_scene


@pytest.mark.parametrize("name", scenes.names())
@pytest.mark.parametrize("width", [240, 320, 641, 1280])
def test_pictures_have_even_sizes_and_hold_the_whole_scene(name, width):
    scene = scenes.make(name)
    layout = arrange(scene, width, n_lines=2)
    assert layout.size[0] == width + width % 2
    assert layout.size[1] % 2 == 0
    everything = np.asarray(scene.x)
    if scene.walls is not None and scene.walls.particles is not None:
        everything = np.concatenate([everything, scene.walls.particles])
    at = layout.pixels(everything)
    assert (at > 0).all()
    assert (at < layout.domain[2:]).all()


def test_one_metre_is_as_long_upwards_as_sideways():
    layout = arrange(scenes.make("dam_break"), (800, 600), n_lines=0)
    origin, right, up = layout.pixels(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    np.testing.assert_allclose(right - origin, [layout.scale, 0.0], atol=1e-9)
    np.testing.assert_allclose(up - origin, [0.0, -layout.scale], atol=1e-9)


def test_open_space_is_one_and_a_half_blobs_wide():
    scene = scenes.make("relaxation", dx=0.025, diameter=0.5)
    bounds = view_bounds(scene)
    extent = np.ptp(scene.x, axis=0) + scene.dx
    np.testing.assert_allclose([bounds.width, bounds.height], 1.5 * extent)


def test_a_box_without_wall_particles_is_seen_whole():
    bounds = view_bounds(user_scene(box=(-1.0, 2.0, -0.5, 1.0)))
    assert bounds.x_min < -1.0 < 2.0 < bounds.x_max
    assert bounds.y_min < -0.5 < 1.0 < bounds.y_max
    assert bounds.width < 3.5


def test_an_open_side_ends_where_the_particles_do():
    bounds = view_bounds(user_scene(box=(0.0, np.inf, 0.0, np.inf)))
    assert np.isfinite(bounds).all()
    assert bounds.height < 1.0


@pytest.mark.parametrize("n_lines", [0, 2, 7])
def test_lines_are_kept_free(n_lines):
    layout = arrange(scenes.make("dam_break"), 320, n_lines)
    assert layout.n_lines >= n_lines
    below = layout.footer
    assert below.top + below.height == layout.size[1]
    assert layout.footer.left + layout.footer.width < layout.color_bar.left


@pytest.mark.parametrize("size", [100, (640,) * 3, (640, 60), "640", 640.0, (640.0, 480), None])
def test_sizes_that_make_no_picture(size):
    with pytest.raises(ValueError, match="size: expected"):
        arrange(scenes.make("dam_break"), size, n_lines=2)


@pytest.mark.parametrize("n_lines", [-1, 1.5])
def test_numbers_of_lines_that_make_no_sense(n_lines):
    with pytest.raises(ValueError, match="n_lines: expected"):
        arrange(scenes.make("dam_break"), 640, n_lines)
