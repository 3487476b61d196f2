"""Water at rest in a tank: after gravity has come on, nothing should move."""

import math

import numpy as np

from sph_gym.solver.checks import in_range, positive
from sph_gym.solver.geometry import lattice, snap, tank_particles
from sph_gym.solver.gravity import Gravity
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.walls import Walls


def hydrostatic_tank(
    dx: float = 0.025,
    width: float = 0.5,
    depth: float = 0.5,
    ramp: float = 1.0,
    gravity: float = 9.81,
) -> Scene:
    """A tank filled to `depth`, with gravity raised from zero over `ramp` seconds.

    width, depth: [m], rounded to multiples of dx; gravity: downwards [m/s^2]. A matched kernel,
    since the article's pair heats a fluid at rest under pressure (it isn't the derivative of one
    energy), and enough artificial viscosity to calm what the ramp stirs up.
    """
    dx, gravity = positive("dx", dx), positive("gravity", gravity)
    width, depth = in_range("width", width, 3 * dx), in_range("depth", depth, 3 * dx)
    width, depth = snap(width, dx), snap(depth, dx)
    return Scene(
        "hydrostatic_tank",
        x=lattice(0.0, width, 0.0, depth, dx),
        dx=dx,
        h=3.0 * dx,
        fluid=Fluid(c0=sound_speed(math.sqrt(2 * gravity * depth)), kernel="wendland_c2"),
        effects=Effects(
            gravity=Gravity(0.0, -gravity, ramp=in_range("ramp", ramp, 0.0)),
            xsph=True,
            artificial_viscosity=0.5,
        ),
        walls=Walls(
            particles=tank_particles(width, 1.25 * depth, dx),
            box=(0.0, width, 0.0, math.inf),
        ),
        duration=ramp + 5.0,
        frame=0.05,
    )


def bottom_pressure_error(sim: Simulation) -> float:
    """(p - rho0 g H) / (rho0 g H) at the floor: the linear fit of p over the fluid's depth."""
    x, p = sim.x[: sim.n_fluid], sim.p[: sim.n_fluid]
    gravity = sim.scene.effects.gravity
    assert isinstance(gravity, Gravity)
    depth = float(np.ptp(np.asarray(sim.scene.x)[:, 1])) + sim.scene.dx
    inner = (x[:, 1] > 0.1 * depth) & (x[:, 1] < 0.7 * depth)
    at_floor = np.polynomial.Polynomial.fit(x[inner, 1], p[inner], 1)(0.0)
    expected = -sim.scene.fluid.rho0 * gravity.y * depth
    return float(at_floor / expected - 1)
