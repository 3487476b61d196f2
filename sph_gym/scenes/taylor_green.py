"""Taylor-Green vortices in a periodic square: they keep their shape and decay by viscosity."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.scenes.shared.reference import Chart, Curve, Measure, Reference, Run
from sph_gym.scenes.shared.refinement import Refinement
from sph_gym.solver.checks import at_least_spacings, in_range, positive, whole
from sph_gym.solver.geometry import lattice, snap
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls

Array = NDArray[np.float64]
# Particles across from which on the bound holds, and the bound.
ENOUGH, BOUND = 50, 0.05


def taylor_green(
    dx: float = 1 / 50,
    size: float = 1.0,
    speed: float = 1.0,
    reynolds: float = 100.0,
    jitter: float = 0.1,
    seed: int = 0,
) -> Scene:
    """Four vortices in a square that closes upon itself, for size / speed seconds.

    size: [m], rounded to a multiple of dx; speed: the largest at the start [m/s]; reynolds: speed
    size / nu; jitter: of the positions at the start [dx], by the generator `seed`. Stagnation
    points draw a perfect lattice out into threads without ever crowding it; from small
    irregularities on, shifting undoes that. A wide support, since pressure that follows the
    noise of the densities brakes the flow: at 3 dx the error is twice as large.
    """
    dx, speed = positive("dx", dx), positive("speed", speed)
    size = snap(at_least_spacings("size", size, 16, dx), dx)
    jitter = in_range("jitter", jitter, 0.0, 0.5)
    rng = np.random.default_rng(whole("seed", seed))
    x = lattice(0.0, size, 0.0, size, dx)
    x = (x + jitter * dx * rng.uniform(-1.0, 1.0, x.shape)) % size
    return Scene(
        "taylor_green",
        x=x,
        v=speed * velocity(x / size),
        dx=dx,
        h=4.0 * dx,
        fluid=Fluid(c0=sound_speed(speed), kernel="wendland_c2", clamp=False),
        effects=Effects(
            laminar_viscosity=speed * size / positive("reynolds", reynolds), shifting=1.0
        ),
        walls=Walls(period_x=(0.0, size), period_y=(0.0, size)),
        duration=size / speed,
        frame=0.02 * size / speed,
    )


def velocity(x: Array) -> Array:
    """Return velocities / U (n, 2) at places x / L (n, 2), at the start."""
    k = 2 * math.pi * x
    u = -np.cos(k[:, 0]) * np.sin(k[:, 1])
    v = np.sin(k[:, 0]) * np.cos(k[:, 1])
    return np.stack([u, v], axis=-1)


def rate(sim: Simulation) -> float:
    """Return the decay rate of velocities [1/s], 2 nu (2 pi / L)^2, half that of energies."""
    nu = sim.scene.effects.laminar_viscosity
    assert nu is not None
    return 2 * nu * (2 * math.pi / _size(sim)) ** 2


def _size(sim: Simulation) -> float:
    walls = sim.scene.walls
    assert walls is not None
    assert walls.period_x is not None
    return walls.period_x[1] - walls.period_x[0]


def _exact(sim: Simulation) -> Array:
    """Return the exact velocities (n, 2) [m/s] where the particles are."""
    start, shape = np.asarray(sim.scene.v), velocity(np.asarray(sim.scene.x) / _size(sim))
    speed = float((start * shape).sum() / (shape**2).sum())
    return speed * math.exp(-rate(sim) * sim.time) * velocity(sim.x / _size(sim))


def error(sim: Simulation) -> float:
    """Return the L1 error of the speed: sum | |v| - |v_exact| | / sum |v_exact|."""
    speed, exact = np.hypot(*sim.v.T), np.hypot(*_exact(sim).T)
    return float(np.abs(speed - exact).sum() / exact.sum())


def observe(sim: Simulation) -> dict[str, Any]:
    """Return the error in three norms and the kinetic energy [J/m]."""
    exact = _exact(sim)
    size = np.hypot(*exact.T)
    return {
        "error": error(sim),
        "vector": float(np.hypot(*(sim.v - exact).T).sum() / size.sum()),
        "of_largest": float(np.abs(np.hypot(*sim.v.T) - size).mean() / size.max()),
        "kinetic": sim.diagnostics()["kinetic_energy"],
    }


def decay_rate(run: Run) -> float:
    """Return the decay rate of the kinetic energy [1/s], fitted to the whole run."""
    slope = np.polynomial.Polynomial.fit(run.times, np.log(run.series("kinetic")), 1).deriv()
    return -float(slope(0.0))


def judge(run: Run) -> list[Measure]:
    """Judge the error at the end in three norms, and the decay rate of the energy."""
    end = run.seen[-1]
    fine = _size(run.sim) / run.sim.scene.dx > ENOUGH - 0.5
    too_fast = decay_rate(run) / (2 * rate(run.sim)) - 1
    return [
        Measure("L1 error of the speed / L1 of it", end["error"], "", BOUND if fine else None),
        Measure("mean error of the speed / largest speed", end["of_largest"], ""),
        Measure("L1 error of the vector / L1 of it", end["vector"], ""),
        Measure("decay rate of the kinetic energy, error", 100 * abs(too_fast), "%"),
    ]


def chart(run: Run) -> Chart:
    """Draw the decay of the kinetic energy."""
    kinetic = run.series("kinetic")
    exact = np.exp(-2 * rate(run.sim) * run.times)
    curves = [
        Curve("sph_gym", run.times, kinetic / kinetic[0]),
        Curve("exact", run.times, exact, reference=True),
    ]
    return Chart("t [s]", "kinetic energy / at the start", curves)


SOURCE = "Taylor & Green 1937, exact; L1 as PySPH's example takes it"
RESOLUTIONS = ({"dx": 1 / 25}, {"dx": 1 / 50}, {"dx": 1 / 100})
REFERENCE = Reference(SOURCE, "", error, observe, judge, chart, RESOLUTIONS, quick=2)

REFINEMENT = Refinement(
    "taylor_green", "size", (25, 35, 50, 71, 100), 50,
    "L1 error of the speed / L1 of it", "of its L1 norm",
    "About first order, a little less when fine: disorder costs the sums their second order, "
    "and shifting gives only some of it back.",
    order=0.74, others=({"reynolds": 50.0, "seed": 1}, {"reynolds": 400.0}), joined=5,
)  # fmt: skip
