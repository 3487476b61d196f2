import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sph_gym.controllers import Network
from sph_gym.controllers.perceptron import tanh

LAYOUTS = ("features v2", "absolute v2")


def network(activation="tanh", squash="clip", layouts=LAYOUTS):
    rng = np.random.default_rng(0)
    sizes = (5, 8, 3)
    weights = tuple(
        rng.normal(size=(n_out, n_in)).astype(np.float32)
        for n_in, n_out in itertools.pairwise(sizes)
    )
    biases = tuple(rng.normal(size=n).astype(np.float32) for n in sizes[1:])
    return Network(weights, biases, activation, squash, *layouts)


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("squash", ["clip", "tanh"])
def test_it_survives_the_disk(tmp_path, activation, squash):
    original = network(activation, squash)
    original.save(tmp_path / "n.npz")
    x = np.linspace(-1, 1, 5, dtype=np.float32)
    action = Network.load(tmp_path / "n.npz")(x)
    assert np.array_equal(action, original(x))
    assert action.shape == (3,)
    assert np.abs(action).max() <= 1


@pytest.mark.parametrize("layouts", [("", ""), ("features v2", ""), ("", "absolute v2")])
def test_a_file_that_does_not_say_what_it_was_trained_with_is_refused(tmp_path, layouts):
    network(layouts=layouts).save(tmp_path / "n.npz")
    with pytest.raises(ValueError, match="doesn't say which observations and actions"):
        Network.load(tmp_path / "n.npz")


def test_a_file_of_a_draft_is_refused_with_the_same_sentence(tmp_path):
    network().save(tmp_path / "n.npz")
    with np.load(tmp_path / "n.npz") as data:
        parts = {name: data[name] for name in data.files if name not in ("observation", "action")}
    np.savez(tmp_path / "n.npz", **parts)
    with pytest.raises(ValueError, match="doesn't say which observations and actions"):
        Network.load(tmp_path / "n.npz")


def test_layouts_survive_the_disk_and_others_are_refused(tmp_path):
    network().save(tmp_path / "n.npz")
    read = Network.load(tmp_path / "n.npz")
    read.check(*LAYOUTS)
    for place, wrong in enumerate(("features v1", "delta v2")):
        here = list(LAYOUTS)
        here[place] = wrong
        with pytest.raises(ValueError, match=f"network: .*'{LAYOUTS[place]}', but .*'{wrong}'"):
            read.check(*here)


def test_one_layer_by_hand():
    one = Network((np.eye(3, dtype=np.float32),), (np.ones(3, np.float32),), "tanh", "clip")
    assert np.array_equal(one(np.array([-1.0, -0.5, 3.0])), [0.0, 0.5, 1.0])


def test_files_that_are_no_networks_are_refused(tmp_path):
    (tmp_path / "text.npz").write_text("hello")
    np.savez(tmp_path / "other.npz", a=np.ones(3))
    np.savez(tmp_path / "pickle.npz", weight0=np.array([object()]))
    network().save(tmp_path / "whole.npz")
    whole = (tmp_path / "whole.npz").read_bytes()
    (tmp_path / "torn.npz").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "header.npz").write_bytes(b"PK\x03\x04 torn")
    middle = len(whole) // 3
    changed = whole[:middle] + bytes(byte ^ 255 for byte in whole[middle : middle + 40])
    (tmp_path / "changed.npz").write_bytes(changed + whole[middle + 40 :])
    first, second = network().weights
    for name, weights in (("shapes", (first, first)), ("nan", (first, second * np.nan))):
        replace(network(), weights=weights).save(tmp_path / f"{name}.npz")
    names = ("text", "other", "pickle", "missing", "torn", "header", "changed", "shapes", "nan")
    for name in names:
        with pytest.raises(ValueError, match="no exported network"):
            Network.load(tmp_path / f"{name}.npz")


class Trap:
    """Unpickling it would leave a trace."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def test_loading_runs_no_code_from_the_file(tmp_path):
    trace = tmp_path / "trace"
    np.savez(tmp_path / "trap.npz", weight0=np.array([Trap(trace)], dtype=object))
    with pytest.raises(ValueError, match="no exported network"):
        Network.load(tmp_path / "trap.npz")
    assert not trace.exists()
    # the trap works
    np.load(tmp_path / "trap.npz", allow_pickle=True)["weight0"]
    assert trace.exists()


def test_a_save_that_fails_leaves_the_old_file(tmp_path, monkeypatch):
    network().save(tmp_path / "n.npz")
    before = (tmp_path / "n.npz").read_bytes()

    def half(path, **arrays):
        path.write_bytes(b"half")
        raise OSError("no space left")

    monkeypatch.setattr(np, "savez_compressed", half)
    with pytest.raises(OSError, match="no space"):
        network("relu").save(tmp_path / "n.npz")
    assert (tmp_path / "n.npz").read_bytes() == before


def test_an_observation_of_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"observation: expected shape \(5,\), got \(7,\)"):
        network()(np.zeros(7))


def test_what_it_returns_is_its_own():
    """Layers work in place, but neither on the observation nor on what was returned before."""
    net, x = network(), np.linspace(-1, 1, 5, dtype=np.float32)
    first, before = net(x), x.copy()
    kept = first.copy()
    net(-x)
    assert np.array_equal(x, before)
    assert np.array_equal(first, kept)
    weights = [weight.copy() for weight in net.weights]
    assert all(map(np.array_equal, weights, network().weights))


def twin(network, observation):
    """Return what numpy computes for the same perceptron in double precision."""
    x = observation.astype(float)
    last = len(network.weights) - 1
    for k, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        x = weight.astype(float) @ x + bias
        if k < last:
            x = np.tanh(x) if network.activation == "tanh" else np.maximum(x, 0)
    if network.squash == "clip":
        return np.clip(x, -1, network.highest)
    return np.tanh(x) if network.squash == "tanh" else x


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("squash", ["clip", "tanh", "none"])
@pytest.mark.parametrize("sizes", [(5, 3), (5, 8, 3), (23, 64, 64, 27), (2, 70, 1, 9)])
def test_the_compiled_layers_are_those_of_numpy(activation, squash, sizes):
    rng = np.random.default_rng(1)
    shapes = [(n_out, n_in) for n_in, n_out in itertools.pairwise(sizes)]
    weights = tuple((rng.normal(size=s) / np.sqrt(s[1])).astype(np.float32) for s in shapes)
    biases = tuple(rng.normal(size=n).astype(np.float32) for n in sizes[1:])
    made = Network(weights, biases, activation, squash, *LAYOUTS)
    if squash == "clip":
        made = replace(made, highest=(0.3,) * sizes[-1])
    for observation in rng.uniform(-1, 1, (20, sizes[0])).astype(np.float32):
        found = made(observation)
        assert found.dtype == np.float32
        assert np.abs(found - twin(made, observation)).max() < 5e-6


def test_tanh_is_that_of_the_library():
    x = np.concatenate([np.linspace(-12, 12, 2001), [-1e30, -1e-30, 0.0, 1e-30, 1e30]])
    found = np.array([tanh(np.float32(each)) for each in x])
    assert np.abs(found - np.tanh(x)).max() < 6e-7
    assert np.abs(found).max() <= 1
    small = np.abs(x) < 1e-20
    assert found[small] == pytest.approx(x[small], rel=1e-6)


def test_any_array_of_the_right_shape_is_an_observation():
    made = network()
    wide = np.linspace(-1, 1, 10, dtype=np.float32)
    frozen = wide[::2].copy()
    frozen.setflags(write=False)
    wanted = made(wide[::2])
    for same in (frozen, frozen.astype(float), frozen.tolist()):
        assert np.array_equal(made(same), wanted)
    # and the answer is the caller's own
    assert made(frozen) is not made(frozen)
    for wrong in (wide, frozen[:4], frozen[None], 1.0):
        with pytest.raises(ValueError, match=r"observation: expected shape \(5,\)"):
            made(wrong)
