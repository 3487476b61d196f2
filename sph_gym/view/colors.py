"""Colour maps, and the quantities by which particles can be coloured."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sph_gym.solver.checks import known
from sph_gym.solver.diagnostics import CLUMPED
from sph_gym.solver.scene import Scene
from sph_gym.view.state import Shown, columns_of, spacings

Rgb = tuple[int, int, int]
Bytes = NDArray[np.uint8]

PAGE: Rgb = (248, 248, 246)
DOMAIN: Rgb = (255, 255, 255)
RULE: Rgb = (214, 217, 221)
INK: Rgb = (38, 44, 54)
MUTED: Rgb = (116, 123, 134)
WALL: Rgb = (201, 205, 211)
EDGE: Rgb = (112, 119, 130)
ARROW: Rgb = (214, 40, 57)
VELOCITY: Rgb = (20, 90, 170)
# Particles whose value isn't a number, and the index at which a palette has this colour.
BAD: Rgb = (255, 0, 144)
BAD_INDEX = 256
# A distance [dx] that stands for "no particle near".
FAR = 100.0


def interpolated(anchors: str) -> Bytes:
    """Return a (256, 3) look-up table through evenly spaced sRGB colours in hexadecimal."""
    table = np.array([list(bytes.fromhex(anchor)) for anchor in anchors.split()], dtype=float)
    at = np.linspace(0.0, len(table) - 1.0, 256)
    columns = [np.interp(at, np.arange(len(table)), column) for column in table.T]
    return np.stack(columns, axis=-1).round().astype(np.uint8)


# Every 15th entry of viridis: lightness rises evenly, also for colour-blind eyes.
# Source: S. van der Walt and N. Smith, matplotlib, CC0.
VIRIDIS = interpolated(
    "440154 481769 472a7a 433d84 3d4e8a 355e8d 2e6d8e 297b8e 23898e "
    "1f978b 21a585 2eb37c 46c06f 65cb5e 89d548 b0dd2f d8e219 fde725"
)
# Two straight lines in CIELAB that meet in a neutral grey. Lightness rises all the way, so that
# too thin and too dense stay apart in greyscale; blue and amber stay apart for colour-blind eyes.
BLUE_AMBER = interpolated(
    "004290 365090 526091 696f91 7d8091 919191 aa9e89 c2ac80 d9ba76 f0c86b ffd75e"
)


class Quantity(NamedTuple):
    """A quantity by which particles are coloured.

    label and unit ("" for a bare number) as they stand at the colour bar; palette: (256, 3)
    uint8; values: of a state, (n_fluid,) in that unit; limits: of a scene, the values at
    the ends of the palette, fixed for a run so that a colour means the same in every frame;
    needs: columns that a recording must have for it.
    """

    label: str
    unit: str
    palette: Bytes
    values: Callable[[Shown], NDArray[Any]]
    limits: Callable[[Scene], tuple[float, float]]
    needs: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Label and unit in one string."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label


def velocity_scale(scene: Scene) -> float:
    """Return the largest speed [m/s] that the scene was made for, a tenth of its sound speed."""
    return scene.fluid.c0 / 10.0


def _pressure_limits(scene: Scene) -> tuple[float, float]:
    # what a compression by 1 % costs at the nominal stiffness: weakly compressible means below
    return 0.0, scene.fluid.rho0 * velocity_scale(scene) ** 2


def _neighbor_limits(scene: Scene) -> tuple[float, float]:
    on_lattice = math.pi * (scene.h / scene.dx) ** 2
    return 0.0, float(math.ceil(1.5 * on_lattice))


def _speed(state: Shown) -> NDArray[Any]:
    return np.hypot(*state.v[: state.n_fluid].T)


def _density(state: Shown) -> NDArray[Any]:
    return state.rho[: state.n_fluid] / state.scene.fluid.rho0


def _density_error(state: Shown) -> NDArray[Any]:
    # not np.fmax: NaN must stay visible
    return 100 * np.maximum(_density(state) - 1.0, 0.0)


def _near(state: Shown) -> NDArray[Any]:
    # lone particles have no nearest one: as far as can be is the honest colour, not "no number"
    return np.minimum(spacings(state), FAR)


def _energy(state: Shown) -> NDArray[Any]:
    """Return the energy per mass: kinetic, and elastic as in sound, c^2 (rho/rho0 - 1)^2 / 2.

    A recording without densities or stiffness shows the kinetic part alone.
    """
    kinetic = 0.5 * _speed(state) ** 2
    if "rho" not in columns_of(state) or not math.isfinite(state.sound_speed):
        return kinetic
    strain = _density(state) - 1.0
    if state.scene.fluid.clamp:
        strain = np.maximum(strain, 0.0)
    return kinetic + 0.5 * (state.sound_speed * strain) ** 2


QUANTITIES: dict[str, Quantity] = {
    "speed": Quantity("speed", "m/s", VIRIDIS, _speed, lambda scene: (0.0, velocity_scale(scene))),
    "density": Quantity(
        "density / rest density", "", BLUE_AMBER, _density, lambda scene: (0.9, 1.1), ("rho",)
    ),
    "density_error": Quantity(
        "density above rest", "%", VIRIDIS, _density_error, lambda scene: (0.0, 5.0), ("rho",)
    ),
    "pressure": Quantity(
        "pressure", "Pa", VIRIDIS, lambda state: state.p[: state.n_fluid], _pressure_limits, ("p",)
    ),
    "neighbors": Quantity(
        "neighbours", "", VIRIDIS, lambda state: state.neighbor_counts, _neighbor_limits
    ),
    # the scale ends where particles count as clumped, so that these stand out as its first colour
    "clumping": Quantity(
        "distance to the nearest / dx", "", VIRIDIS, _near, lambda scene: (CLUMPED, 1.0)
    ),
    "energy": Quantity(
        "kinetic + elastic energy",
        "J/kg",
        VIRIDIS,
        _energy,
        lambda scene: (0.0, 0.5 * velocity_scale(scene) ** 2),
    ),
}


def available(state: Shown) -> list[str]:
    """Return the names of the quantities that a state can show, in the order of `QUANTITIES`."""
    columns = columns_of(state)
    return [name for name, shown in QUANTITIES.items() if columns.issuperset(shown.needs)]


def quantity(name: str) -> Quantity:
    """Return the quantity called `name`; ValueError that lists the known ones if there is none."""
    return QUANTITIES[known("color", name, QUANTITIES)]


def palette_index(values: ArrayLike, limits: tuple[float, float]) -> NDArray[np.int64]:
    """Return where (n,) values stand between the limits, 0 to 255; `BAD_INDEX` if not finite."""
    given = np.asarray(values, dtype=float)
    finite = np.isfinite(given)
    low, high = limits
    share = (np.where(finite, given, low) - low) / (high - low)
    return np.where(finite, (np.clip(share, 0.0, 1.0) * 255).round(), BAD_INDEX).astype(np.int64)


def ticks(limits: tuple[float, float], n_max: int) -> tuple[list[float], int]:
    """Return at most `n_max` round numbers within the limits (always one), and their decimals."""
    low, high = limits
    exponent = math.floor(math.log10((high - low) / max(n_max, 1))) - 1
    steps = (base * 10.0**power for power in range(exponent, exponent + 4) for base in (1, 2, 5))
    for step in steps:
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first < max(n_max, 1):
            break
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return [i * step for i in range(first, last + 1)] or [low], decimals
