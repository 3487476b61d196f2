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
from sph_gym.studies.stability.events import grew, moved, rotated, straight, turned

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
# Where float32 has but four digits left for a place in a body [m].
AWAY = (1e4, -1e4)
# How far apart, in dx and of the energy, two runs of the same scene may be that round otherwise.
ROUNDED = 0.05
# Of ways without a force, what must be as it should; in float32 the slowest lose most.
STRAIGHT = 0.99
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
    """A square in which n particles of a row are where the first of them is.

    There they stay together: without a direction, no force parts them. Those around them fly off.
    """
    x = jittered(dx)
    first = len(x) // 2
    x[first : first + n] = x[first]
    return free(x, dx)


def coincident_row(dx: float) -> Scene:
    """A row of particles exactly on the next one: pairs for good, which drive the others off."""
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
    """Nobody within the support radius of anybody, now or later, and all in motion."""
    x = 40 * square(dx)
    v = np.random.default_rng(1).normal(0.0, 0.1, x.shape)
    # at most 0.66 m apart or together by the end, of 0.8 m
    return free(x, dx, v=np.clip(v, -0.2, 0.2))


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
    """A sheet that is pulled apart along x, with nothing to stop its tension.

    Not stretched already: rows half a spacing apart would clump before they part.
    """
    x = jittered(dx)
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
    return dataclasses.replace(scene, x=np.add(scene.x, AWAY))


def cases() -> Iterator[Case]:
    """All of them; no force from outside, so that momentum stays."""
    yield from squeezed()
    yield from loose()
    yield from endless()
    body = partial(Case, dx=DX, conserves=True, quick=40)
    # under tension particles clump, the densest hundredth by 10 %, of which kernels that are no
    # pair make energy
    yield body(
        "stretched sheet", stretched, grew(0.2, 0.2), p99=0.12, least=0.9, unmatched_rise=0.5
    )
    turns = partial(body, dx=0.05, kernel="cubic_spline")
    yield turns(
        "rotating square, under tension", partial(rotating, clamp=False), rotated(0.8, 0.3),
        least=0.9,
    )  # fmt: skip
    # nothing holds it together
    yield turns(
        "rotating square, clamped", partial(rotating, clamp=True), rotated(0.7, 0.3),
        density=NONE, p99=NONE,
    )  # fmt: skip
    # a body that is stopped from v is compressed by v / c, as in a water hammer: here a tenth
    meet = partial(body, gain=0.1)
    together = meet("colliding patches", patches, turned(0.7, 0.7))
    yield together
    yield meet(
        "far from the origin", far_away, turned(0.7, 0.7), alike=ROUNDED, dtype="float32",
        twin=together._replace(dtype="float32"),
    )  # fmt: skip


def squeezed() -> Iterator[Case]:
    """Squeezed together at the start, of which nothing may be left after a frame."""
    body = partial(Case, dx=DX, conserves=True, quick=30)
    # a step of first order, and XSPH, err by some per cent of the energy of the explosion
    burst = partial(body, burst=PARTED, excess=0.15)
    yield burst("two coincident particles", partial(coincident, n=2), moved(1.0, 0.3))
    yield burst("three coincident particles", partial(coincident, n=3), moved(1.0, 0.3))
    # pushed off one after the other: 1.6 % after the first frame
    yield body("a coincident row", coincident_row, grew(5.0, 1.0), burst=0.03)
    yield body("random places", random_places, grew(10.0, 3.0), burst=PARTED, unmatched=0.45)
    yield body("overlapping bodies", overlapping, grew(10.0, 3.0), burst=PARTED)
    yield burst("clumped start", clumped, grew(100.0, 30.0))
    # three frames are enough to fly 300 times as far as it was wide
    jump = partial(burst, quick=3, unmatched=0.28)
    yield jump("density jump of 10", density_jump, grew(100.0, 30.0))


def loose() -> Iterator[Case]:
    """Particles that have nobody, or one other."""
    loner = partial(Case, dx=DX, conserves=True, density=NONE, p99=NONE, quick=30)
    # to what rounding in float32 leaves of it
    yield loner("one particle", one, straight(STRAIGHT, STRAIGHT), alone=True)
    # they brake each other; the article's kernels leave them at rest, half a spacing apart
    yield loner("two particles", two, moved(0.05, 0.05))
    yield loner("no neighbours at all", lonely, straight(STRAIGHT, STRAIGHT), alone=True)


def endless() -> Iterator[Case]:
    """Disorder in a fluid without an end, by the number of neighbours; it settles or it clumps."""
    case = partial(
        Case, dx=DX, conserves=True, quick=60, least=0.8, clumping=PAIRED,
        event=moved(0.08, 0.08),
    )  # fmt: skip
    # with some 30 neighbours those of the article pair, unless they are shifted: at rest, what is
    # at stake is no more than the energy of its disorder, and they make some of it anew
    for h, pairs, rise in ((1.5, False, None), (2.0, False, None), (3.0, True, 0.2)):
        yield case(f"h/dx = {h:g}", partial(wide, h=h), pairs=pairs, unmatched_rise=rise)
    yield case("h/dx = 4", partial(wide, h=4.0), pairs=True, unmatched=1.3, unmatched_rise=2.5)
    yield case(
        "pairing, h/dx = 3.5", partial(wide, h=3.5), pairs=True, kernel="cubic_spline",
        unmatched_rise=1.3,
    )  # fmt: skip
    yield case("pairing, cured by shifting", partial(wide, h=3.5, shifting=0.5))
