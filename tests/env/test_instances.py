import numpy as np
import pytest

from sph_gym.env import SCENES, instances
from sph_gym.env.distributions import FAMILIES


@pytest.mark.every(5)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("split", instances.SIZES)
def test_every_instance_makes_a_scene(scene, split):
    for number in range(instances.SIZES[split]):
        made = instances.instance(scene, split, number)
        assert made.id == f"{scene}/{split}/{number}"
        assert len(np.asarray(made.build().x)) > 50


def test_an_id_always_means_the_same_flow():
    assert instances.parse("drop_impact/train/7") == instances.instance("drop_impact", "train", 7)


def test_an_id_says_everything_at_other_spacings_too():
    made = instances.instance("drop_impact", "train", 7, dx=0.05)
    assert made.id == "drop_impact/train/7/dx=0.05"
    assert instances.parse(made.id) == made
    usual = FAMILIES["drop_impact"].dx
    assert instances.instance("drop_impact", "train", 7, dx=usual).id == "drop_impact/train/7"


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", SCENES)
def test_a_finer_flow_is_the_same_flow_with_more_particles(scene):
    for split, number in (("train", 0), ("ood", 0), ("ood", 2), ("nominal", 0)):
        usual = instances.instance(scene, split, number)
        finer = instances.parse(f"{usual.id}/finer=2")
        assert finer == instances.instance(scene, split, number, finer=2)
        assert finer.arguments == usual.arguments | {"dx": usual.arguments["dx"] / 2}
        assert finer.drawn.context == usual.drawn.context
        one, other = usual.build(), finer.build()
        assert len(other.x) == pytest.approx(4 * len(one.x), rel=0.2)
        assert np.ptp(other.x, axis=0) == pytest.approx(np.ptp(one.x, axis=0), abs=2 * one.dx)


def test_at_another_dx_a_drawn_flow_is_larger_and_has_as_many_particles():
    usual = instances.instance("patch_impact", "val", 3).build()
    larger = instances.instance("patch_impact", "val", 3, dx=2 * usual.dx).build()
    assert len(larger.x) == len(usual.x)
    assert np.ptp(larger.x, axis=0) == pytest.approx(2 * np.ptp(usual.x, axis=0))


def test_a_flow_has_one_spacing():
    with pytest.raises(ValueError, match="finer: expected 1 beside dx, got 2"):
        instances.instance("patch_impact", "val", 3, dx=0.1, finer=2)


def test_splits_and_numbers_differ():
    drawn = [
        instances.instance("dam_break", s, k) for s in ("train", "val", "test") for k in (0, 1)
    ]
    assert len({tuple(sorted(made.arguments.items())) for made in drawn}) == len(drawn)


def test_dam_breaks_vary_in_size_ratio_and_gravity():
    drawn = [instances.instance("dam_break", "train", k).arguments for k in range(64)]
    ratios = [made["height"] / made["width"] for made in drawn]
    assert np.ptp([made["width"] for made in drawn]) > 0.1
    assert np.ptp(ratios) > 1.0
    assert np.ptp([made["gravity"] for made in drawn]) > 8.0


@pytest.mark.parametrize(
    "id_",
    [
        "dam_break/train/256",
        "dam_break/train",
        "dam_break/future/0",
        "lake/train/0",
        "",
        None,
        "dam_break/val/007",
        "dam_break/val/00",
        "dam_break/val/\N{ARABIC-INDIC DIGIT THREE}",
        "dam_break/val/+3",
        "dam_break/val/3/finer=1",
        "dam_break/val/3/finer=02",
        "dam_break/val/3/finer=1.5",
        "dam_break/val/3/finer=2/dx=0.1",
        "dam_break/val/3/coarser=2",
        pytest.param("dam_break/val/" + "9" * 5000, id="long"),
    ],
)
def test_ids_that_do_not_exist_are_refused(id_):
    with pytest.raises(ValueError, match="expected"):
        instances.parse(id_)
