"""Configurations of the tests: no effect, all of them, and mixtures, on all sorts of clouds.

All lengths in metres; dx is 0.02 and a full cloud is a square of 12 x 12 particles. Each
configuration costs a compilation in each precision (see the budget in conftest.py), so there are
few and each holds much: effects alone are looked at uncompiled, in test_terms.py.
"""

from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest
from numba.core import config

from sph_gym import (
    CentralGravity,
    Controls,
    Effects,
    Fluid,
    Motion,
    RecordedGravity,
    RollingTank,
    Scene,
    ShakenGravity,
    Simulation,
    Walls,
    lattice,
    tank_particles,
)
from tests.pairwise import pairwise

DX = 0.02
WIDTH = 12 * DX
C0 = 10.0
STIFFNESS = 1000 * C0**2 / 7

WATER = Fluid(c0=C0, kernel="mueller")
# of the fastest flow that c0 is meant for: the least pressure that counts
DYNAMIC_PRESSURE = WATER.rho0 * (C0 / 10) ** 2
ALL_EFFECTS = Effects(
    gravity=(1.5, -9.81), xsph=True, artificial_viscosity=0.3, laminar_viscosity=0.02
)
STILL = replace(ALL_EFFECTS, gravity=(0.0, 0.0))
TANK = tank_particles(WIDTH, 1.25 * WIDTH, DX, layers=3)
BOX = (0.0, WIDTH, 0.0, np.inf)
WALLS = Walls(particles=TANK, box=BOX, restitution=0.5)

# --- Walls and effects of the mixtures ------------------------------------------------------

# wide enough for the widest support, 4 dx, which it then fits as narrowly as it may
PERIOD = (-2 * DX, WIDTH + 2 * DX)
FLOOR = lattice(*PERIOD, -3 * DX, 0.0, DX)
CEILING = lattice(*PERIOD, 1.25 * WIDTH, 1.25 * WIDTH + 3 * DX, DX)
# the floor is a belt, the ceiling a piston
CHANNEL = np.concatenate([FLOOR, CEILING])
BELT = np.where(CHANNEL[:, 1:] < 0, (1.5, 0.0), (0.0, 0.0))
PISTON = Motion(
    (0.0, -0.4), (0.2 * DX, 0.1 * DX), 30.0, particles=CHANNEL[:, 1] > 0, sides=("top",)
)
PLATE = (0.3 * WIDTH, 0.4 * WIDTH, 0.6 * WIDTH, 0.8 * WIDTH)
HOLD = 1.2 * WIDTH
MOVING = Walls(
    CHANNEL,
    box=(-np.inf, np.inf, 0.0, HOLD),
    restitution=0.5,
    pressure="extrapolated",
    velocity=BELT,
    motion=PISTON,
    plates=[PLATE, (*PLATE[2:], 0.9 * WIDTH, 0.1 * WIDTH)],
    period_x=PERIOD,
)
PAIRS = Effects(
    gravity=(1.5, -9.81),
    xsph=True,
    artificial_viscosity=0.3,
    laminar_viscosity=0.02,
    surface_tension=0.5,
    quadratic_viscosity=0.7,
    tensile_correction=0.2,
    shifting=2.0,
)
INTEGRATED = replace(PAIRS, continuity=True, density_diffusion=0.1)
SHAKEN = ShakenGravity(1.0, -9.81, (5.0, 3.0), 25.0)
ROLLING = RollingTank(9.81, 0.3, 15.0, (0.1, -0.05))
RECORDED = RecordedGravity([(0.0, -9.0), (3.0, -7.0), (-1.0, -10.0), (2.0, 5.0)], 4e-4)
FREE = replace(WATER, clamp=False)

# --- Configurations --------------------------------------------------------------------------

# of the mixtures; see `mixed`
FACTORS = {
    "integrator": ["symplectic_euler", "kick_drift_kick", "predictor_corrector"],
    "effects": ["viscous", "pairs", "integrated"],
    "walls": ["tank", "channel", "periodic"],
    "kernel": ["mueller", "wendland_c2", "quintic_spline"],
    "dtype": ["float64", "float32"],
    "pressure": ["like fluid", "extrapolated"],
    "slip": ["no-slip", "free-slip"],
    "clamp": [True, False],
    "gamma": [7.0, 5.5],
}
SOME_EFFECTS = {"viscous": ALL_EFFECTS, "pairs": PAIRS, "integrated": INTEGRATED}
ENDLESS = Walls(period_x=PERIOD, period_y=PERIOD)
SOME_WALLS = {
    "tank": replace(WALLS, velocity=(0.5, -1.0)),
    "channel": MOVING,
    "periodic": ENDLESS,
}
CENTRAL = CentralGravity(20.0, 0.1, 0.15)


def mixed(row, gravity):
    """Return the parts of a scene that a row of factors names."""
    effects = replace(SOME_EFFECTS[row["effects"]], gravity=gravity)
    walls = SOME_WALLS[row["walls"]]
    if walls.particles is not None:
        # a density by continuity needs walls that take the pressure of the fluid
        pressure = "extrapolated" if effects.continuity else row["pressure"]
        walls = replace(walls, pressure=pressure, slip=row["slip"])
    water = Fluid(C0, kernel=row["kernel"], clamp=row["clamp"], gamma=row["gamma"])
    return {"effects": effects, "walls": walls, "fluid": water, "integrator": row["integrator"]}


def named(*values):
    """Return a row of factors."""
    return dict(zip(FACTORS, values, strict=True))


ALIKE = ("like fluid", "no-slip", True, 7.0)
IN_ONE_PIECE = [
    named("symplectic_euler", "viscous", "tank", "mueller", dtype, *ALIKE)
    for dtype in FACTORS["dtype"]
]
# for each integrator, one with walls that move and densities in the state
FREE_CHANNEL = ("float64", "extrapolated", "no-slip", False)
EULER = named("symplectic_euler", "integrated", "channel", "mueller", *FREE_CHANNEL, 7.0)
KICK = named("kick_drift_kick", "integrated", "channel", "quintic_spline", *FREE_CHANNEL, 7.0)
PREDICTOR = named("predictor_corrector", "integrated", "channel", "wendland_c2", *FREE_CHANNEL, 5.5)
CONFIGURATIONS = {
    "none": {},
    "everything": {"effects": ALL_EFFECTS, "walls": WALLS},
    "open space": {"effects": ALL_EFFECTS},
    "periodic": {
        "effects": replace(ALL_EFFECTS, gravity=None),
        "walls": ENDLESS,
        "fluid": replace(FREE, kernel="cubic_spline"),
    },
    "plates": {"walls": Walls(plates=[PLATE], restitution=0.5)},
    "all, euler": mixed(EULER, SHAKEN),
    "all, kick": mixed(KICK, SHAKEN),
    "all, predictor": mixed(PREDICTOR, ROLLING),
}
# what is compiled to be compared with the naive solver: configuration and precision
COMPILED = [
    ("none", "float32"),
    ("everything", "float32"),
    *((name, "float64") for name in CONFIGURATIONS),
]
# all pairs of values of the factors that the above don't have together
MIXED = [
    (", ".join(row[name] for name in ("integrator", "effects", "walls", "kernel")), row)
    for row in pairwise(FACTORS, [*IN_ONE_PIECE, EULER, KICK, PREDICTOR])
]
for (name, row), gravity in zip(MIXED, cycle([SHAKEN, ROLLING, RECORDED, CENTRAL, None])):
    CONFIGURATIONS[name] = mixed(row, gravity)
    COMPILED.append((name, row["dtype"]))
# every integrator, every kind of effects and of walls; `make test-all` runs the other mixtures
QUICK_MIXTURES = {MIXED[k][0] for k in (0, 1, 4)}
COSTLY = {name for name, _ in MIXED} - QUICK_MIXTURES


def marked(*values, marks=()):
    """Return a row of parameters that begins with a configuration, `slow` if that is costly."""
    slow = [pytest.mark.slow] if values[0] in COSTLY else []
    return pytest.param(*values, marks=[*slow, *marks])


# marks of what would cost a compilation, and says as much without
UNCOMPILED = [
    pytest.mark.without_jit,
    pytest.mark.skipif(not config.DISABLE_JIT, reason="runs with NUMBA_DISABLE_JIT=1"),
]


def uncompiled(test):
    """Run one test with NUMBA_DISABLE_JIT=1 only."""
    for mark in UNCOMPILED:
        test = mark(test)
    return test


def square():
    """(144, 2) lattice in step with the tank."""
    return lattice(0.0, WIDTH, 0.0, WIDTH, DX)


def jittered(rng, share=0.2):
    """The square, every particle off its place by `share` dx."""
    x = square()
    return x + rng.normal(0.0, share * DX, x.shape)


def coincident(rng):
    """The same with ten pairs and a triple at one point each."""
    x = jittered(rng)
    x[:10] = x[20:30]
    x[10:12] = x[40]
    return x


# name: positions, h / dx
CLOUDS = {
    "lattice 2": (lambda rng: square(), 2.0),
    "lattice 3": (lambda rng: square(), 3.0),
    "lattice 4": (lambda rng: square(), 4.0),
    "jittered": (jittered, 2.6),
    "disordered": (lambda rng: rng.uniform(0.0, WIDTH, (144, 2)), 2.6),
    "overlapping": (lambda rng: rng.uniform(0.25 * WIDTH, 0.75 * WIDTH, (144, 2)), 2.6),
    "coincident": (coincident, 2.6),
}
NASTIEST = "coincident"
# all of them compiled, the nastiest one uncompiled too
clouds = pytest.mark.parametrize(
    "cloud",
    [
        pytest.param(name, marks=pytest.mark.without_jit if name == NASTIEST else ())
        for name in CLOUDS
    ],
)
configurations = pytest.mark.parametrize(
    ("configuration", "dtype"), [marked(*compiled) for compiled in COMPILED]
)
# every configuration on every cloud
compiled_cases = pytest.mark.parametrize(
    ("configuration", "dtype", "cloud"),
    [
        marked(
            *compiled,
            cloud,
            marks=[pytest.mark.without_jit] if cloud == NASTIEST and "float64" in compiled else [],
        )
        for compiled in COMPILED
        for cloud in CLOUDS
    ],
)


def scene(configuration="none", cloud="jittered", dtype="float64", speed=3.0, seed=0, **changes):
    """A moving cloud; positions and velocities are numbers that `dtype` can hold exactly."""
    rng = np.random.default_rng(seed)
    place, h_over_dx = CLOUDS[cloud]
    x = place(rng)
    v = rng.normal(0.0, speed, x.shape)
    arguments = {
        "name": "cloud",
        "x": x.astype(dtype).astype(np.float64),
        "v": v.astype(dtype).astype(np.float64),
        "dx": DX,
        "h": h_over_dx * DX,
        "fluid": WATER,
        # off the nominal stiffness, which artificial viscosity must not notice
        "controls": Controls(dt=0.2 * h_over_dx * DX / C0, stiffness=1.3 * STIFFNESS, xsph=0.4),
    }
    return Scene(**(arguments | CONFIGURATIONS[configuration] | changes))


def simulation(configuration="none", cloud="jittered", dtype="float64", neighbors="grid", **more):
    """A `Simulation` of such a scene."""
    return Simulation(scene(configuration, cloud, dtype, **more), dtype, neighbors)


def set_entries(engine, entries):
    """Let the neighbour lists of an engine have room for so many entries as the array has."""
    cells = engine.world.cells
    lists = cells.lists._replace(entries=entries)
    engine.world = engine.world._replace(cells=cells._replace(lists=lists))


def fluid(sim, field):
    """The fluid's part of a field of `sim`, in float64."""
    return np.asarray(getattr(sim, field)[: sim.n_fluid], dtype=np.float64)


def assert_close(actual, expected, tolerance, at_least=0.0):
    """All within `tolerance` of the largest magnitude expected, or of `at_least` if that is more.

    Relative errors of single particles mean nothing where large sums cancel.
    """
    assert np.shape(actual) == np.shape(expected)
    scale = max(float(np.abs(expected).max()), at_least)
    assert float(np.abs(actual - expected).max()) <= tolerance * scale
