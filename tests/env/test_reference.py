import errno
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sph_gym
from sph_gym import scenes
from sph_gym.env import contexts, instances, viscous
from sph_gym.env import reference as module
from sph_gym.env.reference import fingerprint, n_frames, reference
from sph_gym.solver.jit import cache_home

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


def test_a_full_disk_only_warns_and_leaves_nothing_behind(store, monkeypatch):
    def full(path, **arrays):
        path.write_bytes(b"PK half of it")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(module.np, "savez_compressed", full)
    with pytest.warns(UserWarning, match="No space left"):
        reference(SCENE)
    assert list(store.iterdir()) == []


def test_a_draft_of_a_killed_writer_is_swept_away(store):
    first = reference(SCENE)
    [kept] = store.iterdir()
    old, young = (kept.with_name(f".{kept.name}.{pid}.1.tmp") for pid in (1, 2))
    for draft in (old, young):
        draft.mkdir()
        (draft / kept.name).write_bytes(b"half")
    os.utime(old, (0, 0))
    module._write(kept, first)
    assert set(store.iterdir()) == {kept, young}
    assert equal(module._read(kept), first)


TWIN = """
import sys
from sph_gym import scenes
from sph_gym.env.reference import reference
print(reference(scenes.make("relaxation", dx=0.1)).fine.kinetic.tobytes().hex())
"""


@pytest.mark.slow
def test_two_processes_may_compute_one_reference(tmp_path):
    environment = os.environ | {"SPH_GYM_CACHE": str(tmp_path)}
    # machine code is shared: only the references are new
    jit = tmp_path / "jit"
    jit.symlink_to(cache_home() / "jit", target_is_directory=True)
    both = [
        subprocess.Popen(
            [sys.executable, "-c", TWIN], env=environment, cwd=Path(__file__).parents[2],
            stdout=subprocess.PIPE, text=True,
        )
        for _ in range(2)
    ]  # fmt: skip
    texts = [process.communicate(timeout=300)[0] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert texts[0] == texts[1] != ""
    [kept] = (tmp_path / "references").iterdir()
    assert module._read(kept) is not None


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
    instance = instances.parse("drop_impact/val/3")
    assert len(reference(instance.build(), instance.id).fine.kinetic) > 10
    monkeypatch.setattr(module, "_compute", lambda scene: "computed")
    monkeypatch.setattr(module, "_write", lambda path, stored: None)
    other = instances.instance("drop_impact", "val", 3, dx=0.08)
    assert reference(other.build(), other.id) == "computed"
    assert reference(SCENE, "nowhere/custom/0") == "computed"


def test_another_thread_may_drop_what_was_just_found(store, monkeypatch):
    class Fleeting(dict):
        """Loses everything as soon as somebody asks whether it is there."""

        def __contains__(self, key):
            found = super().__contains__(key)
            self.clear()
            return found

    kept = Fleeting({module._key(SCENE): "kept"})
    monkeypatch.setattr(module, "_KEPT", kept)
    assert reference(SCENE) == "kept"


# --- What the reference is made of ----------------------------------------------------------

NUMERICS = [
    contexts.Context(0.008, 2.3),
    contexts.Context(0.15),
    contexts.Context(0.02, 3.1),
    contexts.Context(0.02, 2.6, "cubic_spline"),
    contexts.Context(0.0),
    contexts.Context(0.02, viscosity=0.005),
]


@pytest.mark.parametrize("context", NUMERICS, ids=str)
def test_the_fine_run_has_a_matched_kernel_and_the_viscosity_of_the_instance(context):
    scene = context.apply(scenes.make("patch_impact", dx=0.1))
    fine = module.truth(scene)
    mueller = context.kernel == "mueller"
    assert fine.fluid.kernel == ("wendland_c2" if mueller else context.kernel)
    assert fine.h == pytest.approx(max(context.support, 2.6) * scene.dx)
    # the kinematic viscosity is alpha c0 h / 8, whatever the support is
    alphas = (fine.effects.artificial_viscosity or 0.0, context.alpha)
    assert alphas[0] * fine.h == pytest.approx(alphas[1] * scene.h)
    back = replace(
        fine,
        h=scene.h,
        fluid=replace(fine.fluid, kernel=scene.fluid.kernel),
        effects=replace(fine.effects, artificial_viscosity=scene.effects.artificial_viscosity),
    )
    assert fingerprint(back) == fingerprint(scene)


def series(scene, clumping, noise=0.0):
    """Return a made-up run."""
    n = n_frames(scene) + 1
    flat = np.zeros(n)
    return module.Observables(
        np.zeros((n, 2)), np.zeros((n, 2)), flat, np.broadcast_to(clumping, n), flat + noise
    )


def test_the_runs_of_a_reference_and_what_each_is_for(monkeypatch):
    scene = contexts.Context(0.008, 2.3).apply(scenes.make("patch_impact", dx=0.1))
    fine_clumping = np.linspace(0.0, 1.0, n_frames(scene) + 1)
    played = []

    def run(shown, sound=1.0, xsph=0.0, most_excess=np.inf):
        played.append((shown, sound, xsph, most_excess))
        if xsph:
            # of the instance itself: much noise, which nothing is measured by
            return series(shown, 0.5, noise=100.0)
        return series(shown, fine_clumping, noise=1.0)

    monkeypatch.setattr(module, "run", run)
    monkeypatch.setattr(module, "_cfl_substeps", lambda shown: 7.0)
    found = module._compute(scene)
    assert found.cfl_substeps == 7.0
    assert np.array_equal(found.fine.clumping, np.maximum(fine_clumping, 0.5))
    assert (found.fine.noise == 1.0).all()
    assert not found.spread.any()

    own = [each for each in played if each[2]]
    assert [each[1:] for each in own] == [(1.0, module.NOMINAL_XSPH, np.inf)]
    assert own[0][0] is scene
    matched = module.truth(scene)
    others = [each for each in played if not each[2]]
    (soft,) = (each for each in others if each[1] < 1.0)
    (fine,) = (each for each in others if each[3] < np.inf)
    (jittered,) = (each for each in others if each is not soft and each is not fine)
    assert fingerprint(fine[0]) == fingerprint(matched)
    assert fine[1:] == (1.0, 0.0, module.MOST_EXCESS)
    assert (fingerprint(soft[0]), soft[1]) == (fingerprint(matched), module.TWIN_SOUND)
    moved = np.asarray(jittered[0].x) - scene.x
    assert moved.std() == pytest.approx(module.TWIN_JITTER * scene.dx, rel=0.1)
    assert fingerprint(replace(jittered[0], x=scene.x)) == fingerprint(matched)


def test_where_the_instance_itself_blows_up_nothing_is_forgiven(monkeypatch):
    scene = contexts.Context(0.008).apply(scenes.make("patch_impact", dx=0.1))

    def run(shown, sound=1.0, xsph=0.0, most_excess=np.inf):
        if xsph:
            raise module.UnusableScene("the gas")
        return series(shown, 0.25)

    monkeypatch.setattr(module, "run", run)
    monkeypatch.setattr(module, "_cfl_substeps", lambda shown: 7.0)
    found = module._compute(scene)
    assert (found.fine.clumping == 0.25).all()
    assert not found.spread.any()


# --- Viscous fluids -------------------------------------------------------------------------

# Arguments with which scenes are coarse; fine where friction limits the step.
COARSE = {"relaxation": {"dx": 0.015}}
ARGUMENTS = {name: {"dx": 2 * scenes.parameters(name)["dx"]} for name in scenes.names()} | COARSE
VISCOUS = [
    name for name in scenes.names()
    if scenes.make(name, **ARGUMENTS[name]).effects.laminar_viscosity
]  # fmt: skip


def cut(scene, n):
    return replace(scene, duration=n * scene.frame)


@pytest.mark.every(4)
@pytest.mark.parametrize("name", VISCOUS)
def test_viscous_scenes_can_be_tuned(store, name):
    scene = cut(scenes.make(name, **ARGUMENTS[name]), 12)
    env = sph_gym.TuningEnv(scene)
    env.reset(seed=0)
    # the shortest step of the stiffest fluid
    for _ in range(env.n_steps):
        *_, truncated, info = env.step(np.array([-1.0, 1.0, 0.0]))
    assert truncated
    assert info["blowup"] == 0.0
    assert 0 < info["work"] < 10


def test_a_viscous_environment_can_be_made_finer(store):
    env = sph_gym.TuningEnv("relaxation", dx=0.015)
    env.reset(seed=0)
    # friction limits the step, dx^2 / nu
    coarse = reference(scenes.make("relaxation", dx=0.025)).cfl_substeps
    assert env.episode.reference.cfl_substeps > 2 * coarse


def test_the_rule_is_as_stiff_as_friction_asks_for_and_no_stiffer():
    scene = scenes.make("relaxation", dx=0.012)
    h, c0, share = scene.h, scene.fluid.c0, scene.viscous_share
    for c in (0.4 * c0, c0):
        rate = c / (0.8 * h) + scene.effects.laminar_viscosity / (share * h * h)
        wanted = sph_gym.Controls(1 / rate, scene.fluid.stiffness(c), 0.3)
        found = viscous.within_reach(scene, 0.8, wanted)
        reached = scene.fluid.sound_speed(found.stiffness)
        rate = reached / (0.8 * h) + scene.effects.laminar_viscosity / (share * h * h)
        assert found.dt == pytest.approx(1 / rate)
        assert reached >= c
        assert found.dt * reached / h >= 0.2 - 1e-12
        assert (found == wanted) == (wanted.dt * c / h >= 0.2)


@pytest.mark.parametrize("dx", [0.006, 0.003])
def test_a_fluid_that_takes_no_step_of_the_action_space_is_refused_at_the_door(dx):
    with pytest.raises(ValueError, match=r"dx: .* viscosity limits the step"):
        sph_gym.TuningEnv("relaxation", dx=dx)
    with pytest.raises(ValueError, match=r"scene: .* viscosity limits the step"):
        sph_gym.TuningEnv(scenes.make("relaxation", dx=dx))
    env = sph_gym.TuningEnv("relaxation")
    with pytest.raises(ValueError, match=r"instance: .* viscosity limits the step"):
        env.reset(options={"instance": f"relaxation/nominal/0/dx={dx}"})


def test_the_finest_spacing_that_is_let_in_has_a_reference():
    scene = cut(scenes.make("relaxation", dx=0.0146), 4)
    sph_gym.TuningEnv(scene)
    assert module._cfl_substeps(scene) > 0
    assert np.isfinite(module.run(module.truth(scene)).kinetic).all()


# --- Scenes that aren't fit -----------------------------------------------------------------


def crowded(share):
    """Return particles so close to each other that they burst apart; share: of the usual dx."""
    own = scenes.make("relaxation", dx=0.1)
    x = np.asarray(own.x)
    return replace(own, name="own", x=x.mean(axis=0) + share * (x - x.mean(axis=0)))


def test_a_scene_that_makes_its_own_energy_is_refused_with_the_numbers(store, monkeypatch):
    monkeypatch.setattr(module, "MOST_EXCESS", -1.0)
    env = sph_gym.TuningEnv(crowded(1.0))
    for _ in range(2):
        with pytest.raises(ValueError, match=r"own: the reference run .* -?\d+% of what is at st"):
            env.reset(seed=0)
    assert not store.exists()


def test_a_scene_that_blows_up_is_refused_with_the_numbers(store):
    text = r"own: the reference run blew up at t = .* \(.*\), with \d+% of the energy .* \d+% of"
    with pytest.raises(ValueError, match=text):
        sph_gym.TuningEnv(crowded(0.3)).reset(seed=0)


def test_whoever_expects_a_runtime_error_gets_one():
    assert issubclass(module.UnusableScene, RuntimeError)
