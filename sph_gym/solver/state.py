"""What the solver holds: particles as a struct of arrays, the fluid, the controls."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
Indices = NDArray[np.int32]


class Particles(NamedTuple):
    """Fluid particles in the order of their cells; `id` is their place in the public order.

    x, y: (n,) [m]; u, v: (n,) velocity [m/s]; rho: (n,) [kg/m^3]; stress: (n,) p / rho^2
    [m^5/(kg s^2)], the form in which the symmetric pressure force wants it; id: (n,) int32.
    """

    x: Floats
    y: Floats
    u: Floats
    v: Floats
    rho: Floats
    stress: Floats
    id: Indices


class WallParticles(NamedTuple):
    """Boundary particles in the order of their cells; the same fields and units as the fluid's.

    wall_sum: (n,) the part of the kernel sum that comes from other wall particles, which is the
    same in every step of a wall at rest; by public index, unlike the rest.
    """

    x: Floats
    y: Floats
    u: Floats
    v: Floats
    rho: Floats
    stress: Floats
    id: Indices
    wall_sum: Floats


class Controls(NamedTuple):
    """What an agent may change while the solver runs: s, Pa (Tait's B), dimensionless."""

    dt: float
    stiffness: float
    xsph: float


def allocate_particles(x: Floats, v: Floats, dtype: type) -> Particles:
    """Particles at x (n, 2) [m] with velocity v (n, 2) [m/s], in the order given.

    Raises ValueError for numbers that `dtype` can't hold.
    """
    n = len(x)
    with np.errstate(over="ignore"):
        columns: list[Any] = [np.array(a, dtype) for a in (*x.T, *v.T)]
    if not all(np.isfinite(column).all() for column in columns):
        raise ValueError(f"x, v: expected numbers in the range of {np.dtype(dtype).name}")
    columns += [np.ones(n, dtype), np.zeros(n, dtype), np.arange(n, dtype=np.int32)]
    return Particles(*columns)


def empty_like(particles: Particles) -> Particles:
    """A second set of arrays of the same shapes and types."""
    return particles._replace(**{k: np.empty_like(a) for k, a in particles._asdict().items()})
