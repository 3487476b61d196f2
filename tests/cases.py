"""What the solver is tested on: every effect alone, none, and all together, on all sorts of clouds.

All lengths in metres; dx is 0.02 and a full cloud is a square of 12 x 12 particles.
"""

from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Controls, Effects, Fluid, Scene, Simulation, Walls, lattice, tank_particles

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
}


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
