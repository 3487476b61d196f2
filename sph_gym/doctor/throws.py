"""Particles thrown at the sides of a box: where they get to, and how they come back."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor.case import DX, Array, Case, all_finite, case, lattice
from sph_gym.doctor.lab import Lab

SIDES = ("left", "right", "floor", "ceiling")
_OUT = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]) / np.sqrt(2)
# Half the width of the box [spacings]: so that what flies to two sides never meets.
_HALF_ALONE, _HALF_BLOCKS = 6.0, 10.0
_GAP_ALONE, _GAP_BLOCKS = 2.5, 1.5
_BLOCK = 5
# Beyond the side by more than this is outside [spacings].
OUTSIDE = 1.0
# A particle that goes nowhere in so many steps has stopped; one that turns so often trembles.
STOPPED, TURNS = 10, 3


@dataclass
class Throw:
    """A run with a box around the origin.

    start: the case; dt [s]; speed: thrown with [m/s]; way: (n, 2) unit vectors to the target;
    side: (n,) index of `SIDES`, -1 for a corner; x, v: (steps + 1, n, 2).
    """

    start: Case
    dt: float
    speed: float
    way: Array
    side: NDArray[np.int64]
    x: Array
    v: Array

    @property
    def finite(self) -> bool:
        """Return whether all numbers are."""
        return all_finite(self.x, self.v)

    @cached_property
    def depth(self) -> Array:
        """Return how far beyond the nearest side each particle is (steps + 1, n) [spacings]."""
        assert self.start.box is not None
        return (np.abs(self.x).max(axis=2) - self.start.box[1]) / self.start.dx

    @cached_property
    def towards(self) -> Array:
        """Return velocities towards the target (steps + 1, n), in units of the thrown speed."""
        return (self.v * self.way).sum(axis=2) / self.speed

    @property
    def lost(self) -> NDArray[np.bool_]:
        """Return which particles (n,) end outside and go on, or are too far out to come back."""
        depth = self.depth[-1]
        return np.asarray((depth > OUTSIDE) & ((self.towards[-1] > 0.5) | (depth > 2.5 * OUTSIDE)))

    @property
    def untouched(self) -> NDArray[np.bool_]:
        """Return which particles (n,) end far outside and have kept their velocity on the way."""
        change = np.linalg.norm(self.v - self.v[0], axis=2).max(axis=0)
        return np.asarray((self.depth[-1] > 2 * OUTSIDE) & (change < 0.02 * self.speed))

    @property
    def energy(self) -> float:
        """Return the kinetic energy at the end, in units of that at the start."""
        return float((self.v[-1] ** 2).sum() / (self.v[0] ** 2).sum())

    def lost_share(self, k: int) -> float:
        """Return the share lost of the middle of a block thrown at side k that has got there.

        The edges of a block are left out: their densities are low, so that a wall of particles
        lets them in deeper.
        """
        across = (self.x[0] * (1 - np.abs(self.way))).sum(axis=1)
        mine = (self.side == k) & (np.abs(across) < 1.5 * self.start.dx)
        free = self.depth[0] + self.speed * self.dt * (len(self.x) - 1) / self.start.dx
        lost = mine & self.lost
        return float(lost.sum() / max(int((mine & (free > OUTSIDE + 0.2) | lost).sum()), 1))

    def stuck(self) -> NDArray[np.bool_]:
        """Return which particles (n,) have stopped at a side although their v goes on into it."""
        way = self.towards[-1] * self.speed * STOPPED * self.dt / self.start.dx
        moved = np.ptp(self.depth[-STOPPED:], axis=0)
        near = np.abs(self.depth[-1]) < 1.5
        return near & (self.towards[-STOPPED:].min(axis=0) > 0.5) & (moved < 0.2 * np.abs(way))

    def trembling(self) -> NDArray[np.bool_]:
        """Return which particles (n,) turn `TURNS` times in a row at a side, once a step.

        A wall turns a particle once; boundary particles that hold one let it swing, but slowly.
        """
        turned = (self.towards[1:] * self.towards[:-1] < 0) & (np.abs(self.towards[1:]) > 0.005)
        in_a_row = [turned[k : len(turned) - TURNS + 1 + k] for k in range(TURNS)]
        return np.asarray(np.logical_and.reduce(in_a_row).any(axis=0))

    def jump(self) -> float:
        """Return how far a particle moved in one step beyond what its velocity allows [dx]."""
        size = np.linalg.norm(self.v, axis=2)
        way = 3 * self.dt * np.maximum(np.maximum(size[1:], size[:-1]), self.speed)
        moved = np.linalg.norm(np.diff(self.x, axis=0), axis=2)
        return float((moved - way).max() / self.start.dx)

    def sharp(self, k: int) -> bool:
        """Return whether side k turned its particles back in one step, without letting them in."""
        mine = self.side == k
        course, end = self.towards[:, mine], self.towards[-1, mine]
        turning = (course < 0.98) & (course > end + 0.02)
        return bool((end < 0.1).all() and not turning.any() and self.depth[:, mine].max() < 0.02)


def alone(lab: Lab, speed: float, dt: float) -> Throw:
    """Throw four lone particles at the sides and four at the corners.

    speed: in c0; dt: in what sound takes across the support.
    """
    middle = _OUT * (_HALF_ALONE - _GAP_ALONE) + 0.3 * _OUT[:, ::-1]
    corner = np.sign(_CORNERS) * (_HALF_ALONE - _GAP_ALONE)
    way = np.concatenate([_OUT, _CORNERS])
    start = _boxed(np.concatenate([middle, corner]), way, speed, _HALF_ALONE)
    side = np.array([0, 1, 2, 3, -1, -1, -1, -1])
    return _follow(lab, start, dt, way, side, 2 * _GAP_ALONE)


def blocks(
    lab: Lab, speed: float, dt: float, gravity: Array | None = None, box: bool = True
) -> Throw:
    """Throw a block of 5 x 5 particles at each side, in a random order of particles.

    gravity: (2,) [m/s^2]; box: False for the same blocks in open space.
    """
    center = _HALF_BLOCKS - _GAP_BLOCKS - (_BLOCK - 1) / 2
    x = np.concatenate([lattice(_BLOCK, _BLOCK, 1.0, center * out) for out in _OUT])
    side = np.repeat(np.arange(4), _BLOCK**2)
    order = lab.rng.permutation(len(x))
    side, x = side[order], x[order]
    start = _boxed(x, _OUT[side], speed, _HALF_BLOCKS, gravity)
    return _follow(lab, start, dt, _OUT[side], side, 1.8 * _GAP_BLOCKS, box)


def _boxed(x: Array, way: Array, speed: float, half: float, gravity: Array | None = None) -> Case:
    size = half * DX
    start = case(x * DX, gravity=np.zeros(2) if gravity is None else gravity)
    return case(
        start.x, way * speed * start.c0, gravity=start.gravity, box=(-size, size, -size, size)
    )


def _follow(
    lab: Lab, start: Case, dt: float, way: Array, side: NDArray[np.int64], gaps: float,
    box: bool = True,
) -> Throw:  # fmt: skip
    """Run until a particle that nothing stops has flown `gaps` [spacings]."""
    speed = float(np.linalg.norm(start.v[0]))
    step = dt * start.h / start.c0
    steps = int(np.ceil(gaps * DX / (speed * step))) + 8
    thrown = start if box else case(start.x, start.v, gravity=start.gravity)
    return Throw(start, step, speed, way, side, *lab.course(thrown, step, steps))
