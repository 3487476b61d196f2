"""Hard cases at walls that must hold alone: jets and strays against particles and plates."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from sph_gym.solver.geometry import lattice
from sph_gym.solver.scene import Effects, Fluid, Scene
from sph_gym.solver.walls import Walls
from sph_gym.studies.stability.case import Case
from sph_gym.studies.stability.events import turned

DX = 0.02
SPEED = 5.0
HALF = 0.4
FRAME = 8


def stream(x: Any, v: Any, dx: float, walls: Walls, c0: float = 10 * SPEED) -> Scene:
    """Water that moves at some 5 m/s, without gravity."""
    return Scene(
        "hard case",
        x=x,
        v=v,
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=c0),
        effects=Effects(xsph=True, artificial_viscosity=0.05),
        walls=walls,
        frame=FRAME * 0.4 * 2.6 * dx / c0,
    )


def floor(dx: float) -> Any:
    """Three layers of boundary particles below y = 0."""
    return lattice(-HALF, HALF, -3 * dx, 0.0, dx)


def corner(dx: float) -> Any:
    """The same, and as many to the left of x = - HALF."""
    side = lattice(-HALF - 3 * dx, -HALF, -3 * dx, 2 * HALF, dx)
    return np.concatenate([floor(dx), side])


def plates(dx: float) -> Any:
    """Plates on the faces of the two walls."""
    return [(-HALF, 0.0, HALF, 0.0), (-HALF, 0.0, -HALF, 2 * HALF)]


def thin_jet(dx: float, held: bool) -> Scene:
    """Three particles wide, onto boundary particles with or without a plate at their face."""
    jet = lattice(-1.5 * dx, 1.5 * dx, 2 * dx, 0.6, dx)
    walls = Walls(floor(dx), plates=plates(dx)[:1] if held else None)
    return stream(jet, np.tile((0.0, -SPEED), (len(jet), 1)), dx, walls)


def corner_jet(dx: float, held: bool) -> Scene:
    """A jet of eight particles that slants into a corner."""
    jet = lattice(-HALF + 2 * dx, -HALF + 10 * dx, 2 * dx, 0.6, dx)
    v = np.tile((-0.5 * SPEED, -SPEED), (len(jet), 1))
    walls = Walls(corner(dx), plates=plates(dx) if held else None)
    return stream(jet, v, dx, walls)


def strays(dx: float) -> Scene:
    """Single particles at 100 m/s, in all directions, within plates and far above other walls.

    At half the speed of sound: who meets head-on comes closer by 0.4 h in a stable step. At Mach 2
    it would be 1.6 h, and who is found in the middle of another by then flies apart with up to 0.6
    of the energy at stake, from nowhere, by the article's kernels.
    """
    angles = np.linspace(0.0, 2 * np.pi, 40, endpoint=False)
    x = np.stack([0.1 * np.cos(angles), 0.4 + 0.1 * np.sin(angles)], axis=-1)
    v = 100 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    room = [
        (-HALF, 0.0, HALF, 0.0),
        (HALF, 0.0, HALF, 0.8),
        (HALF, 0.8, -HALF, 0.8),
        (-HALF, 0.8, -HALF, 0.0),
    ]
    walls = Walls(floor(dx) - (0.0, 1.0), plates=room, restitution=1.0)
    return stream(x, v, dx, walls, c0=200.0)


def below(x: Any, dx: float) -> Any:
    """Behind the floor's first layer: a face of particles is as rough as they are."""
    return (x[:, 1] < -dx) & (np.abs(x[:, 0]) < HALF)


def beyond(x: Any, dx: float) -> Any:
    """Behind the first layer of either wall of the corner."""
    low, left = x[:, 1] < -dx, x[:, 0] < -HALF - dx
    return (low & (x[:, 0] < HALF)) | (left & (x[:, 1] < 2 * HALF))


def under(x: Any, dx: float) -> Any:
    """Behind the plate."""
    return (x[:, 1] < 0) & (np.abs(x[:, 0]) < HALF)


def outside_corner(x: Any, dx: float) -> Any:
    """Behind either plate of the corner."""
    low, left = x[:, 1] < 0, x[:, 0] < -HALF
    return (low & (x[:, 0] < HALF)) | (left & (x[:, 1] < 2 * HALF))


def outside_room(x: Any, dx: float) -> Any:
    """Out of the room of four plates."""
    return (np.abs(x[:, 0]) > HALF) | (np.abs(x[:, 1] - 0.4) > 0.4)


def shower(dx: float, mach: float) -> Scene:
    """Single particles at a Mach number onto boundary particles with nothing behind them."""
    x = np.stack([np.linspace(-0.75 * HALF, 0.75 * HALF, 30), np.full(30, 2.5 * dx)], axis=-1)
    v = np.tile((0.0, -mach * 10 * SPEED), (len(x), 1))
    return stream(x, v, dx, Walls(floor(dx)))


def cases() -> Iterator[Case]:
    """All of them."""
    case = partial(Case, dx=DX, frames=150, quick=45)
    for held in (False, True):
        wall = "a plate" if held else "boundary particles"
        behind, corner_behind = (under, outside_corner) if held else (below, beyond)
        thin = partial(thin_jet, held=held)
        yield case(f"thin jet on {wall}", thin, turned(5.0, 3.0), behind=behind)
        # where it meets the floor, it is compressed by v / c at first, as in a water hammer
        yield case(
            f"corner jet, {wall}", partial(corner_jet, held=held), turned(5.0, 3.0),
            behind=corner_behind, gain=0.1,
        )  # fmt: skip
    # those who meet head-on are squeezed for a moment, which kernels that are no pair pay back
    # with a little more than they took
    yield case(
        "strays at 100 m/s and plates", strays, turned(80.0, 80.0), frames=600, quick=240,
        behind=outside_room, gain=0.2, unmatched_rise=0.12,
    )  # fmt: skip
