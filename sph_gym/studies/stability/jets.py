"""Hard cases at walls that must hold by themselves: jets and strays against particles and plates.

And a table of what boundary particles hold without a box or plates behind them.
"""

from collections.abc import Iterator
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from sph_gym.extras import progress
from sph_gym.solver.geometry import lattice
from sph_gym.solver.scene import Fluid, Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls
from sph_gym.studies.results import Results, as_record
from sph_gym.studies.stability import bodies
from sph_gym.studies.stability.case import VARIANTS, HardCase, Variant, hard_case, stable_step
from sph_gym.studies.stability.checks import n_passed
from sph_gym.studies.stability.events import turned
from sph_gym.studies.table import Row

DX = 0.02
SPEED = 5.0
HALF = 0.4


def stream(x: Any, v: Any, dx: float, walls: Walls, c0: float = 10 * SPEED) -> Scene:
    """Return water that moves at some 5 m/s, without gravity."""
    frame = bodies.FRAME * 0.4 * 2.6 * dx / c0
    return bodies.free(x, dx, v, fluid=Fluid(c0=c0, kernel="mueller"), walls=walls, frame=frame)


def floor(dx: float) -> Any:
    """Return three layers of boundary particles below y = 0."""
    return lattice(-HALF, HALF, -3 * dx, 0.0, dx)


def thin_jet(dx: float, held: bool) -> Scene:
    """Return a jet of three particles onto boundary particles; held: with a plate at their face."""
    jet = lattice(-1.5 * dx, 1.5 * dx, 2 * dx, 0.6, dx)
    plates = [(-HALF, 0.0, HALF, 0.0)]
    walls = Walls(floor(dx), plates=plates if held else None)
    return stream(jet, np.tile((0.0, -SPEED), (len(jet), 1)), dx, walls)


def corner_jet(dx: float, held: bool) -> Scene:
    """Return a jet of eight particles that slants into a corner."""
    jet = lattice(-HALF + 2 * dx, -HALF + 10 * dx, 2 * dx, 0.6, dx)
    side = lattice(-HALF - 3 * dx, -HALF, -3 * dx, 2 * HALF, dx)
    plates = [(-HALF, 0.0, HALF, 0.0), (-HALF, 0.0, -HALF, 2 * HALF)]
    walls = Walls(np.concatenate([floor(dx), side]), plates=plates if held else None)
    return stream(jet, np.tile((-0.5 * SPEED, -SPEED), (len(jet), 1)), dx, walls)


def strays(dx: float) -> Scene:
    """Return single particles at 100 m/s, in all directions, within plates, far above other walls.

    At half the speed of sound: two that meet head-on come closer by 0.4 h in a stable step. At
    Mach 2 it would be 1.6 h, and a particle that is in the middle of another by then flies apart
    with spurious energy of up to 0.6 of what is at stake, by the article's kernels.
    """
    angles = np.linspace(0.0, 2 * np.pi, 40, endpoint=False)
    x = np.stack([0.1 * np.cos(angles), 0.4 + 0.1 * np.sin(angles)], axis=-1)
    v = 100 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    corners = [(-HALF, 0.0), (HALF, 0.0), (HALF, 0.8), (-HALF, 0.8)]
    room = [(*one, *next_) for one, next_ in zip(corners, corners[1:] + corners[:1], strict=True)]
    walls = Walls(floor(dx) - (0.0, 1.0), plates=room, restitution=1.0)
    return stream(x, v, dx, walls, c0=200.0)


def below_floor(x: Any, dx: float, layers: int) -> Any:
    """Return which positions are below the floor, by so many layers of particles."""
    return (x[:, 1] < -layers * dx) & (np.abs(x[:, 0]) < HALF)


def outside_corner(x: Any, dx: float, layers: int) -> Any:
    """Return which positions are behind either wall of the corner, by so many layers."""
    low, left = x[:, 1] < -layers * dx, x[:, 0] < -HALF - layers * dx
    return (low & (x[:, 0] < HALF)) | (left & (x[:, 1] < 2 * HALF))


def outside_room(x: Any, dx: float) -> Any:
    """Return which positions are out of the room of four plates."""
    return (np.abs(x[:, 0]) > HALF) | (np.abs(x[:, 1] - 0.4) > 0.4)


def cases() -> Iterator[HardCase]:
    """Yield all cases."""
    case = partial(hard_case, dx=DX, frames=150, quick=45, event=turned(5.0, 3.0))
    # a face of particles is as rough as they are, a plate is not
    for held, wall, layers in ((False, "boundary particles", 1), (True, "a plate", 0)):
        behind = partial(below_floor, layers=layers)
        yield case(f"thin jet on {wall}", partial(thin_jet, held=held), behind=behind)
        # where it meets the floor, it is compressed by v / c at first, as in a water hammer
        yield case(
            f"corner jet, {wall}", partial(corner_jet, held=held), gain=0.1,
            behind=partial(outside_corner, layers=layers),
        )  # fmt: skip
    # those that meet head-on are squeezed for a moment, which kernels that are no pair pay back
    # with a little more than they took
    yield hard_case(
        "strays at 100 m/s and plates", strays, turned(80.0, 80.0), DX, frames=600, quick=240,
        behind=outside_room, gain=0.2, unmatched={"rise": 0.12},
    )  # fmt: skip


# --- What boundary particles hold by themselves ---------------------------------------------

# Mach numbers that are tried, and what must hold: four times the speed that a sound speed is
# chosen for.
MACH = (0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 2.0, 5.0)
HELD = 0.4
# In multiples of the stable step; above it, no particle may pass in silence either.
STEPS = (1.0, 2.0, 4.0)
FRAMES = 60


class Strays(NamedTuple):
    """Strays that get behind the first layer of three before a blow-up is reported.

    n_passed: how many of thirty; reported: 1 if one is, at the end of the step in which it happens,
    which ends the run, or 0.
    """

    n_passed: int
    reported: int


def shower(dx: float, mach: float) -> Scene:
    """Return single particles at a Mach number onto boundary particles with nothing behind them."""
    x = np.stack([np.linspace(-0.75 * HALF, 0.75 * HALF, 30), np.full(30, 2.5 * dx)], axis=-1)
    v = np.tile((0.0, -mach * 10 * SPEED), (len(x), 1))
    return stream(x, v, dx, Walls(floor(dx)))


def passed(variant: Variant, mach: float, step: float = 1.0) -> Strays:
    """Return how strays at a Mach number fare, with so many times the stable step."""
    case = hard_case("shower", shower, turned(0.0, 0.0), DX)
    sim = Simulation(case.scene(variant, mach), variant.dtype, threads=1)
    most = 0
    for frame in range(FRAMES):
        sim.controls = stable_step(sim, frame, step)
        if sim.advance(sim.scene.frame).diverged:
            return Strays(most, 1)
        most = max(most, n_passed(sim, partial(below_floor, layers=1)))
    return Strays(most, 0)


def rows(results: Results) -> Iterator[Row]:
    """Yield up to which Mach number no stray passes, and how many pass unreported at any."""
    for variant, step in progress([*product(VARIANTS, STEPS)], "boundary particles"):
        outcomes = {}
        for mach in MACH:
            key = ["boundary particles", variant.name, mach, step]
            compute = partial(passed, variant, mach, step)
            outcomes[mach] = results.get(key, compute, as_record(Strays))
        yield from _rows(f"{variant.name}, dt x {step:g}", step, outcomes)


def _rows(label: str, step: float, outcomes: dict[float, Strays]) -> Iterator[Row]:
    held = 0.0
    for mach, strays in outcomes.items():
        if strays.n_passed or strays.reported:
            break
        held = mach
    silent = float(sum(strays.n_passed for strays in outcomes.values()))
    quantity = "Mach number that boundary particles stop alone"
    yield Row(quantity, label, held, "", HELD if step <= 1 else None, at_least=True)
    yield Row("particles that pass them in silence", label, silent, "", 0.0)
    faster = [strays.reported for mach, strays in outcomes.items() if mach > HELD]
    title = f"runs of strays beyond Mach {HELD:g} that blow up, all reported"
    yield Row(title, label, float(sum(faster)), f"of {len(faster)}")
