import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from sph_gym.__main__ import main
from sph_gym.env import SCENES, build_manifests, instances, manifest
from sph_gym.env import reference as references
from sph_gym.env.distributions import FAMILIES, draw
from sph_gym.env.fingerprint import fingerprint

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
    assert fingerprint(built) == entry.fingerprint
    stored = references._shipped(built, id_)
    assert len(stored.fine.kinetic) == references.n_frames(built) + 1
    assert stored.spread.shape == (references.n_frames(built) + 1, 4)
    assert all(np.isfinite(column).all() for column in (*stored.fine, stored.spread))
    assert stored.cfl_substeps >= 1


STAMP = (
    "other flows or references are a new VERSION in sph_gym/env/manifest.py; "
    "`python -m sph_gym manifest --stamp` writes the digests of what is there"
)


@pytest.mark.parametrize("scene", SCENES)
def test_flows_and_references_are_those_of_their_version(scene):
    found = manifest.load(scene)
    assert found.version == manifest.VERSION
    assert found.digests == manifest.current(found), STAMP


def violence(id_):
    """Largest kinetic energy of a reference, in multiples of the whole fluid's at c0 / 10."""
    built = instances.parse(id_).build()
    fluid = built.fluid.rho0 * built.dx**2 * len(built.x) * (built.fluid.c0 / 10) ** 2 / 2
    return references._shipped(built, id_).fine.kinetic.max() / fluid


def calm_and_violent(scene):
    """Of the validation instances, the one with the least and the one with the most motion."""
    ids = sorted((f"{scene}/val/{k}" for k in range(instances.SIZES["val"])), key=violence)
    return ids[0], ids[-1]


# Machines round differently, and splashes make of it what they like: after some 15 frames of the
# wildest flow, runs that began alike are other ones. Up to FRAMES, a reference is the same
# everywhere, to the rounding of float32; and the rule's mean work is about the same to the end.
FRAMES = 10
ENERGY, PLACE, SUBSTEPS = 1e-4, 1e-4, 0.1  # shares of the largest energy, of dx, of the work


@pytest.mark.parametrize("which", [0, 1], ids=["calm", "violent"])
@pytest.mark.parametrize("scene", SCENES)
def test_shipped_references_are_what_their_flows_do(scene, which):
    id_ = calm_and_violent(scene)[which]
    built = instances.parse(id_).build()
    shipped = references._shipped(built, id_)
    assert shipped.cfl_substeps == pytest.approx(references._cfl_substeps(built), rel=SUBSTEPS)
    start = replace(built, duration=FRAMES * built.frame)
    energy, found = shipped.fine.kinetic.max(), references._run(start, 1.0)
    for name, tolerance in (
        ("kinetic", ENERGY * energy), ("potential", ENERGY * energy), ("com", PLACE * built.dx),
        ("extent", PLACE * built.dx), ("front", PLACE * built.dx), ("clumping", 0.01),
    ):  # fmt: skip
        told, now = getattr(shipped.fine, name)[: FRAMES + 1], getattr(found, name)
        # written as float32
        np.testing.assert_allclose(told, now, rtol=1e-6, atol=tolerance, err_msg=name)


def test_the_sources_of_references_are_told():
    assert len(references.sources()) == 20
    for scene in SCENES:
        assert len(manifest.load(scene).sources) in (0, 16, 20)


def test_preparing_writes_what_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(build_manifests, "SIZES", {"nominal": 1, "val": 2})
    build_manifests.prepare(["relaxation"], tmp_path)
    made = manifest.load("relaxation", tmp_path)
    assert list(made.entries) == ["relaxation/nominal/0", "relaxation/val/0", "relaxation/val/1"]
    id_ = "relaxation/val/1"
    assert made.entries[id_] == manifest.entry(id_)
    expected = references.reference(instances.parse(id_).build())
    found = references._from_arrays(made.arrays(id_))
    assert found.cfl_substeps == expected.cfl_substeps
    assert found.fine.com == pytest.approx(expected.fine.com, rel=1e-6)
    assert (made.version, made.sources) == (manifest.VERSION, references.sources())
    assert made.digests == manifest.current(made)


@pytest.fixture
def folder(tmp_path):
    """A copy of a shipped manifest."""
    for ending in ("json", "npz"):
        shutil.copy(manifest.FOLDER / f"relaxation.{ending}", tmp_path)
    yield tmp_path
    manifest.load.cache_clear()
    manifest._columns.cache_clear()


def edit(folder, old, new):
    path = folder / "relaxation.json"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    manifest.load.cache_clear()


def test_a_manifest_of_another_version_is_not_read(folder):
    edit(folder, f'"version": "{manifest.VERSION}"', '"version": "v99"')
    with pytest.raises(OSError, match="is of version 'v99', expected"):
        manifest.load("relaxation", folder)


@pytest.mark.parametrize("change", ["flow", "reference", "version"])
def test_no_change_goes_unseen(folder, change, monkeypatch):
    assert main(["manifest", "--scenes", "relaxation", "--stamp", "--output", str(folder)]) == 0
    before = manifest.load("relaxation", folder)
    assert before.digests == manifest.current(before)
    assert before.entries == manifest.load("relaxation").entries
    if change == "flow":
        edit(folder, '"dx": 0.03', '"dx": 0.031')
    elif change == "reference":
        columns = dict(np.load(folder / "relaxation.npz"))
        columns["com"][0, 0] += 1e-3
        np.savez(folder / "relaxation.npz", **columns)
        manifest._columns.cache_clear()
    else:
        edit(folder, f'"version": "{manifest.VERSION}"', '"version": "v99"')
        monkeypatch.setattr(manifest, "VERSION", "v99")
    after = manifest.load("relaxation", folder)
    assert after.digests != manifest.current(after)
    manifest.stamp("relaxation", folder)
    again = manifest.load("relaxation", folder)
    assert again.digests == manifest.current(again) != before.digests


def test_ids_of_a_version_are_not_given_another_meaning(folder, monkeypatch, capsys):
    monkeypatch.setattr(build_manifests, "SIZES", {"nominal": 1})
    monkeypatch.setattr(build_manifests, "_reference", lambda id_, flow: pytest.fail("too late"))
    edit(folder, '{"dx": 0.03}', '{"dx": 0.05}')
    command = ["manifest", "--scenes", "relaxation", "--output", str(folder)]
    assert main(command) == 2
    assert "relaxation/nominal/0 means another flow in v1" in capsys.readouterr().err
    reference = references.as_arrays(references.reference(instances.parse(IDS[0]).build(), IDS[0]))
    monkeypatch.setattr(build_manifests, "_reference", lambda id_, flow: reference)
    assert main([*command, "--redefine"]) == 0
    made = manifest.load("relaxation", folder)
    assert made.entries == {"relaxation/nominal/0": manifest.entry("relaxation/nominal/0")}


def test_a_scene_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(ValueError, match="scenes"):
        build_manifests.prepare(["lake"], tmp_path)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        '{"version": "v1", "instances": 3}',
        '{"version": "v1", "instances": {"a": {}}}',
        '{"instances": {}}',
    ],
)
def test_a_damaged_manifest_says_so(tmp_path, content):
    (tmp_path / "lake.json").write_text(content)
    with pytest.raises(OSError, match=r"lake\.json is damaged"):
        manifest.load("lake", tmp_path)


def test_damaged_references_say_so(tmp_path):
    rows = {"lake/val/0": {"scene": "dam_break", "arguments": {}, "hash": "0"}}
    (tmp_path / "lake.json").write_text(
        json.dumps({"version": manifest.VERSION, "instances": rows})
    )
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
