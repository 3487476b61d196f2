"""The picture on the first page: three moments of a dam break.

    python docs/opening_picture.py

writes docs/pictures/dam_break.png.
"""

from pathlib import Path

import imageio.v3 as imageio
import numpy as np

from sph_gym import Simulation, scenes
from sph_gym.view import Painter

TARGET = Path(__file__).parent / "pictures" / "dam_break.png"
MOMENTS = (0.2, 0.45, 0.9)


def draw(dx: float = 0.01) -> np.ndarray:
    """Return the picture, (height, width, 3); dx: spacing of the particles [m]."""
    scene = scenes.make("dam_break", dx=dx, tank=3.0)
    sim, painter = Simulation(scene), Painter(scene, size=480)
    pictures = []
    for until in MOMENTS:
        sim.advance(until - sim.time)
        pictures.append(painter.paint(sim))
    return np.hstack(pictures)


if __name__ == "__main__":
    imageio.imwrite(TARGET, draw())
    print(TARGET)
