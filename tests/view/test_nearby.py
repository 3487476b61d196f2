import math

import numpy as np
import pytest

from sph_gym.view.nearby import nearest_images, neighbors_of, surroundings


def naive(x, n_fluid, h, periods=(math.inf, math.inf)):
    """Return counts and nearest distances, by all pairs."""
    way = x[:, None] - x
    for axis, period in enumerate(periods):
        if math.isfinite(period):
            way[..., axis] -= period * np.round(way[..., axis] / period)
    distance = np.hypot(way[..., 0], way[..., 1])
    np.fill_diagonal(distance, np.inf)
    near = np.where(distance < h, distance, np.inf)
    return np.isfinite(near).sum(axis=1)[:n_fluid], near[:n_fluid, :n_fluid].min(axis=1)


@pytest.mark.parametrize(
    "periods", [(math.inf, math.inf), (1.0, math.inf), (1.0, 1.0), (0.45, 1.0)]
)
@pytest.mark.parametrize("h", [0.05, 0.21])
def test_counts_and_distances_are_those_of_all_pairs(periods, h):
    x = np.random.default_rng(1).uniform(-0.5, 0.5, (150, 2))
    found = surroundings(x, 120, h, periods)
    counts, nearest = naive(x, 120, h, periods)
    np.testing.assert_array_equal(found.counts, counts)
    np.testing.assert_allclose(found.nearest, nearest)


def test_particles_without_a_place_are_nobodys_neighbours():
    x = np.array([[0.0, 0.0], [np.nan, 0.0], [0.1, 0.0], [0.0, np.inf], [9e9, 0.0]])
    found = surroundings(x, 5, 0.5)
    assert found.counts.tolist() == [1, 0, 1, 0, 0]
    assert found.nearest.tolist() == pytest.approx([0.1, np.inf, 0.1, np.inf, np.inf])
    assert neighbors_of(x, 0, 0.5)[0].tolist() == [2]
    assert neighbors_of(x, 1, 0.5)[0].tolist() == []


def test_neighbours_come_nearest_first_and_across_periodic_sides():
    x = np.array([[0.02, 0.0], [0.98, 0.0], [0.05, 0.0], [0.5, 0.0]])
    near, distance = neighbors_of(x, 0, 0.1, (1.0, np.inf))
    assert near.tolist() == [2, 1]
    np.testing.assert_allclose(distance, [0.03, 0.04])
    np.testing.assert_allclose(nearest_images(x[1:2] - x[0], (1.0, np.inf)), [[-0.04, 0.0]])


def test_a_running_simulation_counts_the_same(late):
    scene = late.scene
    found = surroundings(late.x, late.n_fluid, scene.h)
    np.testing.assert_array_equal(found.counts, late.neighbor_counts)
