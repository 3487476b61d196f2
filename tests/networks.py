"""Small networks of random numbers, with the layouts of the present environments."""

import numpy as np

from sph_gym.controllers import Network
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.rules import Rules


def tiny(n_out=3, squash="tanh", seed=0, **rules):
    """A network of one hidden layer; rules: arguments of the environment that it is for."""
    chosen = Rules(**rules)
    n_in = len(chosen.observations.rows)
    rng = np.random.default_rng(seed)
    first, last = rng.normal(0.0, 0.3, (8, n_in)), rng.normal(0.0, 0.3, (n_out, 8))
    return Network(
        (first.astype(np.float32), last.astype(np.float32)),
        (np.zeros(8, np.float32), np.zeros(n_out, np.float32)),
        "tanh",
        squash,
        observation_layout(chosen),
        action_layout("discrete" if squash == "none" else chosen.action_mode),
    )
