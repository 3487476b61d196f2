"""The numbers of some particles, read again and again while a simulation runs."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.checks import known, whole
from sph_gym.solver.simulation import Simulation

# Quantities, the units of them, and of vectors the axes.
UNITS = {"rho": "kg/m^3", "p": "Pa", "x": "m", "v": "m/s", "a": "m/s^2"}
VECTORS = ("x", "v", "a")


class ParticleLog:
    """Quantities of particles, as columns of a table; it is read as a `Gauge` is.

    quantities: any of "rho" [kg/m^3], "p" [Pa], "x" [m], "v" [m/s] and "a" [m/s^2]; particles:
    indices in the order of the scene, fluid first. Raises ValueError for unknown quantities, for
    none at all and for indices below 0.
    """

    def __init__(self, quantities: Sequence[str], particles: Sequence[int]) -> None:
        self.quantities = [known("log", name, UNITS) for name in quantities]
        self.particles = [whole("particles", i) for i in particles]
        if not self.quantities or not self.particles:
            raise ValueError("log: expected at least one quantity and one particle, got none")

    @classmethod
    def parse(cls, quantities: str, particles: str) -> "ParticleLog":
        """Return the log of texts such as "rho,p" and "10,200".

        Raises ValueError as the class does, and for texts of another form.
        """
        try:
            indices = [int(part) for part in particles.split(",")]
        except ValueError:
            raise ValueError(
                f"particles: expected indices such as 10,200, got {particles!r}"
            ) from None
        return cls(quantities.split(","), indices)

    @property
    def columns(self) -> list[str]:
        """The heading of each number that `read` returns, with its unit."""
        return [
            f"{name}{axis} #{i} [{UNITS[name]}]"
            for i in self.particles
            for name in self.quantities
            for axis in ((" x", " y") if name in VECTORS else ("",))
        ]

    def check(self, sim: Simulation) -> None:
        """Raise ValueError if the simulation doesn't have all of the particles."""
        for i in self.particles:
            if i >= sim.n_particles:
                raise ValueError(
                    f"particles: expected indices below {sim.n_particles}, of which those below "
                    f"{sim.n_fluid} are fluid, got {i}"
                )

    def read(self, sim: Simulation) -> NDArray[np.float64]:
        """Return the present values (n,), in the order of `columns`."""
        values = {name: np.asarray(getattr(sim, name), np.float64) for name in self.quantities}
        parts = [np.atleast_1d(values[name][i]) for i in self.particles for name in self.quantities]
        return np.concatenate(parts)
