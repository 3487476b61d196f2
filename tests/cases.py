"""What the solver is tested on: every effect alone, none, and all together, on all sorts of clouds.

All lengths in metres; dx is 0.02 and a full cloud is a square of 12 x 12 particles. Every
configuration is compiled, so those of the physics that came later are few and hold much each:
test_terms.py looks at their pieces one by one, uncompiled.
"""

from dataclasses import replace

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

DX = 0.02
WIDTH = 12 * DX
C0 = 10.0
STIFFNESS = 1000 * C0**2 / 7

WATER = Fluid(c0=C0)
# of the fastest flow that c0 is meant for: the least pressure that counts
DYNAMIC_PRESSURE = WATER.rho0 * (C0 / 10) ** 2
ALL_EFFECTS = Effects(
    gravity=(1.5, -9.81), xsph=True, artificial_viscosity=0.3, laminar_viscosity=0.02
)
TANK = tank_particles(WIDTH, 1.25 * WIDTH, DX)
BOX = (0.0, WIDTH, 0.0, np.inf)
WALLS = Walls(particles=TANK, box=BOX, restitution=0.5)

# --- Physics that came later ---------------------------------------------------------------

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
    viscosity_form="morris",
    tensile_correction=0.2,
    shifting=2.0,
)
INTEGRATED = replace(PAIRS, continuity=True, density_diffusion=0.1)
SHAKEN = ShakenGravity(1.0, -9.81, (5.0, 3.0), 25.0)
ROLLING = RollingTank(9.81, 0.3, 15.0, (0.1, -0.05))
RECORDED = RecordedGravity([(0.0, -9.0), (3.0, -7.0), (-1.0, -10.0), (2.0, 5.0)], 4e-4)
FREE = replace(WATER, clamp=False)
LATER = {
    "pair effects": {"effects": PAIRS, "fluid": replace(FREE, kernel="spiky")},
    "extrapolated": {
        "effects": replace(ALL_EFFECTS, gravity=RECORDED, xsph=False),
        "walls": replace(WALLS, pressure="extrapolated", velocity=(0.5, -1.0)),
        "fluid": replace(WATER, kernel="wendland_c2"),
    },
    "periodic": {
        "effects": replace(ALL_EFFECTS, gravity=None),
        "walls": Walls(period_x=PERIOD, period_y=PERIOD),
        "fluid": replace(FREE, kernel="cubic_spline"),
    },
    "plates": {"walls": Walls(plates=[PLATE], restitution=0.5)},
    "moving": {
        "effects": replace(ALL_EFFECTS, gravity=CentralGravity(20.0, 0.1, 0.15)),
        "walls": Walls(CHANNEL, motion=PISTON, box=MOVING.box),
        "integrator": "kick_drift_kick",
    },
    "channel": {
        "effects": replace(ALL_EFFECTS, gravity=ROLLING),
        "walls": Walls(CHANNEL, pressure="extrapolated", slip="free-slip", period_x=PERIOD),
        "integrator": "predictor_corrector",
    },
    "all, euler": {
        "effects": replace(INTEGRATED, gravity=SHAKEN),
        "walls": MOVING,
        "fluid": replace(FREE, kernel="cubic_spline"),
    },
    "all, kick": {
        "effects": replace(INTEGRATED, gravity=SHAKEN),
        "walls": MOVING,
        "fluid": replace(FREE, kernel="quintic_spline"),
        "integrator": "kick_drift_kick",
    },
    "all, predictor": {
        "effects": replace(INTEGRATED, gravity=ROLLING),
        "walls": MOVING,
        "fluid": replace(FREE, kernel="wendland_c2", gamma=3.5),
        "integrator": "predictor_corrector",
    },
}

EVERYTHING = {"effects": ALL_EFFECTS, "walls": WALLS}
CONFIGURATIONS = {
    "none": {},
    "gravity": {"effects": Effects(gravity=(1.5, -9.81))},
    "artificial viscosity": {"effects": Effects(artificial_viscosity=0.3)},
    "laminar viscosity": {"effects": Effects(laminar_viscosity=0.02)},
    "xsph": {"effects": Effects(xsph=True)},
    "wall particles": {"walls": Walls(particles=TANK)},
    "box": {"walls": Walls(box=BOX, restitution=0.5)},
    "open space": {"effects": ALL_EFFECTS},
    "everything": EVERYTHING,
    "everything, wendland": EVERYTHING | {"fluid": replace(WATER, kernel="wendland_c2")},
    "everything, linear": EVERYTHING | {"fluid": replace(WATER, eos="linear")},
    "everything, gamma 5.5": EVERYTHING | {"fluid": replace(WATER, gamma=5.5)},
    "everything, no clamp": EVERYTHING | {"fluid": replace(WATER, clamp=False)},
} | LATER


# what would cost a compilation, and says as much without: the marks of a file
UNCOMPILED = [
    pytest.mark.without_jit,
    pytest.mark.skipif(not config.DISABLE_JIT, reason="runs uncompiled: test_without_jit.py"),
]


def uncompiled(test):
    """The same for one test."""
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
# all of them compiled, the nastiest one uncompiled too
clouds = pytest.mark.parametrize(
    "cloud",
    [
        pytest.param(name, marks=pytest.mark.without_jit if name == "coincident" else ())
        for name in CLOUDS
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
