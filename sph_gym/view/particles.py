"""Particles as discs that are drawn once for each colour and copied from then on."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sph_gym.view.toolkit import load, sprite

if TYPE_CHECKING:
    from pygame import Surface

# Discs are kept for this many positions within a pixel, each way: on whole pixels a lattice
# would show beats, and slow particles would jump.
PHASES = 4
# Larger discs are placed on whole pixels: the difference can't be seen, and they take much room.
LARGE = 24.0
# Diameter [pixels] from which discs have a darker rim, and how dark it is.
RIMMED, RIM = 5.0, 0.22


class Discs:
    """Antialiased discs in the colours of a palette.

    palette: (k, 3) uint8; diameter: [pixels]; rim: whether large ones have a darker rim.
    """

    def __init__(self, palette: ArrayLike, diameter: float, rim: bool = True) -> None:
        self.diameter = diameter
        self._rim = RIM if rim and diameter >= RIMMED else 0.0
        self._palette = np.asarray(palette, dtype=float)
        self._phases = PHASES if diameter < LARGE else 1
        self._half = math.ceil(diameter / 2 + 0.5)
        self._alpha, self._shade = self._masks()
        self._sprites = np.empty((len(self._palette), self._phases**2), object)
        self._drawn = np.zeros(len(self._palette), bool)

    def _masks(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return coverage and brightness of all phases side by side, each (phases^2 side, side)."""
        side = 2 * self._half + 1
        phase = np.arange(self._phases) / self._phases
        centre = self._half + phase
        offset = np.arange(side) + 0.5 - centre[:, None]
        y_phase, x_phase = np.divmod(np.arange(self._phases**2), self._phases)
        across, down = offset[x_phase], offset[y_phase]
        distance = np.hypot(across[:, :, None], down[:, None, :]).reshape(-1, side)
        radius = self.diameter / 2
        shade = 1.0 - self._rim * np.clip(distance - radius + 1.5, 0.0, 1.0)
        return np.clip(radius - distance + 0.5, 0.0, 1.0), shade

    def draw(self, surface: "Surface", at: NDArray[Any], index: NDArray[Any]) -> None:
        """Draw discs at (n, 2) pixels in the colours (n,) of the palette.

        Those outside the surface are left out, and those whose position isn't a number.
        """
        size = np.array(surface.get_size())
        with np.errstate(invalid="ignore"):
            inside = ((at > -self._half) & (at < size + self._half)).all(axis=1)
        at, chosen = (at, index) if inside.all() else (at[inside], index[inside])
        steps = np.floor(at * self._phases + 0.5).astype(np.int64)
        pixel = steps // self._phases
        phase = steps - pixel * self._phases
        variant = phase[:, 1] * self._phases + phase[:, 0]
        if not self._drawn[chosen].all():
            self._prepare(chosen)
        sprites = self._sprites.ravel().take(chosen * self._phases**2 + variant).tolist()
        # pairs of plain numbers, since 5,000 small lists would keep the garbage collector busy
        left, top = (pixel - self._half).T.tolist()
        surface.fblits(list(zip(sprites, zip(left, top, strict=True), strict=True)))

    def _prepare(self, chosen: NDArray[Any]) -> None:
        """Draw the discs of the colours that weren't wanted before."""
        wanted = np.unique(chosen)
        for index in wanted[~self._drawn[wanted]].tolist():
            self._sprites[index] = self._make_sprites(index)
            self._drawn[index] = True

    def _make_sprites(self, index: int) -> "list[Surface]":
        """Return one disc for each phase, cut out of one surface."""
        pygame = load()
        whole = sprite(self._shade[:, :, None] * self._palette[index], 255 * self._alpha)
        side = self._alpha.shape[1]
        return [
            whole.subsurface(pygame.Rect(k * side, 0, side, side)) for k in range(self._phases**2)
        ]
