from dataclasses import replace

import numpy as np
import pytest

from sph_gym import scenes
from sph_gym.env import instances
from sph_gym.env import reference as module
from sph_gym.env.reference import fingerprint, n_frames, reference

SCENE = scenes.make("relaxation", dx=0.1)


@pytest.fixture
def store(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "cache_home", lambda: tmp_path)
    module._KEPT.clear()
    yield tmp_path / "references"
    module._KEPT.clear()


def equal(a, b):
    return a.cfl_substeps == b.cfl_substeps and all(
        np.array_equal(left, right)
        for left, right in zip((*a.fine, a.spread), (*b.fine, b.spread), strict=True)
    )


def test_it_covers_every_frame_and_is_kept_on_disk(store, monkeypatch):
    first = reference(SCENE)
    assert len(first.fine.kinetic) == n_frames(SCENE) + 1
    assert first.cfl_substeps >= 1
    module._KEPT.clear()
    monkeypatch.setattr(module, "_compute", lambda scene: pytest.fail("computed twice"))
    assert equal(reference(SCENE), first)


@pytest.mark.parametrize("content", [b"", b"not a zip file", b"PK\x03\x04 torn"])
@pytest.mark.filterwarnings("ignore:.*is damaged")
def test_a_damaged_file_is_rebuilt(store, content):
    first = reference(SCENE)
    (file,) = store.glob("*.npz")
    file.write_bytes(content)
    module._KEPT.clear()
    assert equal(reference(SCENE), first)
    assert file.stat().st_size > 100


def test_a_folder_that_cannot_be_written_only_warns(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    monkeypatch.setattr(module, "cache_home", lambda: blocked)
    module._KEPT.clear()
    with pytest.warns(UserWarning, match="can't be kept"):
        reference(SCENE)


def test_the_key_knows_every_part_of_the_scene():
    others = [
        scenes.make("relaxation", dx=0.1, jitter=0.06),
        scenes.make("relaxation", dx=0.1, seed=1),
        scenes.make("dam_break", dx=0.1),
        scenes.make("dam_break", dx=0.1, tank=6.0),
        scenes.make("dam_break", dx=0.1, gravity=5.0),
    ]
    keys = {module._key(scene) for scene in [SCENE, *others]}
    assert len(keys) == len(others) + 1


def test_a_fingerprint_sees_the_flow_and_not_its_name_or_rounding():
    x = np.asarray(SCENE.x)
    same = replace(SCENE, name="other", x=x * (1 + 1e-15))
    assert fingerprint(same) == fingerprint(SCENE)
    moved = replace(SCENE, x=x + np.eye(len(x), 2) * 1e-6)
    stiff = replace(SCENE, fluid=replace(SCENE.fluid, c0=1.001 * SCENE.fluid.c0))
    assert len({fingerprint(scene) for scene in (SCENE, moved, stiff)}) == 3


def test_shipped_references_serve_only_the_scene_that_they_belong_to(store, monkeypatch):
    monkeypatch.setattr(module, "_compute", lambda scene: pytest.fail("computed, not shipped"))
    instance = instances.parse("hydrostatic_tank/val/3")
    assert len(reference(instance.build(), instance.id).fine.kinetic) > 10
    monkeypatch.setattr(module, "_compute", lambda scene: "computed")
    monkeypatch.setattr(module, "_write", lambda path, stored: None)
    other = instances.instance("hydrostatic_tank", "val", 3, dx=0.05)
    assert reference(other.build(), other.id) == "computed"
    assert reference(SCENE, "nowhere/custom/0") == "computed"
