"""What solvers of many styles share: kernels by their authors' formulas, and hiding attributes."""

import numpy as np

PI = np.pi


def _up(a):
    return np.maximum(a, 0.0)


# q -> W h^2 and -W' h^3, each by its author's own formula
WEIGHTS = {
    "poly6": lambda q: 4 / PI * _up(1 - q * q) ** 3,
    "spiky": lambda q: 10 / PI * _up(1 - q) ** 3,
    "wendland": lambda q: 7 / PI * _up(1 - q) ** 4 * (1 + 4 * q),
    "wendland4": lambda q: 9 / PI * _up(1 - q) ** 6 * (1 + 6 * q + 35 / 3 * q * q),
    "cubic": lambda q: (
        40 / (7 * PI) * np.where(q < 0.5, 1 - 6 * q * q + 6 * q**3, 2 * _up(1 - q) ** 3)
    ),
    "quintic": lambda q: (
        9
        * 7
        / (478 * PI)
        * (_up(3 - 3 * q) ** 5 - 6 * _up(2 - 3 * q) ** 5 + 15 * _up(1 - 3 * q) ** 5)
    ),
    "gauss": lambda q: 9 / PI * np.exp(-9 * q * q) * (q < 1),
    # one that the doctor does not know
    "cosine": lambda q: 1 / (1 - 4 / PI**2) / PI * (1 + np.cos(PI * q)) * (q < 1),
}
SLOPES = {
    "poly6": lambda q: 24 / PI * q * _up(1 - q * q) ** 2,
    "spiky": lambda q: 30 / PI * _up(1 - q) ** 2,
    "wendland": lambda q: 140 / PI * q * _up(1 - q) ** 3,
    "wendland4": lambda q: 168 / PI * q * (1 + 5 * q) * _up(1 - q) ** 5,
    "cubic": lambda q: 40 / (7 * PI) * np.where(q < 0.5, 12 * q - 18 * q * q, 6 * _up(1 - q) ** 2),
    "quintic": lambda q: (
        9
        * 7
        / (478 * PI)
        * 15
        * (_up(3 - 3 * q) ** 4 - 6 * _up(2 - 3 * q) ** 4 + 15 * _up(1 - 3 * q) ** 4)
    ),
    "gauss": lambda q: 162 / PI * q * np.exp(-9 * q * q) * (q < 1),
    "cosine": lambda q: 1 / (1 - 4 / PI**2) * np.sin(PI * q) * (q < 1),
}


class Shown:
    """Shows x, v and step of a solver, and of the rest what is asked for."""

    def __init__(self, solver, names):
        self._solver, self._names = solver, ("x", "v", "step", *names)

    def __getattr__(self, name):
        if name in self._names:
            return getattr(self._solver, name)
        raise AttributeError(name)


def showing(make, *names):
    """Return a factory of solvers that show x, v, step and these names."""
    return lambda case: Shown(make(case), names)
