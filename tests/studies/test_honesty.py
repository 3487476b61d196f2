"""Runs that are as good as a reference: the same fluid, more finely or more smoothly."""

import pytest

from sph_gym.env import instances
from sph_gym.studies import honesty


@pytest.mark.parametrize("scene", ["dam_break", "patch_impact", "shaken_tank"])
def test_a_finer_run_is_of_the_same_fluid(scene):
    instance = instances.instance(scene, "val", 1)
    built, finer = instance.build(), honesty.rivals(instance)["half the spacing"].scene
    assert finer.dx == pytest.approx(built.dx / 2)
    # a tank is snapped to its spacing, and the sound speed follows
    assert finer.frame == pytest.approx(built.frame)
    assert finer.fluid.c0 == pytest.approx(built.fluid.c0, rel=0.02)
    assert len(finer.x) == pytest.approx(4 * len(built.x), rel=0.1)
    viscosity = [each.effects.artificial_viscosity * each.h for each in (built, finer)]
    assert viscosity[1] == pytest.approx(viscosity[0])


def test_the_reference_itself_keeps_within_tolerance():
    instance = instances.instance("patch_impact", "val", 1)
    scene = honesty.truth(instance.build())
    assert honesty.share_within(instance, honesty.Rival(scene, 0.0)) == 1.0
