"""A small exported policy network: plain numbers, evaluated by one compiled function."""

import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from sph_gym.controllers import perceptron
from sph_gym.files import atomic_write

ACTIVATIONS = {"tanh": perceptron.TANH, "relu": perceptron.RELU}
SQUASH = {"clip": perceptron.CLIPPED, "tanh": perceptron.TANH, "none": perceptron.LINEAR}
# Parts of a file that are texts.
TEXTS = ("activation", "squash", "observation", "action")
# Networks that come with the package.
SHIPPED = Path(__file__).parent / "networks"
# The largest action of all.
HIGHEST = (1.0, 1.0, 1.0)
Floats = NDArray[np.float32]


def shipped_network(algorithm: str, scene: str) -> Path:
    """Return where the package has the network of an algorithm for a scene, if it has one."""
    return SHIPPED / f"{algorithm}_{scene}.npz"


@dataclass(frozen=True)
class Network:
    """A multilayer perceptron with tanh or relu units.

    weights, biases: one (n_out, n_in) and (n_out,) array a layer; activation: "tanh" or "relu"
    between layers; squash: how the last layer becomes an action in [-1, 1], "clip" or "tanh", or
    "none" if it holds the values of discrete actions; observation, action: the layouts with their
    versions that it was trained with, as `sph_gym.env.layouts` names them; highest: largest action
    (3,) that is clipped to, such as one that keeps the time step short enough for impacts.
    """

    weights: tuple[Floats, ...]
    biases: tuple[Floats, ...]
    activation: str
    squash: str
    observation: str = ""
    action: str = ""
    highest: tuple[float, ...] = HIGHEST

    def __call__(self, observation: Floats) -> Floats:
        """Return the action (3,) for an observation (n,), or the values of discrete ones.

        Raises ValueError for an observation of another shape.
        """
        shape, n = np.shape(observation), self.weights[0].shape[1]
        if shape != (n,):
            raise ValueError(f"observation: expected shape ({n},), got {shape}")
        parameters, layers, widest = self._packed
        # of this call alone: episodes on other threads may share the network
        values = np.empty((2, widest), np.float32)
        values[0, :n] = observation
        perceptron.propagate(parameters, layers, values)
        return values[len(self.weights) % 2, : self.biases[-1].size]

    @cached_property
    def _packed(self) -> tuple[Floats, NDArray[np.int64], int]:
        """Parameters and layers as the compiled function takes them, units of the widest layer."""
        hidden, last = ACTIVATIONS[self.activation], SQUASH[self.squash]
        packed = perceptron.pack(self.weights, self.biases, hidden, last, self.highest)
        return *packed, int(packed[1][:, perceptron.UNITS].max())

    def save(self, path: str | Path) -> None:
        """Write a .npz file that `load` reads; a kill leaves all of it or what was there before."""
        layers: dict[str, Any] = {f"weight{k}": w for k, w in enumerate(self.weights)}
        layers |= {f"bias{k}": b for k, b in enumerate(self.biases)}
        texts = {name: getattr(self, name) for name in TEXTS}
        with atomic_write(path) as draft:
            np.savez_compressed(draft, **texts, **layers, highest=np.array(self.highest))

    @staticmethod
    def load(path: str | Path) -> "Network":
        """Read a .npz file; it holds numbers only, no code is run.

        Raises ValueError if the file is no exported network, a damaged one, or one that doesn't
        say which observations and actions it was trained with.
        """
        try:
            with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as data:
                n_layers = sum(name.startswith("weight") for name in data.files)
                weights = tuple(data[f"weight{k}"] for k in range(n_layers))
                biases = tuple(data[f"bias{k}"] for k in range(n_layers))
                # files of drafts of the environments have no layouts
                texts = {name: str(data[name]) for name in TEXTS if name in data.files}
                activation, squash = texts["activation"], texts["squash"]
                highest = tuple(data["highest"].astype(float).tolist())
        except (OSError, ValueError, KeyError, EOFError, BadZipFile, zlib.error) as error:
            # numpy's advice for files that it can't read is to load pickles
            reason = f" ({error.strerror})" if isinstance(error, OSError) else ""
            raise ValueError(f"path: {path} is no exported network{reason}") from None
        known = squash in SQUASH and activation in ACTIVATIONS
        if not (known and weights and _fit(weights, biases) and _is_bound(highest)):
            raise ValueError(f"path: {path} is no exported network")
        if not (texts.get("observation") and texts.get("action")):
            raise ValueError(
                f"path: {path} doesn't say which observations and actions it was trained with: "
                "train it anew, or export it with `observation` and `action`"
            )
        return Network(weights, biases, **texts, highest=highest)

    def check(self, observation: str, action: str) -> None:
        """Raise ValueError unless it was trained with these layouts of observation and action."""
        for what, own, here in (
            ("observations", self.observation, observation),
            ("actions", self.action, action),
        ):
            if own != here:
                raise ValueError(
                    f"network: it was trained with {what} {own or 'unknown'!r}, but those of this "
                    f"environment are {here!r}: choose a network that fits, or train one anew"
                )


def _is_bound(highest: tuple[float, ...]) -> bool:
    """Return whether these can be the largest values of the three controls."""
    return len(highest) == len(HIGHEST) and all(-1.0 <= value <= 1.0 for value in highest)


def _fit(weights: tuple[Floats, ...], biases: tuple[Floats, ...]) -> bool:
    """Return whether all numbers are finite and every layer takes what the one before gives."""
    if not all(part.dtype.kind == "f" and np.isfinite(part).all() for part in weights + biases):
        return False
    if not all(weight.ndim == 2 for weight in weights):
        return False
    rows = [weight.shape[0] for weight in weights]
    columns = [weight.shape[1] for weight in weights]
    return rows[:-1] == columns[1:] and [bias.shape for bias in biases] == [(n,) for n in rows]
