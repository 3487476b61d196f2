"""Faults of the links "xsph", "integration" and "walls": what becomes of accelerations."""

import numpy as np

from sph_gym.doctor.case import Array
from sph_gym.doctor.faults.registry import replaces
from sph_gym.doctor.plain import Plain


@replaces("advance", "xsph", 7)
def xsph_kicks(solver: Plain, dt: float) -> None:
    """XSPH changes the velocities themselves, not only what moves the particles."""
    solver.v = solver.v + dt * solver.a
    solver.v = solver.v + solver.xsph()
    solver.x = solver.x + dt * solver.v


@replaces("xsph", "xsph", 7)
def xsph_away(solver: Plain) -> Array:
    """XSPH has the wrong sign: it moves a particle away from what its neighbours do."""
    return -Plain.xsph(solver)


@replaces("xsph", "xsph", 7)
def xsph_undivided(solver: Plain) -> Array:
    """XSPH doesn't divide by the density."""
    share = solver.case.xsph * solver.mass * solver.weight(solver.r)
    return solver.total_vector(share[:, None] * (solver.v[solver.j] - solver.v[solver.i]))


@replaces("xsph", "xsph", 7)
def xsph_full(solver: Plain) -> Array:
    """XSPH doesn't look at epsilon: it is 1 at all times."""
    share = (
        2 * solver.mass * solver.weight(solver.r) / (solver.rho[solver.i] + solver.rho[solver.j])
    )
    return solver.total_vector(share[:, None] * (solver.v[solver.j] - solver.v[solver.i]))


@replaces("xsph", "xsph", 7)
def xsph_absolute(solver: Plain) -> Array:
    """XSPH adds the neighbours' velocities instead of the differences from them."""
    share = solver.case.xsph * solver.mass * solver.weight(solver.r) / solver.rho[solver.j]
    return solver.total_vector(share[:, None] * solver.v[solver.j])


@replaces("advance", "integration", 3)
def forward_euler(solver: Plain, dt: float) -> None:
    """Old velocities move the particles: forward Euler, which feeds every oscillation."""
    solver.x = solver.x + dt * (solver.v + solver.xsph())
    solver.v = solver.v + dt * solver.a


@replaces("step", "integration", 3)
def late_acceleration(solver: Plain, dt: float) -> None:
    """Velocities are changed by the accelerations of the step before."""
    late = solver.a
    solver.evaluate()
    present, solver.a = solver.a, late
    solver.advance(dt)
    solver.bounce()
    solver.a = present


@replaces("advance", "integration", 3)
def own_dt(solver: Plain, dt: float) -> None:
    """dt is ignored: every step is 0.2 ms."""
    Plain.advance(solver, 2e-4)


@replaces("advance", "integration", 3)
def kick_dt_squared(solver: Plain, dt: float) -> None:
    """Velocities change by dt^2 a: accelerations had been multiplied by dt already."""
    solver.v = solver.v + dt**2 * solver.a
    solver.x = solver.x + dt * (solver.v + solver.xsph())


@replaces("advance", "integration", 3)
def half_drift(solver: Plain, dt: float) -> None:
    """Positions are moved by half a step: the second half of a leapfrog is missing."""
    solver.v = solver.v + dt * solver.a
    solver.x = solver.x + dt / 2 * (solver.v + solver.xsph())


@replaces("advance", "integration", 7)
def fading(solver: Plain, dt: float) -> None:
    """A hundredth of every velocity is lost in every step."""
    Plain.advance(solver, dt)
    solver.v = 0.99 * solver.v


@replaces("advance", "integration", 3)
def gravity_again(solver: Plain, dt: float) -> None:
    """The step adds gravity, which is in the accelerations already."""
    solver.v = solver.v + dt * solver.case.gravity
    Plain.advance(solver, dt)


@replaces("advance", "integration", 3)
def speed_limit(solver: Plain, dt: float) -> None:
    """Velocities are cut off at 0.05 c0, so that nothing explodes."""
    Plain.advance(solver, dt)
    speed = np.linalg.norm(solver.v, axis=1, keepdims=True)
    solver.v = solver.v * np.minimum(1.0, 0.05 * solver.c0 / np.maximum(speed, 1e-12))


@replaces("bounce", "walls")
def no_walls(solver: Plain) -> None:
    """The box is ignored."""
    pass


@replaces("bounce", "walls")
def velocity_kept(solver: Plain) -> None:
    """Walls put particles back but keep their velocities, which go on into the wall."""
    for axis, side, outward in solver.sides():
        solver.x[outward * (solver.x[:, axis] - side) > 0, axis] = side


@replaces("bounce", "walls")
def trembles(solver: Plain) -> None:
    """Walls turn the velocities of all that is outside, but put no particle back."""
    for axis, side, outward in solver.sides():
        solver.v[outward * (solver.x[:, axis] - side) > 0, axis] *= -0.3


@replaces("bounce", "walls")
def restitution_of_1_5(solver: Plain) -> None:
    """Particles come back from a wall faster than they came."""
    came = solver.v.copy()
    Plain.bounce(solver)
    for axis, _, outward in solver.sides():
        turned = (outward * came[:, axis] > 0) & (solver.v[:, axis] != came[:, axis])
        solver.v[turned, axis] = -1.5 * came[turned, axis]


@replaces("sides", "walls")
def no_right_wall(solver: Plain) -> list[tuple[int, float, int]]:
    """The right side of the box is forgotten."""
    return [side for side in Plain.sides(solver) if side[::2] != (0, 1)]


@replaces("sides", "walls")
def floor_only(solver: Plain) -> list[tuple[int, float, int]]:
    """Only the floor of the box is there."""
    return [side for side in Plain.sides(solver) if side[::2] == (1, -1)]


@replaces("bounce", "walls")
def thin_walls(solver: Plain) -> None:
    """Walls are h / 50 thick: what gets farther than that in a step is through."""
    x, v = solver.x.copy(), solver.v.copy()
    Plain.bounce(solver)
    through = np.abs(x - solver.x).max(axis=1) > 0.02 * solver.h
    solver.x[through], solver.v[through] = x[through], v[through]


@replaces("bounce", "walls")
def wrong_component(solver: Plain) -> None:
    """Walls turn the velocity along them instead of the one across."""
    for axis, side, outward in solver.sides():
        outside = outward * (solver.x[:, axis] - side) > 0
        solver.x[outside, axis] = side
        solver.v[outside, 1 - axis] *= -1.0


@replaces("bounce", "walls")
def all_on_a_line(solver: Plain) -> None:
    """A wall that one particle passes puts all particles onto its line."""
    for axis, side, outward in solver.sides():
        if (outward * (solver.x[:, axis] - side) > 0).any():
            solver.x[:, axis] = side


@replaces("bounce", "walls")
def half_walled(solver: Plain) -> None:
    """Walls look at the first half of the particles only."""
    x, v = solver.x.copy(), solver.v.copy()
    Plain.bounce(solver)
    free = np.arange(solver.n) >= solver.n / 2
    solver.x[free], solver.v[free] = x[free], v[free]
