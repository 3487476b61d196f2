"""Gauges: what is measured again and again while a simulation runs, and where."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.checks import finite_array, instance_of, known, positive
from sph_gym.solver.geometry import disc
from sph_gym.solver.simulation import Simulation

Array = NDArray[np.float64]

# Units of the quantities, and how many numbers may say where.
UNITS = {"pressure": "Pa", "velocity": "m/s", "level": "m", "force": "N/m"}
PLACES = {"pressure": (2, 3, 4), "velocity": (2, 3, 4), "level": (1, 2)}
# Distance [dx] of the points over which a mean is taken.
EVERY = 0.5


class Gauge:
    """A quantity at a place.

    quantity: "pressure" [Pa], "velocity" [m/s], "level" [m] or "force" [N/m], as the methods of
    `Simulation` measure them.
    at: for pressure and velocity a point (x, y) [m], or an area over which the mean is taken: a
    disc (x, y, radius), or a segment (x0, y0, x1, y1), such as the face of a sensor on a wall. Dry
    parts of a face have no pressure, dry parts of a disc and of a mean velocity don't count. For a
    level x, or an interval (x0, x1) whose dry parts don't count. For a force whatever `force_on`
    takes.
    name: heads the columns; by default quantity and place.

    Raises ValueError for an unknown quantity, and for a place that isn't one.
    """

    def __init__(self, quantity: str, at: Any, name: str | None = None) -> None:
        self.quantity, self.at = known("quantity", quantity, UNITS), at
        if quantity != "force":
            self.at = finite_array("at", at if np.iterable(at) else [at], ("n",))
            self._check_place()
        label = at if isinstance(at, str) else "some particles"
        if quantity != "force":
            label = " ".join(map("{:g}".format, self.at))
        self.name = f"{quantity}:{label}" if name is None else name
        if not isinstance(self.name, str) or not self.name or "/" in self.name:
            raise ValueError(f"name: expected a text without '/', got {name!r}")

    def _check_place(self) -> None:
        wanted = PLACES[self.quantity]
        if len(self.at) not in wanted:
            numbers = " or ".join(map(str, wanted))
            raise ValueError(f"at: expected {numbers} numbers for a {self.quantity}, got {self.at}")
        if len(self.at) == 3:
            positive("radius", self.at[2])

    @classmethod
    def parse(cls, text: str) -> "Gauge":
        """Return the gauge of a text such as "pressure:1.2,0.1", or "P1=pressure:1.2,0.1".

        Raises ValueError as the class does, and for a text of another form.
        """
        name, equals, rest = text.rpartition("=")
        quantity, colon, place = rest.partition(":")
        if not (colon and place and (name or not equals)):
            raise ValueError(
                "gauge: expected QUANTITY:PLACE or NAME=QUANTITY:PLACE, such as pressure:1.2,0.1, "
                f"got {text!r}"
            )
        try:
            at: Any = place if quantity == "force" else [float(part) for part in place.split(",")]
        except ValueError:
            raise ValueError(f"gauge: expected numbers after {quantity!r}, got {place!r}") from None
        return cls(quantity, at, name or None)

    @property
    def columns(self) -> list[str]:
        """The heading of each number that `read` returns, with its unit."""
        axes = (" x", " y") if self.quantity in ("velocity", "force") else ("",)
        return [f"{self.name}{axis} [{UNITS[self.quantity]}]" for axis in axes]

    def read(self, sim: Simulation) -> Array:
        """Return the present value, (1,) or for velocity and force (2,).

        Raises ValueError for walls that the scene doesn't have.
        """
        instance_of("sim", sim, Simulation)
        if self.quantity == "force":
            return sim.force_on(self.at)
        if self.quantity == "level":
            return np.array([_mean(sim.level_at(_spread(self.at, sim.scene.dx)))])
        points = self._points(sim.scene.dx)
        if self.quantity == "velocity":
            return _mean(sim.velocity_at(points))
        p = sim.pressure_at(points)
        if len(self.at) == 3:
            p = p[np.isfinite(sim.velocity_at(points)[:, 0])]
        return np.array([p.mean() if len(p) else 0.0])

    def _points(self, dx: float) -> Array:
        """Return the points (m, 2) [m] of the place."""
        if len(self.at) == 2:
            return self.at[None]
        if len(self.at) == 3:
            x, y, radius = self.at
            return np.asarray(disc(x, y, radius, min(EVERY * dx, radius)))
        n = len(_spread(np.array([0.0, np.hypot(*(self.at[2:] - self.at[:2]))]), dx))
        shares = (np.arange(n)[:, None] + 0.5) / n
        return self.at[:2] + shares * (self.at[2:] - self.at[:2])


def _spread(interval: Array, dx: float) -> Array:
    """Return the middles (m,) [m] of equal pieces of an interval; a single number is its own."""
    if len(interval) == 1:
        return interval
    low, high = interval
    n = max(int(np.ceil(abs(high - low) / (EVERY * dx))), 1)
    return low + (np.arange(n) + 0.5) / n * (high - low)


def _mean(values: Array) -> Any:
    """Return the mean over the points that are not dry; NaN if all are."""
    wet = values[np.isfinite(values).reshape(len(values), -1).all(axis=1)]
    return wet.mean(axis=0) if len(wet) else np.full(values.shape[1:], np.nan)
