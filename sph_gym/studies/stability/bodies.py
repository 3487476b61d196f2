"""Hard cases without walls: bodies in empty space, from starts that nobody should make."""

import dataclasses
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from sph_gym import scenes
from sph_gym.solver.geometry import disc, lattice
from sph_gym.solver.scene import Effects, Fluid, Scene
from sph_gym.solver.walls import Walls
from sph_gym.studies.stability.case import Case

C0 = 10.0
SIDE, CELL = 12, 20
DX = 0.02
# Of all particles, closer than 0.6 dx to another one: what the environments allow.
PAIRED = 0.15
# What begins squeezed has parted after a frame, in which sound crosses h three times: of
# compressions from 0.1 % to 340 % no more than 1.2 % is left.
PARTED = 0.02
# Compression where nobody ever has a neighbour too many, or is drawn apart: none but rounding.
NONE = 1e-12
# Substeps at the acoustic limit that make a frame.
FRAME = 8


def free(x: Any, dx: float, v: Any = None, h: float = 2.6, clamp: bool = True) -> Scene:
    """Particles in empty space with a touch of viscosity; h in multiples of dx."""
    return Scene(
        "hard case",
        x=x,
        v=v,
        dx=dx,
        h=h * dx,
        fluid=Fluid(c0=C0, clamp=clamp),
        effects=Effects(xsph=True, artificial_viscosity=0.05),
        frame=FRAME * 0.4 * h * dx / C0,
    )


def square(dx: float, side: int = SIDE) -> Any:
    """A lattice of as many rows as at the coarse spacing, or more where dx is finer."""
    length = side * DX
    return lattice(0.0, length, 0.0, length, dx)


def jittered(dx: float, share: float = 0.02) -> Any:
    """The square with its particles off their places by a share of dx."""
    x = square(dx)
    return x + np.random.default_rng(0).normal(0.0, share * dx, x.shape)


def coincident(dx: float, n: int) -> Scene:
    """A square in which n particles of a row are where the first of them is."""
    x = jittered(dx)
    first = len(x) // 2
    x[first : first + n] = x[first]
    return free(x, dx)


def coincident_row(dx: float) -> Scene:
    """A row of particles exactly on the next one."""
    x = jittered(dx)
    columns = round(SIDE * DX / dx)
    x[4 * columns : 5 * columns] = x[5 * columns : 6 * columns]
    return free(x, dx)


def one(dx: float) -> Scene:
    """A single particle that moves."""
    return free([(0.3, 0.4)], dx, v=[(1.0, -0.5)])


def two(dx: float) -> Scene:
    """Two particles half a spacing apart that fly towards each other."""
    return free([(0.0, 0.0), (dx / 2, 0.0)], dx, v=[(1.0, 0.0), (-1.0, 0.0)])


def lonely(dx: float) -> Scene:
    """Nobody within the support radius of anybody, and all in motion."""
    x = 4 * square(dx)
    return free(x, dx, v=np.random.default_rng(1).normal(0.0, 0.1, x.shape))


def random_places(dx: float) -> Scene:
    """As many particles as the square has, each at a place of its own choice."""
    n = len(square(dx))
    return free(np.random.default_rng(2).uniform(0.0, SIDE * DX, (n, 2)), dx)


def overlapping(dx: float) -> Scene:
    """Two discs that cover half of each other, their lattices out of step."""
    radius = SIDE * DX / 2
    second = disc(radius + 0.37 * dx, 0.21 * dx, radius, dx)
    return free(np.concatenate([disc(0.0, 0.0, radius, dx), second]), dx)


def clumped(dx: float) -> Scene:
    """Four times as many particles as there is room for."""
    return free(0.5 * jittered(dx), dx)


def density_jump(dx: float) -> Scene:
    """One half of the square ten times as dense as the other."""
    dense = jittered(dx) / np.sqrt(10)
    right = np.add(jittered(dx), (dense[:, 0].max() + dx, 0.0))
    return free(np.concatenate([dense, right]), dx)


def stretched(dx: float) -> Scene:
    """A sheet under tension that is pulled apart along x, not clamped."""
    x = jittered(dx) * (2.0, 0.5)
    pull = 2.0 * (x - x.mean(axis=0)) * (1.0, 0.0)
    return free(x, dx, v=pull, clamp=False)


def rotating(dx: float, clamp: bool) -> Scene:
    """The rotating square, whose middle is under tension."""
    scene = scenes.make("rotating_square", dx=dx)
    return dataclasses.replace(scene, fluid=dataclasses.replace(scene.fluid, clamp=clamp))


def wide(dx: float, h: float, shifting: float | None = None) -> Scene:
    """Fluid without an end, its particles off by a tenth of dx; h in multiples of dx."""
    length = CELL * DX
    ends = (0.0, length)
    x = square(dx, CELL)
    x += np.random.default_rng(0).normal(0.0, 0.1 * dx, x.shape)
    scene = free(x % length, dx, h=h)
    return dataclasses.replace(
        scene,
        walls=Walls(period_x=ends, period_y=ends),
        effects=dataclasses.replace(scene.effects, shifting=shifting),
    )


def patches(dx: float) -> Scene:
    """Two squares that hit each other at a fifth of the speed of sound."""
    left = jittered(dx)
    right = np.add(left, (np.ptp(left[:, 0]) + 3 * dx, 0.3 * dx))
    v = np.where(np.arange(2 * len(left)) < len(left), 1.0, -1.0)[:, None] * (1.0, 0.0)
    return free(np.concatenate([left, right]), dx, v=v)


def far_away(dx: float) -> Scene:
    """The patches 10 km from the origin, where float32 tells places 1 mm apart."""
    scene = patches(dx)
    return dataclasses.replace(scene, x=np.add(scene.x, (1e4, -1e4)))


def cases() -> Iterator[Case]:
    """All of them; no force from outside, so that momentum stays."""
    body = partial(Case, dx=DX, conserves=True)
    # squeezed together at the start: a step of first order, and XSPH, err by some per cent of the
    # energy of the explosion
    burst = partial(body, burst=PARTED, excess=0.15)
    loose = partial(body, density=NONE, p99=NONE)
    yield burst("two coincident particles", partial(coincident, n=2))
    yield burst("three coincident particles", partial(coincident, n=3))
    # pushed off one after the other: 1.6 % after the first frame
    yield body("a coincident row", coincident_row, burst=0.03)
    yield loose("one particle", one)
    yield loose("two particles", two)
    yield loose("no neighbours at all", lonely)
    yield body("random places", random_places, burst=PARTED, unmatched=0.45)
    yield body("overlapping bodies", overlapping, burst=PARTED)
    yield burst("clumped start", clumped)
    yield burst("density jump of 10", density_jump, quick=3, unmatched=0.28)
    # its rows begin half a spacing apart, and under tension particles clump: the mean gains 2.8 %
    # and the densest hundredth 10 %, while nobody parts
    yield body("stretched sheet", stretched, gain=0.05, p99=0.15, least=0.9)
    yield body(
        "rotating square, under tension", partial(rotating, clamp=False), dx=0.05,
        kernel="cubic_spline", least=0.9,
    )  # fmt: skip
    # nothing holds it together
    yield loose(
        "rotating square, clamped", partial(rotating, clamp=True), dx=0.05, kernel="cubic_spline"
    )
    endless = partial(body, quick=60, least=0.8, clumping=PAIRED)
    # with some 30 neighbours those of the article pair, unless they are shifted
    for h, pairs in ((1.5, False), (2.0, False), (3.0, True)):
        yield endless(f"h/dx = {h:g}", partial(wide, h=h), pairs=pairs)
    # at rest, what is at stake is no more than the energy of its disorder
    yield endless("h/dx = 4", partial(wide, h=4.0), pairs=True, unmatched=1.3)
    yield endless("pairing, h/dx = 3.5", partial(wide, h=3.5), pairs=True, kernel="cubic_spline")
    yield endless("pairing, cured by shifting", partial(wide, h=3.5, shifting=0.5))
    # a body that is stopped from v is compressed by v / c, as in a water hammer: here a tenth
    yield body("colliding patches", patches, gain=0.1)
    yield body("far from the origin", far_away, gain=0.1)
