"""The state: particles as a struct of arrays, and the controls."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.target import MOST_LANES

Floats = NDArray[np.floating]
Indices = NDArray[np.int32]


class Particles(NamedTuple):
    """Fluid or boundary particles; `id` is their place in the public order of their kind.

    x, y: [m]; u, v: velocity [m/s]; rho: [kg/m^3]; stress: p / rho^2 [m^5/(kg s^2)], the form in
    which the symmetric pressure force wants it; id: (n,) int32. All but `id` are columns (see
    `column`): only their first n entries count.

    The rest is needed by some scenes only; where it is not needed, it is None. ax, ay [m/s^2],
    tx, ty [m/s] and growth [kg/(m^3 s)]: the rates at the last evaluation, see `integrators.Rates`;
    offset: density less the kernel sum [kg/m^3], where densities follow the continuity equation;
    nx, ny: n / sqrt|n|, n the gradient of the share of space that is filled [1/m], where surfaces
    have tension;
    ghost_u, ghost_v: of wall particles, the velocity [m/s] that viscosity sees.
    """

    x: Floats
    y: Floats
    u: Floats
    v: Floats
    rho: Floats
    stress: Floats
    id: Indices
    ax: Any = None
    ay: Any = None
    tx: Any = None
    ty: Any = None
    growth: Any = None
    offset: Any = None
    nx: Any = None
    ny: Any = None
    ghost_u: Any = None
    ghost_v: Any = None


class Controls(NamedTuple):
    """The numbers that an agent may change: dt [s], stiffness (Tait's B) [Pa], XSPH epsilon."""

    dt: float
    stiffness: float
    xsph: float


def column(n: int, dtype: Any) -> NDArray[Any]:
    """n numbers, and spare ones behind them that the last load of a loop over lanes may touch."""
    return np.zeros(n + MOST_LANES, dtype)


def allocate_particles(x: Floats, v: Floats, dtype: type, more: Iterable[str] = ()) -> Particles:
    """Particles at x (n, 2) [m] with velocity v (n, 2) [m/s], in the order given.

    more: names of optional columns that are needed.
    """
    n = len(x)
    columns: list[Any] = [column(n, dtype) for _ in range(6)]
    for place, values in zip(columns, (*x.T, *v.T), strict=False):
        place[:n] = values
    columns.append(np.arange(n, dtype=np.int32))
    return Particles(*columns, **{name: column(n, dtype) for name in more})


def empty_like(particles: Any) -> Any:
    """A second set of arrays of the same shapes and types."""
    present = {name: array for name, array in particles._asdict().items() if array is not None}
    return particles._replace(**{name: np.zeros_like(array) for name, array in present.items()})


def state_like(particles: Any) -> Any:
    """Return arrays for the columns that make the state; all else follows from them."""
    return empty_like(particles._replace(rho=None, stress=None, nx=None, ny=None))
