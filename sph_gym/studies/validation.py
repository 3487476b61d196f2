"""The physics against experiment and against what must be: every scene that has a yardstick."""

import numpy as np

from sph_gym import scenes
from sph_gym.scenes.dam_break import front_error, front_history
from sph_gym.scenes.hydrostatic_tank import bottom_pressure_error
from sph_gym.solver.gravity import Gravity
from sph_gym.solver.simulation import Simulation
from sph_gym.studies.table import Row

SHIFTS = np.linspace(0.0, 0.4, 81)


def measure(quick: bool) -> list[Row]:
    """All rows; quick: the coarsest resolution that the bounds are meant for."""
    spacings = (0.02,) if quick else (0.02, 0.0125)
    rows = [row for dx in spacings for row in dam_break(dx)]
    return [*rows, *hydrostatic_tank(), *relaxation()]


def dam_break(dx: float, width: float = 0.5) -> list[Row]:
    """Surge front against Martin & Moyce 1952, column ratio 2, up to T = 3.3."""
    scene = scenes.make("dam_break", dx=dx, width=width, height=2 * width)
    sim = Simulation(scene)
    density, outside = [], []

    def look(sim: Simulation) -> None:
        x, y = sim.x[: sim.n_fluid].T
        density.append(sim.diagnostics()["density_error"])
        outside.append(max(-y.min(), -x.min(), x.max() - 7 * width, 0.0))

    history = front_history(sim, width, look=look)
    case = f"dam_break, a/{width / dx:.0f}"
    best = min(front_error(history, shift) for shift in SHIFTS)
    return [
        Row("RMS front error, raw", case, 100 * front_error(history), "%", 9.0),
        Row("RMS front error, best time shift", case, 100 * best, "%", 4.5),
        Row("largest mean density error", case, 100 * max(density), "%", 1.0),
        Row("farthest particle outside the tank", case, float(max(outside)), "m", 0.0),
    ]


def hydrostatic_tank() -> list[Row]:
    """Pressure at the bottom and what still moves, 5 s after gravity has come on."""
    sim = Simulation(scenes.make("hydrostatic_tank"))
    gravity = sim.scene.effects.gravity
    assert isinstance(gravity, Gravity)
    kinetic = []
    while sim.time < gravity.ramp + 5.0 - 1e-9:
        sim.advance(0.05)
        kinetic.append(sim.diagnostics()["kinetic_energy"])
    last, peak = max(kinetic[-20:]), max(kinetic)
    # frames of the second that begins one second after the ramp
    then = max(kinetic[-80:-60])
    error = abs(bottom_pressure_error(sim))
    return [
        Row("bottom pressure error", "hydrostatic_tank", 100 * error, "% of rho g H", 3.0),
        Row("kinetic energy in the last second", "hydrostatic_tank", last / peak, "of peak", 0.1),
        Row("the same, against the second after", "hydrostatic_tank", last / then, "", 2.0),
    ]


def relaxation() -> list[Row]:
    """The blob in empty space after 2 s."""
    sim = Simulation(scenes.make("relaxation"))
    radius = np.hypot(*sim.x.T).max()
    kinetic = []
    while sim.time < 2.0 - 1e-9:
        sim.advance(0.02)
        kinetic.append(sim.diagnostics()["kinetic_energy"])
    numbers = sim.diagnostics()
    change = abs(np.hypot(*sim.x.T).max() / radius - 1)
    momentum = np.hypot(numbers["momentum_x"], numbers["momentum_y"])
    return [
        Row("kinetic energy", "relaxation", kinetic[-1] / max(kinetic), "of peak", 1e-6),
        Row("change of radius", "relaxation", 100 * float(change), "%", 5.0),
        Row(
            "median spacing off dx", "relaxation",
            100 * abs(numbers["median_spacing"] - 1), "%", 5.0,
        ),
        Row(
            "centre of mass", "relaxation",
            float(np.hypot(numbers["com_x"], numbers["com_y"])), "m", 1e-12,
        ),
        Row("momentum", "relaxation", float(momentum), "kg/s", 1e-12),
    ]  # fmt: skip
