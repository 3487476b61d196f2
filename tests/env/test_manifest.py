import json

import numpy as np
import pytest

from sph_gym.env import SCENES, instances, manifest, preparation
from sph_gym.env import reference as references
from sph_gym.env.draws import FAMILIES, draw

IDS = [
    f"{scene}/{split}/{number}"
    for scene in SCENES
    for split, size in instances.SIZES.items()
    # odd steps, so that every shift of "ood" comes up
    for number in range(0, size, 5 if size < 100 else 51)
]


def test_every_instance_is_listed_once():
    for scene in SCENES:
        listed = manifest.load(scene)
        assert listed is not None
        assert list(listed.entries) == [
            f"{scene}/{split}/{number}"
            for split, size in instances.SIZES.items()
            for number in range(size)
        ]


@pytest.mark.parametrize("id_", IDS)
def test_ids_mean_what_was_drawn_and_their_references_belong_to_it(id_):
    scene, split, number = id_.split("/")
    entry = manifest.entry(id_)
    assert entry.drawn == draw(scene, split, int(number), FAMILIES[scene].dx)
    built = instances.parse(id_).build()
    assert references.fingerprint(built) == entry.fingerprint
    stored = references._shipped(built, id_)
    assert len(stored.fine.kinetic) == references.n_frames(built) + 1
    assert stored.spread.shape == (references.n_frames(built) + 1, 4)
    assert all(np.isfinite(column).all() for column in (*stored.fine, stored.spread))
    assert stored.cfl_substeps >= 1


@pytest.mark.parametrize("id_", ["hydrostatic_tank/val/0", "colliding_patches/nominal/0"])
def test_a_shipped_reference_is_what_its_flow_does(id_):
    built = instances.parse(id_).build()
    shipped, computed = references._shipped(built, id_), references._compute(built)
    assert shipped.cfl_substeps == pytest.approx(computed.cfl_substeps, rel=0.02)
    # rounding grows with time: the first third is the same on any machine
    early = len(computed.fine.kinetic) // 3
    assert shipped.fine.kinetic[:early] == pytest.approx(
        computed.fine.kinetic[:early], rel=1e-3, abs=1e-3 * computed.fine.kinetic.max()
    )
    assert np.abs(shipped.fine.com - computed.fine.com)[:early].max() < 1e-3 * built.dx


def test_preparing_writes_what_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(preparation, "SIZES", {"nominal": 1, "val": 2})
    preparation.prepare(["relaxation"], tmp_path)
    made = manifest.load("relaxation", tmp_path)
    assert list(made.entries) == ["relaxation/nominal/0", "relaxation/val/0", "relaxation/val/1"]
    id_ = "relaxation/val/1"
    assert made.entries[id_] == manifest.entry(id_)
    expected = references.reference(instances.parse(id_).build())
    found = references._from_arrays(made.arrays(id_))
    assert found.cfl_substeps == expected.cfl_substeps
    assert found.fine.com == pytest.approx(expected.fine.com, rel=1e-6)


def test_a_scene_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(ValueError, match="scenes"):
        preparation.prepare(["lake"], tmp_path)


@pytest.mark.parametrize("content", ["", "{", '{"instances": 3}', '{"instances": {"a": {}}}'])
def test_a_damaged_manifest_says_so(tmp_path, content):
    (tmp_path / "lake.json").write_text(content)
    with pytest.raises(OSError, match=r"lake\.json is damaged"):
        manifest.load("lake", tmp_path)


def test_damaged_references_say_so(tmp_path):
    rows = {"lake/val/0": {"scene": "dam_break", "arguments": {}, "hash": "0"}}
    (tmp_path / "lake.json").write_text(json.dumps({"instances": rows}))
    (tmp_path / "lake.npz").write_bytes(b"PK\x03\x04 torn")
    with pytest.raises(OSError, match=r"lake\.npz is damaged"):
        manifest.load("lake", tmp_path).arrays("lake/val/0")


def test_what_is_out_of_distribution_is():
    for scene in SCENES:
        train = [manifest.entry(f"{scene}/train/{k}").drawn for k in range(256)]
        odd, viscous, other = (manifest.entry(f"{scene}/ood/{k}").drawn for k in (1, 2, 3))
        finer = manifest.entry(f"{scene}/ood/0").drawn
        name = FAMILIES[scene].odd[0]
        assert finer.arguments["dx"] < min(one.arguments["dx"] for one in train)
        assert odd.arguments[name] > max(one.arguments[name] for one in train)
        assert viscous.viscosity is not None
        assert all(one.viscosity is None for one in train)
        assert other.arguments["obstacle"] > 0
        assert all(one.arguments.get("obstacle", 0.0) == 0.0 for one in train)
