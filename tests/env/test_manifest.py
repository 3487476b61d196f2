import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sph_gym.__main__ import main
from sph_gym.env import SCENES, build_manifests, instances, manifest
from sph_gym.env import reference as references
from sph_gym.env.contexts import Context
from sph_gym.env.distributions import FAMILIES, SHIFTS, Drawn, draw
from sph_gym.env.fingerprint import fingerprint
from sph_gym.solver import target

IDS = [
    f"{scene}/{split}/{number}"
    for scene in SCENES
    for split, size in instances.SIZES.items()
    # odd steps, so that every shift of "ood" and every kind of context comes up
    for number in range(0, size, 5 if size < 100 else 51)
    if manifest.entry(f"{scene}/{split}/{number}") is not None
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
    assert stored.spread.shape == (references.n_frames(built) + 1, 5)
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
# Vectors of 512 bits add in another order than those of 256 that computed the references: with them
# this flow is another one after fewer frames.
SOONER = {"shaken_tank/val/4": 8} if target.BITS == 512 else {}
# Half a part, and what single precision adds, as a share of the largest value.
ROUNDING = {name: 0.501 / (2**bits - 1) for name, bits in manifest.BITS.items()}
ENERGY, PLACE, SUBSTEPS = 1e-4, 1e-4, 0.1  # shares of the largest energy, of dx, of the work


# the diagnostic flows differ from their nominal ones in effects: two more compiled versions each
PLAYED = [
    pytest.param(scene, marks=[pytest.mark.slow] if scene in instances.DIAGNOSTIC else [])
    for scene in SCENES
]


@pytest.mark.every(3)
@pytest.mark.parametrize("which", [0, 1], ids=["calm", "violent"])
@pytest.mark.parametrize("scene", PLAYED)
def test_shipped_references_are_what_their_flows_do(scene, which):
    id_ = calm_and_violent(scene)[which]
    built = instances.parse(id_).build()
    shipped = references._shipped(built, id_)
    assert shipped.cfl_substeps == pytest.approx(references._cfl_substeps(built), rel=SUBSTEPS)
    frames = SOONER.get(id_, FRAMES)
    start = replace(built, duration=frames * built.frame)
    found = references.run(references.truth(start))
    # to its end, since one that blows up late is forgiven nothing from the start
    own = references._own_run(built)
    if own is not None:
        most = np.maximum(found.clumping, own.clumping[: frames + 1])
        found = found._replace(clumping=most)
    unit = (built.fluid.c0 / 10) ** 2
    for name, tolerance in (
        ("kinetic", ENERGY * shipped.fine.kinetic.max()), ("com", PLACE * built.dx),
        ("extent", PLACE * built.dx), ("clumping", 0.01), ("noise", ENERGY * unit),
    ):  # fmt: skip
        whole, now = getattr(shipped.fine, name), getattr(found, name)
        rounded = 2 * ROUNDING[name] * np.abs(whole).max(axis=0)
        worst = (np.abs(whole[: frames + 1] - now) - rounded).max()
        assert worst <= tolerance, name


def test_the_sources_of_references_are_told():
    assert len(references.sources()) == 20
    for scene in SCENES:
        assert len(manifest.load(scene).sources) in (0, 16, 20)


def test_preparing_writes_what_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(build_manifests, "SIZES", {"nominal": 1, "val": 2})
    build_manifests.prepare(["patch_impact"], tmp_path)
    made = manifest.load("patch_impact", tmp_path)
    assert list(made.entries) == [
        "patch_impact/nominal/0",
        "patch_impact/val/0",
        "patch_impact/val/1",
    ]
    id_ = "patch_impact/val/1"
    assert made.entries[id_] == manifest.entry(id_)
    expected = references.reference(instances.parse(id_).build())
    found = references._from_arrays(made.arrays(id_))
    assert found.cfl_substeps == expected.cfl_substeps
    for name in references.Observables._fields:
        whole, told = getattr(expected.fine, name), getattr(found.fine, name)
        assert np.all(np.abs(told - whole) <= ROUNDING[name] * np.abs(whole).max(axis=0)), name
    assert (made.version, made.sources) == (manifest.VERSION, references.sources())
    assert made.digests == manifest.current(made)


def test_a_manifest_goes_on_where_it_was_stopped(tmp_path, monkeypatch, capsys):
    """On a short set, of flows whose references are quick to make up."""
    monkeypatch.setattr(build_manifests, "SIZES", {"nominal": 1, "val": 3})
    asked = []

    def compute(scene):
        if len(asked) == 2:
            raise KeyboardInterrupt
        asked.append(fingerprint(scene))
        arrays = made_up(references.n_frames(scene) + 1, seed=len(asked))
        return references._from_arrays(arrays)

    monkeypatch.setattr(build_manifests, "reference", compute)
    command = ["manifest", "--scenes", "relaxation", "--output", str(tmp_path)]
    assert main(command) == 130
    begun = manifest.load("relaxation", tmp_path)
    assert list(begun.entries) == ["relaxation/nominal/0", "relaxation/val/0"]
    first = begun.arrays("relaxation/val/0")["kinetic"]
    monkeypatch.setattr(build_manifests, "reference", lambda scene: compute_all(scene, asked))
    assert main(command) == 0
    done = manifest.load("relaxation", tmp_path)
    assert len(done.entries) == len(set(asked)) == 4
    # what was written once stays as it is, to the rounding
    assert done.arrays("relaxation/val/0")["kinetic"] == pytest.approx(first, rel=1e-3, abs=1e-3)
    assert main([*command, "--again"]) == 0
    assert len(asked) == 8


def compute_all(scene, asked):
    asked.append(fingerprint(scene))
    return references._from_arrays(made_up(references.n_frames(scene) + 1, seed=len(asked)))


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
        columns["low"][0, 0] ^= 2
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
    monkeypatch.setattr(build_manifests, "_reference", lambda *given: pytest.fail("too late"))
    edit(folder, '{"dx": 0.03}', '{"dx": 0.05}')
    command = ["manifest", "--scenes", "relaxation", "--output", str(folder)]
    assert main(command) == 2
    assert "relaxation/nominal/0 means another flow in v1" in capsys.readouterr().err
    reference = references.as_arrays(references.reference(instances.parse(IDS[0]).build(), IDS[0]))
    monkeypatch.setattr(build_manifests, "_reference", lambda *given: reference)
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
        train = [draw(scene, "train", k, FAMILIES[scene].dx) for k in range(256)]
        odd = [manifest.entry(f"{scene}/ood/{k}").drawn for k in range(len(SHIFTS))]
        shown = dict(zip(SHIFTS, odd, strict=True))
        name = FAMILIES[scene].odd[0]
        least = min(one.arguments["dx"] for one in train)
        assert shown["resolution"].arguments["dx"] < least
        most = max(one.arguments[name] for one in train)
        assert shown["strength"].arguments[name] > most
        assert shown["viscosity"].context.viscosity > 0
        assert all(one.context.viscosity == 0 for one in train)
        assert shown["scene"].arguments["obstacle"] > 0
        assert all(one.arguments.get("obstacle", 0.0) == 0.0 for one in train)
        used = {(one.context.kernel, one.context.integrator) for one in train}
        assert used == {("mueller", "symplectic_euler")}
        assert shown["kernel"].context.kernel != "mueller"
        assert shown["integrator"].context.integrator != "symplectic_euler"


# --- Files ----------------------------------------------------------------------------------

# Files of all environments together [bytes].
MOST_BYTES = 4e6


def test_all_manifests_are_small():
    assert sum(path.stat().st_size for path in manifest.FOLDER.iterdir()) <= MOST_BYTES


def made_up(n_frames, seed=0, scale=1.0):
    """Return a reference of random numbers, as arrays by name."""
    rng = np.random.default_rng(seed)
    arrays = {
        name: scale * rng.normal(size=(n_frames, width) if width > 1 else n_frames)
        for name, width in manifest.ROWS.items()
    }
    return arrays | {"cfl_substeps": float(rng.uniform(1, 50))}


def assert_rounded(found, given):
    """Check that numbers that were read are rounded to a share of the largest value, no further."""
    assert set(found) == set(given)
    assert found["cfl_substeps"] == given["cfl_substeps"]
    for name in manifest.ROWS:
        assert found[name].shape == given[name].shape
        largest = np.abs(given[name]).max(axis=0)
        assert np.all(np.abs(found[name] - given[name]) <= ROUNDING[name] * largest), name


@given(
    st.lists(st.integers(1, 30), min_size=1, max_size=5),
    st.sampled_from([1e-12, 1.0, 1e9]),
    st.integers(0, 100),
)
def test_packed_references_come_back_rounded(lengths, scale, seed):
    flows = [made_up(n, seed + k, scale) for k, n in enumerate(lengths)]
    columns = manifest.packed(flows)
    assert {name for name in columns if columns[name].dtype == np.uint8} == {"high", "low"}
    for k, flow in enumerate(flows):
        assert_rounded(manifest.unpacked(columns, k), flow)


def test_columns_of_zeros_come_back_as_zeros():
    flow = made_up(12)
    flow["noise"], flow["com"] = np.zeros(12), flow["com"] * [1.0, 0.0]
    found = manifest.unpacked(manifest.packed([made_up(3), flow]), 1)
    assert not found["noise"].any()
    assert not found["com"][:, 1].any()
    assert_rounded(found, flow)


def test_the_largest_jumps_come_back():
    """From the largest value to its negative: the most that a change can be."""
    flow = made_up(6)
    flow["kinetic"] = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 0.0])
    assert_rounded(manifest.unpacked(manifest.packed([flow]), 0), flow)


def test_flows_of_a_single_row_come_back():
    flows = [made_up(1, seed) for seed in range(3)]
    columns = manifest.packed(flows)
    assert columns["offsets"].tolist() == [0, 1, 2, 3]
    for k, flow in enumerate(flows):
        assert_rounded(manifest.unpacked(columns, k), flow)


def test_entries_come_back_from_their_rows():
    flows = [
        Drawn("dam_break", {"dx": 0.04}),
        Drawn("dam_break", {"dx": 0.04}, Context()),
        Drawn("dam_break", {"dx": 0.04}, Context(0.15, 2.3, "wendland_c2", 0.01, "x")),
    ]
    for flow in flows:
        entry = manifest.Entry(flow, "hash")
        assert manifest.Entry.of(json.loads(json.dumps(entry.row()))) == entry
    assert "context" not in manifest.Entry(flows[0], "").row()
    assert manifest.Entry(flows[1], "").row()["context"] == {}
