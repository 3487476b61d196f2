"""Scenes as plain data: all of them come back, to the last bit, and nothing else does."""

import json
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Controls, Motion, Scene, Simulation, Walls, scenes
from sph_gym.env.fingerprint import digest
from sph_gym.trajectory import Recorder, read
from tests import cases

FIELDS = [cases.SHAKEN, cases.ROLLING, cases.RECORDED, cases.CENTRAL, (1.5, -9.81), None]


def own(gravity=(1.5, -9.81), **more):
    effects = replace(cases.INTEGRATED, gravity=gravity)
    x = np.asfortranarray(cases.lattice(0.0, cases.WIDTH, 0.0, cases.WIDTH, cases.DX)) + 1e-17
    walls = replace(cases.MOVING, pressure="extrapolated")
    return Scene("own", x, cases.DX, 0.04, cases.FREE, effects=effects, walls=walls, **more)


def sent(scene):
    """Return the scene, after it went through strict JSON."""
    return Scene.from_dict(json.loads(json.dumps(scene.to_dict(), allow_nan=False)))


@pytest.mark.without_jit
@pytest.mark.parametrize("name", scenes.names())
def test_every_scene_comes_back(name):
    scene = scenes.make(name)
    assert digest(sent(scene)) == digest(scene)


@pytest.mark.without_jit
@pytest.mark.parametrize("gravity", FIELDS, ids=lambda field: type(field).__name__)
def test_every_kind_of_gravity_and_of_walls_comes_back(gravity):
    scene = own(gravity, controls=Controls(1e-4, 1e5 / 3, 0.1), integrator="kick_drift_kick")
    back = sent(scene)
    assert digest(back) == digest(scene)
    assert back.controls == scene.controls
    assert back.walls.box == scene.walls.box == (-np.inf, np.inf, 0.0, cases.HOLD)
    assert sent(back).to_dict() == scene.to_dict()


@pytest.mark.without_jit
def test_a_box_that_moves_without_particles_comes_back():
    scene = replace(own(), walls=Walls(box=cases.BOX, motion=Motion((1.0, 0.0), sides=("left",))))
    assert digest(sent(scene)) == digest(scene)


def test_a_simulation_of_it_has_the_same_bits():
    scene = scenes.make("dam_break", dx=0.05)
    one, other = Simulation(scene), Simulation(sent(scene))
    for sim in (one, other):
        sim.advance(3 * scene.frame)
    for name in ("x", "v", "rho", "p"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


def damaged(data, change):
    """Yield copies of nested data, each with one part changed by `change`."""
    parts = data.items() if isinstance(data, dict) else enumerate(data)
    for key, part in parts:
        yield change(data, key)
        if isinstance(part, dict):
            for inner in damaged(part, change):
                yield {**data, key: inner}


def left_out(data, key):
    return {name: part for name, part in data.items() if name != key}


def renamed(data, key):
    return {f"{name}_" if name == key else name: part for name, part in data.items()}


@pytest.mark.without_jit
@pytest.mark.parametrize("change", [left_out, renamed])
def test_missing_and_unknown_fields_are_refused(change):
    data = own(cases.SHAKEN, controls=Controls(1e-4, 1e5, 0.1)).to_dict()
    for wrong in damaged(data, change):
        if "version" not in left_out(wrong, "version_") and "version_" not in wrong:
            # recordings have none
            continue
        with pytest.raises(ValueError, match=r"^scene.*expected"):
            Scene.from_dict(wrong)


@pytest.mark.without_jit
@pytest.mark.parametrize("nonsense", ["?", None, -1, [], {}, [[1]], {"class": "Walls"}, 1e400])
def test_wrong_values_are_refused_or_legal(nonsense):
    data = own(cases.ROLLING, controls=Controls(1e-4, 1e5, 0.1)).to_dict()
    refused = 0
    for wrong in damaged(data, lambda part, key: {**part, key: nonsense}):
        with suppress(ValueError):
            Scene.from_dict(wrong)
            continue
        refused += 1
    assert refused > 20


@pytest.mark.without_jit
@pytest.mark.parametrize("wrong", [None, 3, "scene", [], {}, {"class": "Fluid"}, {"scene": 1}])
def test_other_data_is_refused(wrong):
    with pytest.raises(ValueError, match="scene: expected a dictionary of Scene"):
        Scene.from_dict(wrong)


@pytest.mark.without_jit
def test_another_version_is_refused():
    with pytest.raises(ValueError, match=r"scene\.version: expected 1, got 2"):
        Scene.from_dict(own().to_dict() | {"version": 2})


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".pvd"])
def test_a_recording_holds_its_scene(tmp_path, suffix):
    pytest.importorskip({".npz": "numpy", ".pvd": "meshio"}.get(suffix, "h5py"))
    sim = Simulation(scenes.make("dam_break", dx=0.05))
    with Recorder(tmp_path / f"run{suffix}", sim) as recorder:
        recorder.record()
    if suffix == ".pvd":
        stored = json.loads((tmp_path / "run" / "scene.json").read_text())
    else:
        stored = read(tmp_path / f"run{suffix}").parameters["scene"]
    assert digest(Scene.from_dict(stored)) == digest(sim.scene)
