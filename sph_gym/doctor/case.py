"""The case that a solver is asked to set up, and the arrangements of particles for it."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The doctor's own fluid. The spacing is far from 1 m, so that a constant of three dimensions, which
# is wrong by a factor of about 1 / h, stands out; c0 leaves round numbers such as 10 v alone.
DX = 0.04
RHO0 = 1000.0
C0 = 20.0
GAMMA = 7.0
# Neighbours at rest: about 28. Where a check needs others, it says so.
SUPPORT = 3.0
H = SUPPORT * DX
# Tait's B [Pa] of this fluid.
TAIT = RHO0 * C0**2 / GAMMA


def tait_energy(ratio: Any, gamma: float) -> Any:
    """Return the energy of compression by Tait's equation [B / rho0]; ratio: rho / rho0."""
    if gamma == 1:
        return np.log(ratio) + 1 / ratio - 1
    return (ratio ** (gamma - 1) - 1) / (gamma - 1) + 1 / ratio - 1


@dataclass
class Case:
    """A setting that a solver is to simulate.

    x, v: (n, 2) positions [m] and velocities [m/s], in the order that the solver has to keep;
    dx: spacing of particles at rest [m]; h: SUPPORT radius of the kernel [m], W = 0 beyond it;
    rho0: density at rest [kg/m^3]; c0: speed of sound at rest [m/s]; gamma: exponent of Tait's
    equation; gravity: (2,) [m/s^2]; box: None for open space, or (x_min, x_max, y_min, y_max) [m],
    infinite where there is no wall; xsph: epsilon, 0 for none; viscosity: kinematic viscosity nu
    [m^2/s], 0 for none.
    """

    x: Array
    v: Array
    dx: float = DX
    h: float = SUPPORT * DX
    rho0: float = RHO0
    c0: float = C0
    gamma: float = GAMMA
    gravity: Array = field(default_factory=lambda: np.zeros(2))
    box: tuple[float, float, float, float] | None = None
    xsph: float = 0.0
    viscosity: float = 0.0

    @property
    def n(self) -> int:
        """Return the number of particles."""
        return len(self.x)

    @property
    def dt(self) -> float:
        """Return a cautious time step [s]: a tenth of what sound takes across the support.

        With viscosity, at most 0.05 h^2 / nu.
        """
        steps = [0.1 * self.h / self.c0]
        if self.viscosity:
            steps.append(0.05 * self.h**2 / self.viscosity)
        return min(steps)

    def copy(self) -> "Case":
        """Return the case with arrays of its own, which a solver may write to."""
        return replace(
            self, x=self.x.copy(), v=self.v.copy(), gravity=np.array(self.gravity, dtype=float)
        )


def case(x: Any, v: Any = None, **others: Any) -> Case:
    """Return a case of the doctor's fluid; v: (n, 2) or one velocity for all, by default 0."""
    x = np.array(x, dtype=float).reshape(-1, 2)
    v = np.zeros_like(x) if v is None else np.array(np.broadcast_to(v, x.shape), dtype=float)
    if "gravity" in others:
        others["gravity"] = np.array(others["gravity"], dtype=float)
    return Case(x, v, **others)


def lattice(columns: int, rows: int, spacing: float = DX, center: Any = (0.0, 0.0)) -> Array:
    """Return (columns * rows, 2) positions of a square lattice around `center`."""
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    grid = np.stack([i.ravel(), j.ravel()], axis=1).astype(float)
    return (grid - grid.mean(axis=0)) * spacing + np.asarray(center, dtype=float)


def cloud(
    rng: np.random.Generator, columns: int, rows: int, spacing: float, jitter: float
) -> Array:
    """Return a lattice in disorder, each particle moved by up to `jitter` spacings a direction."""
    x = lattice(columns, rows, spacing)
    return x + rng.uniform(-jitter, jitter, x.shape) * spacing


def interior(x: Array, margin: float) -> NDArray[np.bool_]:
    """Return which particles are at least `margin` [m] inside the rectangle around all of them."""
    low, high = x.min(axis=0), x.max(axis=0)
    return np.asarray(np.all((x >= low + margin) & (x <= high - margin), axis=1))


def all_finite(*arrays: Any) -> bool:
    """Return whether all numbers of these arrays are finite."""
    return all(bool(np.isfinite(each).all()) for each in arrays)
