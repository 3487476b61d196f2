"""Which part of space is seen, and how large the picture is."""

import numpy as np
import pytest

from sph_gym import scenes
from sph_gym.view.layout import LINE, N_LINES, arrange, control_rows, view_bounds
from tests.view.conftest import user_scene


@pytest.mark.parametrize("name", scenes.names())
@pytest.mark.parametrize("width", [240, 320, 641, 1280])
def test_pictures_have_even_sizes_and_hold_the_whole_scene(name, width):
    scene = scenes.make(name)
    layout = arrange(scene, width)
    assert layout.size[0] == width + width % 2
    assert layout.size[1] % 2 == 0
    everything = np.asarray(scene.x)
    if scene.walls is not None and scene.walls.particles is not None:
        everything = np.concatenate([everything, scene.walls.particles])
    at = layout.pixels(everything)
    assert (at > 0).all()
    assert (at < layout.domain[2:]).all()


def test_one_metre_is_as_long_upwards_as_sideways():
    layout = arrange(scenes.make("dam_break"), (800, 600))
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


@pytest.mark.parametrize("width", [240, 320, 640, 1280])
def test_lines_are_kept_free(width):
    layout = arrange(scenes.make("dam_break"), width)
    below = layout.footer
    n_rows = control_rows(below.width, layout.em) + N_LINES
    assert below.height >= n_rows * LINE * layout.em
    assert below.top + below.height == layout.size[1]
    assert layout.footer.left + layout.footer.width < layout.color_bar.left


@pytest.mark.parametrize("size", [100, (640,) * 3, (640, 60), "640", 640.0, (640.0, 480), None])
def test_sizes_that_make_no_picture(size):
    with pytest.raises(ValueError, match="size: expected"):
        arrange(scenes.make("dam_break"), size)
