"""Reference data that come with the package, from experiments and exact solutions."""

from importlib import resources

import numpy as np
from numpy.typing import NDArray


def read(name: str) -> NDArray[np.float64]:
    """A table as (rows, columns); its source stands in the comments at the top of the file."""
    with (resources.files("sph_gym.scenes") / "data" / name).open() as file:
        _, *rows = (line for line in file if not line.startswith("#"))
    return np.loadtxt(rows, delimiter=",", ndmin=2)
