"""Bodies of fluid in empty space: their start, their exact solution, and what they conserve."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.scenes.shared.reference import Measure, Run
from sph_gym.solver.checks import countable
from sph_gym.solver.simulation import Simulation

Array = NDArray[np.float64]


def rings(radius: float, dx: float) -> Array:
    """Return the places (n, 2) [m] of particles about dx apart on concentric rings dx apart.

    A square lattice that fills a circle has a ragged rim, and is squeezed along its rows where
    the flow is aligned with it. The radius is rounded to a multiple of dx.
    """
    countable(math.pi * (radius / dx) ** 2)
    points = []
    for k in range(max(round(radius / dx), 1)):
        n = max(round(2 * math.pi * (k + 0.5)), 1)
        angle = (np.arange(n) + 0.5 * (k % 2)) * (2 * math.pi / n)
        points.append((k + 0.5) * dx * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
    x = np.concatenate(points)
    return x - x.mean(axis=0)


def semi_axes(x: Array) -> tuple[float, float]:
    """Return the semi-axes along x and y [m] of the ellipse with the second moments of x (n, 2)."""
    width, height = 2 * x.std(axis=0)
    return float(width), float(height)


def ellipse(times: Array, rate: float, omega: float = 0.0, steps: int = 200) -> Array:
    """Return (n, 3) a, b, strain rate [1/s] of an inviscid ellipse with a = b = 1 at time 0.

    u = rate x, v = - rate y at the start, under the central force - omega^2 r:
    d(rate)/dt = (rate^2 + omega^2) (b^2 - a^2) / (b^2 + a^2), da/dt = rate a, db/dt = - rate b.
    times: increasing [s], n of them; steps: of the Runge-Kutta method between two.
    Source: Monaghan 1994; Monaghan & Rafiee 2013.
    """

    def slope(state: Array) -> Array:
        a, b, strain = state
        pull = (strain**2 + omega**2) * (b * b - a * a) / (b * b + a * a)
        return np.array([strain * a, -strain * b, pull])

    now, state, states = 0.0, np.array([1.0, 1.0, rate]), []
    for time in times:
        dt = (time - now) / steps
        for _ in range(steps if dt > 0 else 0):
            k1 = slope(state)
            k2 = slope(state + dt / 2 * k1)
            k3 = slope(state + dt / 2 * k2)
            k4 = slope(state + dt * k3)
            state = state + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        now = time
        states.append(state)
    return np.array(states)


def conserved(sim: Simulation) -> dict[str, Any]:
    """Return momenta, energies and the largest speed of a body; see `Simulation.diagnostics`."""
    numbers = sim.diagnostics()
    return {
        "momentum": np.array([numbers["momentum_x"], numbers["momentum_y"]]),
        "angular_momentum": numbers["angular_momentum"],
        "kinetic": numbers["kinetic_energy"],
        "energy": sum(numbers[f"{kind}_energy"] for kind in ("kinetic", "internal", "potential")),
        "speed": numbers["max_speed"],
    }


def momentum_measures(run: Run, linear: bool = True, angular: bool = True) -> list[Measure]:
    """Judge the largest changes of momentum and angular momentum, which pair forces leave alone.

    Against the mass times the largest speed, and times the size. linear: whether momentum must be
    conserved, since no outer force acts; angular: the same, since no force acts that isn't along
    the line between two particles, as laminar viscosity does.
    """
    sim = run.sim
    scale = sim.mass * sim.n_fluid * float(run.series("speed").max())
    momentum, spin = run.series("momentum"), run.series("angular_momentum")
    size = float(np.hypot(*np.asarray(sim.scene.x).T).max())
    change = float(np.hypot(*(momentum - momentum[0]).T).max())
    turned = float(np.abs(spin - spin[0]).max()) / size
    bound = {True: 1e-12, False: None}
    return [
        Measure("change of momentum", change / scale, "of m v_max", bound[linear]),
        Measure("change of angular momentum", turned / scale, "of m v_max R", bound[angular]),
    ]


def energy_measures(run: Run, most: float | None = None) -> list[Measure]:
    """Judge the change of the kinetic energy, at most `most` % of it, and of the whole energy."""
    kinetic, energy = run.series("kinetic"), run.series("energy")
    at_stake = kinetic.max()
    return [
        Measure(
            "change of kinetic energy", 100 * abs(float(kinetic[-1] / kinetic[0]) - 1), "%", most
        ),
        Measure(
            "change of the whole energy",
            100 * float(np.abs(energy - energy[0]).max() / at_stake),
            "% of kinetic",
        ),
    ]
