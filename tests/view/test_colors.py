"""Colour maps that can be read by every eye, and quantities in their ranges."""

import numpy as np
import pytest

from sph_gym.view import colors


def lightness(palette):
    """CIE L* of sRGB colours, 0 to 100."""
    share = np.asarray(palette) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    return np.where(luminance > 0.008856, 116 * np.cbrt(luminance) - 16, 903.3 * luminance)


@pytest.mark.parametrize("palette", [colors.VIRIDIS, colors.BLUE_AMBER])
def test_palettes_rise_evenly_in_lightness(palette):
    assert palette.shape == (256, 3)
    assert palette.dtype == np.uint8
    every_16th = lightness(palette)[::15]
    rise = np.diff(every_16th)
    assert (rise > 0).all()
    assert rise.std() < 0.2 * rise.mean()
    assert every_16th[-1] - every_16th[0] > 50


def test_the_diverging_palette_is_neutral_in_the_middle_and_nowhere_else():
    colorful = np.ptp(colors.BLUE_AMBER.astype(int), axis=1)
    assert colorful[127:129].max() <= 2
    assert colorful[[0, 255]].min() > 100


@pytest.mark.parametrize("name", list(colors.QUANTITIES))
def test_values_are_one_for_each_fluid_particle_and_limits_are_the_scenes(name, late):
    shown = colors.quantity(name)
    low, high = shown.limits(late.scene)
    assert low < high
    assert shown.values(late).shape == (late.n_fluid,)
    assert shown.label in shown.title


def test_quantities_are_what_they_say(late):
    values = {name: shown.values(late) for name, shown in colors.QUANTITIES.items()}
    n = late.n_fluid
    np.testing.assert_allclose(values["speed"], np.linalg.norm(late.v[:n], axis=1))
    np.testing.assert_allclose(values["density"], late.rho[:n] / 1000)
    np.testing.assert_array_equal(values["pressure"], late.p[:n])
    np.testing.assert_array_equal(values["neighbors"], late.neighbor_counts)
    assert colors.quantity("speed").limits(late.scene) == (0.0, late.scene.fluid.c0 / 10)


def test_palette_index_clips_and_marks_what_is_no_number():
    values = [-1.0, 0.0, 1.0, 2.0, 3.0, np.nan, np.inf]
    bad = colors.BAD_INDEX
    np.testing.assert_array_equal(
        colors.palette_index(values, (0.0, 2.0)), [0, 0, 128, 255, 255, bad, bad]
    )


@pytest.mark.parametrize(
    ("limits", "n_max", "numbers", "decimals"),
    [
        ((0.0, 4.43), 5, [0, 1, 2, 3, 4], 0),
        ((0.9, 1.1), 5, [0.9, 0.95, 1.0, 1.05, 1.1], 2),
        ((0.0, 19620.0), 4, [0, 5000, 10000, 15000], 0),
        ((0.0, 3e-4), 2, [0, 2e-4], 4),
    ],
)
def test_ticks_are_round_and_few(limits, n_max, numbers, decimals):
    found, places = colors.ticks(limits, n_max)
    np.testing.assert_allclose(found, numbers, atol=1e-12)
    assert places == decimals


def test_an_unknown_quantity_is_named_with_the_known_ones():
    with pytest.raises(ValueError, match=r"color: expected one of speed, .*got 'vorticity'"):
        colors.quantity("vorticity")
