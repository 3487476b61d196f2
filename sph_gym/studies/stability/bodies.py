"""Hard cases without walls: bodies in empty space, from starts that no user should make."""

import dataclasses
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from sph_gym import scenes
from sph_gym.solver.geometry import disc, lattice
from sph_gym.solver.scene import Effects, Fluid, Scene
from sph_gym.solver.walls import Walls
from sph_gym.studies.stability.case import HardCase, hard_case
from sph_gym.studies.stability.checks import LONELY, ROUND_OFF
from sph_gym.studies.stability.events import grew, moved, rotated, straight, turned

C0 = 10.0
SIDE, CELL = 12, 20
DX = 0.02
# Largest share of particles closer than 0.6 dx to another one: what the environments allow.
PAIRED = 0.15
# What begins squeezed has parted after a frame, in which sound crosses h three times: of
# compressions from 0.1 % to 340 % no more than 1.2 % is left.
PARTED = 0.02
# Compression where no particle ever has a neighbour too many, or is drawn apart: only rounding.
NONE = 1e-12
# A place so far away that float32 has but four digits left inside a body [m].
AWAY = (1e4, -1e4)
# How far apart, in dx and of the energy, two runs of the same scene may be that round otherwise.
ROUNDED = 0.05
# Straightness of ways without a force; in float32 the slowest particles lose most.
STRAIGHT = 0.99
# Substeps at the acoustic limit that make a frame.
FRAME = 8

# A body in empty space, whose momentum stays.
body = partial(hard_case, dx=DX, drift=ROUND_OFF)


def free(x: Any, dx: float, v: Any = None, h: float = 2.6, **settings: Any) -> Scene:
    """Return particles in empty space with a touch of viscosity; h in multiples of dx.

    settings: other fields of the scene.
    """
    usual: dict[str, Any] = {
        "fluid": Fluid(c0=C0, kernel="mueller"),
        "effects": Effects(xsph=True, artificial_viscosity=0.05),
        "frame": FRAME * 0.4 * h * dx / C0,
    }
    return Scene("hard case", x=x, v=v, dx=dx, h=h * dx, **usual | settings)


def square(dx: float, side: int = SIDE) -> Any:
    """Return a lattice of as many rows as at the coarse spacing, or more where dx is finer."""
    length = side * DX
    return lattice(0.0, length, 0.0, length, dx)


def jittered(dx: float, share: float = 0.02, side: int = SIDE) -> Any:
    """Return the square with its particles off their places by a share of dx."""
    x = square(dx, side)
    return x + np.random.default_rng(0).normal(0.0, share * dx, x.shape)


# --- Squeezed together at the start ---------------------------------------------------------


def coincident(dx: float, n: int) -> Scene:
    """Return a square in which n particles of a row are where the first of them is.

    There they stay together: without a direction, no force parts them. Those around them fly off.
    """
    x = jittered(dx)
    first = len(x) // 2
    x[first : first + n] = x[first]
    return free(x, dx)


def coincident_row(dx: float) -> Scene:
    """Return a row of particles exactly on the next one, in pairs that drive the others off."""
    x = jittered(dx)
    columns = round(SIDE * DX / dx)
    x[4 * columns : 5 * columns] = x[5 * columns : 6 * columns]
    return free(x, dx)


def random_places(dx: float) -> Scene:
    """Return as many particles as the square has, each at a random place."""
    n = len(square(dx))
    return free(np.random.default_rng(2).uniform(0.0, SIDE * DX, (n, 2)), dx)


def overlapping(dx: float) -> Scene:
    """Return two discs that cover half of each other, their lattices out of step."""
    radius = SIDE * DX / 2
    second = disc(radius + 0.37 * dx, 0.21 * dx, radius, dx)
    return free(np.concatenate([disc(0.0, 0.0, radius, dx), second]), dx)


def density_jump(dx: float) -> Scene:
    """Return a square of which one half is ten times as dense as the other."""
    dense = jittered(dx) / np.sqrt(10)
    right = np.add(jittered(dx), (dense[:, 0].max() + dx, 0.0))
    return free(np.concatenate([dense, right]), dx)


def squeezed() -> Iterator[HardCase]:
    """Yield cases that begin squeezed, of which nothing may be left after a frame."""
    start = partial(body, quick=30)
    # a step of first order, and XSPH, err by some per cent of the energy of the explosion
    burst = partial(start, burst=PARTED, excess=0.15)
    yield burst("two coincident particles", partial(coincident, n=2), moved(1.0, 0.3))
    yield burst("three coincident particles", partial(coincident, n=3), moved(1.0, 0.3))
    # pushed off one after the other: 1.6 % after the first frame
    yield start("a coincident row", coincident_row, grew(5.0, 1.0), burst=0.03)
    scattered = partial(start, event=grew(10.0, 3.0), burst=PARTED)
    yield scattered("random places", random_places, unmatched={"excess": 0.45})
    yield scattered("overlapping bodies", overlapping)
    exploded = partial(burst, event=grew(100.0, 30.0))
    # four times as many particles as there is room for
    yield exploded("clumped start", lambda dx: free(0.5 * jittered(dx), dx))
    # three frames are enough to fly 300 times as far as it was wide
    yield exploded("density jump of 10", density_jump, quick=3, unmatched={"excess": 0.28})


# --- Particles with no neighbour, or one ----------------------------------------------------


def lonely(dx: float) -> Scene:
    """Return particles in motion that never come within the support radius of each other."""
    x = 40 * square(dx)
    v = np.random.default_rng(1).normal(0.0, 0.1, x.shape)
    # at most 0.66 m apart or together by the end, of 0.8 m
    return free(x, dx, v=np.clip(v, -0.2, 0.2))


def loose() -> Iterator[HardCase]:
    """Yield cases of particles that have no neighbour, or one."""
    loner = partial(body, density=NONE, p99=NONE, quick=30)
    # to what rounding in float32 leaves of it
    alone = partial(loner, event=straight(STRAIGHT, STRAIGHT), highest=2 - LONELY)
    yield alone("one particle", lambda dx: free([(0.3, 0.4)], dx, v=[(1.0, -0.5)]))
    # they brake each other; the article's kernels leave them at rest, half a spacing apart
    yield loner(
        "two particles",
        lambda dx: free([(0.0, 0.0), (dx / 2, 0.0)], dx, v=[(1.0, 0.0), (-1.0, 0.0)]),
        moved(0.05, 0.05),
    )
    yield alone("no neighbours at all", lonely)


# --- Fluid without an end -------------------------------------------------------------------


def wide(dx: float, h: float, shifting: float | None = None) -> Scene:
    """Return a periodic fluid, its particles off by a tenth of dx; h in multiples of dx."""
    length = CELL * DX
    ends = (0.0, length)
    effects = Effects(xsph=True, artificial_viscosity=0.05, shifting=shifting)
    walls = Walls(period_x=ends, period_y=ends)
    return free(jittered(dx, 0.1, CELL) % length, dx, h=h, walls=walls, effects=effects)


def endless() -> Iterator[HardCase]:
    """Yield disorder in a periodic fluid, by the number of neighbours; it settles or it clumps."""
    case = partial(
        body, event=moved(0.08, 0.08), quick=60, left=0.8, clumping=PAIRED
    )  # fmt: skip
    yield case("h/dx = 1.5", partial(wide, h=1.5))
    yield case("h/dx = 2", partial(wide, h=2.0))
    # with some 30 neighbours those of the article pair, unless they are shifted: at rest, what is
    # at stake is no more than the energy of its disorder, and they make some of it anew
    pairs: dict[str, Any] = {"clumping": None}
    yield case("h/dx = 3", partial(wide, h=3.0), unmatched=pairs | {"rise": 0.2})
    yield case("h/dx = 4", partial(wide, h=4.0), unmatched=pairs | {"excess": 1.3, "rise": 2.5})
    pairing = partial(wide, h=3.5)
    yield case(
        "pairing, h/dx = 3.5", pairing, kernel="cubic_spline", unmatched=pairs | {"rise": 1.3}
    )
    yield case("pairing, cured by shifting", partial(pairing, shifting=0.5))


# --- Under tension, and in collision --------------------------------------------------------


def stretched(dx: float) -> Scene:
    """Return a sheet that is pulled apart along x, with nothing to stop its tension.

    Not stretched already: rows half a spacing apart would clump before they part.
    """
    x = jittered(dx)
    pull = 2.0 * (x - x.mean(axis=0)) * (1.0, 0.0)
    return free(x, dx, v=pull, fluid=Fluid(c0=C0, kernel="mueller", clamp=False))


def rotating(dx: float, clamp: bool) -> Scene:
    """Return the rotating square, whose middle is under tension."""
    scene = scenes.make("rotating_square", dx=dx)
    return dataclasses.replace(scene, fluid=dataclasses.replace(scene.fluid, clamp=clamp))


def patches(dx: float) -> Scene:
    """Return two squares that hit each other at a fifth of the speed of sound."""
    left = jittered(dx)
    right = np.add(left, (np.ptp(left[:, 0]) + 3 * dx, 0.3 * dx))
    v = np.where(np.arange(2 * len(left)) < len(left), 1.0, -1.0)[:, None] * (1.0, 0.0)
    return free(np.concatenate([left, right]), dx, v=v)


def far_away(dx: float) -> Scene:
    """Return the patches 10 km from the origin, where float32 tells places 1 mm apart."""
    scene = patches(dx)
    return dataclasses.replace(scene, x=np.add(scene.x, AWAY))


def cases() -> Iterator[HardCase]:
    """Yield all cases; no force acts from outside, so that momentum stays."""
    yield from squeezed()
    yield from loose()
    yield from endless()
    longer = partial(body, quick=40)
    # under tension particles clump, of which kernels that are no pair make energy; how far the
    # densest hundredth does hangs on rounding: 6 to 15 % over a hundred starts 1e-13 m apart
    yield longer(
        "stretched sheet", stretched, grew(0.2, 0.2), p99=0.18, left=0.9, unmatched={"rise": 0.5}
    )
    turns = partial(longer, dx=0.05, kernel="cubic_spline")
    tense, clamped = (partial(rotating, clamp=clamp) for clamp in (False, True))
    yield turns("rotating square, under tension", tense, rotated(0.8, 0.3), left=0.9)
    # nothing holds it together
    yield turns("rotating square, clamped", clamped, rotated(0.7, 0.3), density=NONE, p99=NONE)
    # a body that is stopped from v is compressed by v / c, as in a water hammer: here a tenth
    meet = partial(longer, event=turned(0.7, 0.7), gain=0.1)
    together = meet("colliding patches", patches)
    yield together
    yield meet(
        "far from the origin", far_away, unlike=ROUNDED, dtype="float32",
        twin=together._replace(dtype="float32"),
    )  # fmt: skip
