"""Simulations to look at; they are shared, so tests must not move them."""

import numpy as np
import pytest

from sph_gym import Effects, Fluid, Scene, Simulation, Walls, scenes


@pytest.fixture(autouse=True)
def _no_video_driver(monkeypatch):
    monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)


def collapsed(seconds):
    sim = Simulation(scenes.make("dam_break", dx=0.05))
    sim.advance(seconds)
    return sim


@pytest.fixture(scope="session")
def early():
    return collapsed(0.1)


@pytest.fixture(scope="session")
def late():
    return collapsed(0.3)


def user_scene(x=((0.0, 0.0), (0.1, 0.0), (0.0, 0.1)), box=None, dx=0.1):
    return Scene(
        "my_own",
        x=np.array(x),
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=10.0, kernel="mueller"),
        effects=Effects(laminar_viscosity=0.1),
        walls=None if box is None else Walls(box=box),
    )
