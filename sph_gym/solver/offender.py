"""The first value of a state that no sane fluid has: whose it is, and what is around it.

For solvers of any origin: a state is a handful of arrays.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Box = tuple[float, float, float, float]

# Columns in the order of the chain, and the link that makes each.
LINKS = {
    "rho": "density",
    "p": "pressure",
    "a": "force",
    "v": "integration",
    "x": "integration",
}
UNITS = {"rho": "kg/m^3", "p": "Pa", "a": "m/s^2", "v": "m/s", "x": "m", "speed": "m/s"}
# Number of neighbours in the table of a particle's surroundings.
LISTED = 20


class State(NamedTuple):
    """The particles at one time; None for what the solver doesn't show.

    x, v: (n, 2) [m], [m/s]; rho: (n,) [kg/m^3]; p: (n,) [Pa]; a: (n, 2) [m/s^2].
    """

    x: Array
    v: Array
    rho: Array | None = None
    p: Array | None = None
    a: Array | None = None


class Limits(NamedTuple):
    """Bounds of what is still sane.

    speed: the largest [m/s]; density: the largest [kg/m^3]; box: (x_min, x_max, y_min, y_max) [m],
    infinite where there is no side: positions outside have escaped.
    """

    speed: float = math.inf
    density: float = math.inf
    box: Box | None = None


class Offender(NamedTuple):
    """A particle with a value that can't be.

    particle: its index; link: of the chain; quantity: "rho", "p", "a", "v", "x" or "speed"; value:
    in the unit of the quantity; limit: in words.
    """

    particle: int
    link: str
    quantity: str
    value: Any
    limit: str

    def __str__(self) -> str:
        value = np.array2string(np.asarray(self.value), precision=5, separator=", ")
        unit = UNITS[self.quantity]
        return (
            f"particle {self.particle}, link {self.link!r}: {self.quantity} = {value} {unit}, "
            f"expected {self.limit}"
        )


def find(state: State, limits: Limits) -> Offender | None:
    """Return the first offender of a state, None if all is sane.

    Values that are not finite come first, in the order of the chain: rho, p, a, v, x. Then come
    densities, speeds and positions beyond the limits.
    """
    return (
        not_finite(state)
        or odd_density(state, limits.density)
        or too_fast(state, limits.speed)
        or (None if limits.box is None else escaped(state, limits.box))
    )


def not_finite(state: State) -> Offender | None:
    """Return the first particle with a NaN or an infinite number, in the first column of the chain.

    Without accelerations, a velocity that is not finite is laid to the forces.
    """
    for name, link in LINKS.items():
        column = getattr(state, name)
        if column is None:
            continue
        finite = np.isfinite(column)
        if finite.all():
            continue
        i = int(np.argmin(finite.reshape(len(column), -1).all(axis=1)))
        if name == "v" and state.a is None:
            link = "force"
        return Offender(i, link, name, column[i], "a finite number")
    return None


def odd_density(state: State, most: float) -> Offender | None:
    """Return the particle with the largest density above `most`, or one without any density."""
    if state.rho is None or not len(state.rho):
        return None
    low, high = int(np.argmin(state.rho)), int(np.argmax(state.rho))
    if state.rho[high] > most:
        return Offender(high, "density", "rho", state.rho[high], f"at most {most:.4g}")
    if state.rho[low] <= 0:
        return Offender(low, "density", "rho", state.rho[low], "more than 0")
    return None


def too_fast(state: State, most: float) -> Offender | None:
    """Return the fastest particle if it is faster than `most` [m/s]."""
    if not len(state.v):
        return None
    square = np.einsum("ij,ij->i", state.v, state.v)
    i = int(np.argmax(square))
    speed = math.sqrt(float(square[i]))
    if speed <= most:
        return None
    return Offender(i, "integration", "speed", speed, f"at most {most:.4g}")


def escaped(state: State, box: Box) -> Offender | None:
    """Return the particle that is farthest outside the box, if any is outside."""
    low, high = np.array(box[::2]), np.array(box[1::2])
    beyond = np.maximum(low - state.x, state.x - high).max(axis=1)
    if not len(beyond) or beyond.max() <= 0:
        return None
    i = int(np.argmax(beyond))
    limit = f"x in [{box[0]:.4g}, {box[1]:.4g}], y in [{box[2]:.4g}, {box[3]:.4g}]"
    return Offender(i, "walls", "x", state.x[i], limit)


def neighborhood(
    state: State, particle: int, reach: float = math.inf, periods: Any = (math.inf, math.inf)
) -> list[str]:
    """Return a table of a particle and its neighbours, the nearest first.

    reach: neighbours are within it [m]; periods: lengths [m] after which space closes upon itself.
    """
    way = state.x - state.x[particle]
    for axis, period in enumerate(periods):
        if math.isfinite(period):
            way[:, axis] -= period * np.round(way[:, axis] / period)
    distance = np.hypot(*way.T)
    distance[particle] = 0.0
    near = np.flatnonzero(distance < reach)
    near = near[np.argsort(distance[near], kind="stable")]
    near = np.concatenate([[particle], near[near != particle]])
    columns = _columns(state, distance)
    widths = [max(len(name), 11) for name in columns]
    lines = ["  ".join(f"{name:>{width}}" for name, width in zip(columns, widths, strict=True))]
    for j in near[: LISTED + 1]:
        cells = zip(columns.values(), widths, strict=True)
        lines.append("  ".join(f"{column[j]:{width}.5g}" for column, width in cells))
    within = f" within {reach:.4g} m" if math.isfinite(reach) else ""
    shown = f", the nearest {LISTED} are shown" if len(near) > LISTED + 1 else ""
    return [*lines, f"{len(near) - 1} neighbours of particle {particle}{within}{shown}"]


def _columns(state: State, distance: Array) -> dict[str, Array]:
    """Return the columns of the table by heading; vectors but for x by their size."""
    found = {"particle": np.arange(len(distance)), "distance [m]": distance}
    found |= {"x [m]": state.x[:, 0], "y [m]": state.x[:, 1]}
    for name, heading in (("rho", "rho"), ("p", "p"), ("v", "speed"), ("a", "|a|")):
        column = getattr(state, name)
        if column is not None:
            size = np.linalg.norm(column, axis=1) if column.ndim == 2 else column
            found[f"{heading} [{UNITS[name]}]"] = size
    return found
