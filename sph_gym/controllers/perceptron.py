"""A multilayer perceptron as one compiled function: a network is asked in every step."""

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.jit import jit, jitable

# Kinds of units; what a clipped one gives is between -1 and a number of its own.
LINEAR, RELU, TANH, CLIPPED = 0, 1, 2, 3
# tanh x = x P(x^2) / Q(x^2) for |x| <= END, lowest powers first: a least squares fit, weighted so
# that the relative error is the same everywhere. In single precision it is off by at most 6e-7. A
# loop over it becomes vector instructions, a loop over the mathematical library's tanh does not.
END = np.float32(8.0)
P = tuple(map(np.float32, (0.99999976, 0.12712315, 0.0026964126, 7.1625213e-06, -6.1423298e-09)))
Q = tuple(map(np.float32, (1.0, 0.46045476, 0.022850314, 0.00019674556)))
ONE = np.float32(1.0)
# Columns of an array of layers.
UNITS, KIND = 0, 1
Floats = NDArray[np.float32]


@jitable
def tanh(x):
    """Return the hyperbolic tangent in single precision."""
    x = min(max(x, -END), END)
    y = x * x
    p = P[0] + y * (P[1] + y * (P[2] + y * (P[3] + y * P[4])))
    q = Q[0] + y * (Q[1] + y * (Q[2] + y * Q[3]))
    # rounding may end beyond 1
    return min(max(x * p / q, -ONE), ONE)


@jitable
def _activate(values, kind, highest):
    """Replace the sums that units have received by what they give; highest: of clipped ones."""
    if kind == RELU:
        for i in range(values.size):
            values[i] = max(values[i], np.float32(0.0))
    elif kind == TANH:
        for i in range(values.size):
            values[i] = tanh(values[i])
    elif kind == CLIPPED:
        for i in range(values.size):
            values[i] = min(max(values[i], -ONE), highest[i])


@jit
def propagate(parameters, layers, values):
    """Compute the layers of a perceptron, each from the one before.

    parameters, layers: of `pack`; values (2, at least the most units), float32: row 0 begins with
    the input, and afterwards row (layers after the input) % 2 with the last layer. Each unit adds
    in the order of its inputs, so that sums don't depend on the width of vectors.
    """
    place = 0
    for k in range(1, len(layers)):
        n_in, n_out = layers[k - 1, UNITS], layers[k, UNITS]
        source, target = values[(k - 1) % 2], values[k % 2, :n_out]
        for i in range(n_out):
            target[i] = parameters[place + i]
        for j in range(n_in):
            place += n_out
            x = source[j]
            for i in range(n_out):
                target[i] += parameters[place + i] * x
        place += n_out
        _activate(target, layers[k, KIND], parameters[place:])


def pack(
    weights: tuple[Floats, ...],
    biases: tuple[Floats, ...],
    hidden: int,
    last: int,
    highest: tuple[float, ...],
) -> tuple[Floats, NDArray[np.int64]]:
    """Return parameters and layers as `propagate` takes them.

    weights, biases: (n_out, n_in) and (n_out,) a layer; hidden, last: kinds of the units of the
    layers between and of the last one; highest: of clipped units of the last layer.
    """
    # of each layer the biases, and then the weights of each input
    rows = [
        np.vstack([bias, weight.T]).ravel() for weight, bias in zip(weights, biases, strict=True)
    ]
    parameters = np.concatenate([*rows, highest]).astype(np.float32)
    kinds = [LINEAR, *[hidden] * (len(biases) - 1), last]
    sizes = [weights[0].shape[1], *(bias.size for bias in biases)]
    return parameters, np.array([sizes, kinds]).T.copy()
