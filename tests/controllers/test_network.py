import itertools

import numpy as np
import pytest

from sph_gym.controllers import Network


def network(activation="tanh", squash="clip"):
    rng = np.random.default_rng(0)
    sizes = (5, 8, 3)
    weights = tuple(
        rng.normal(size=(n_out, n_in)).astype(np.float32)
        for n_in, n_out in itertools.pairwise(sizes)
    )
    biases = tuple(rng.normal(size=n).astype(np.float32) for n in sizes[1:])
    return Network(weights, biases, activation, squash)


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


def test_one_layer_by_hand():
    one = Network((np.eye(3, dtype=np.float32),), (np.ones(3, np.float32),), "tanh", "clip")
    assert np.array_equal(one(np.array([-1.0, -0.5, 3.0])), [0.0, 0.5, 1.0])


def test_files_that_are_no_networks_are_refused(tmp_path):
    (tmp_path / "text.npz").write_text("hello")
    np.savez(tmp_path / "other.npz", a=np.ones(3))
    np.savez(tmp_path / "pickle.npz", weight0=np.array([object()]))
    for name in ("text.npz", "other.npz", "pickle.npz", "missing.npz"):
        with pytest.raises(ValueError, match="no exported network"):
            Network.load(tmp_path / name)
