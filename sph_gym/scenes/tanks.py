"""What scenes in a tank ask of a simulation, and what none of them may do."""

from typing import Any

from sph_gym.scenes.reference import Measure, Run
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation


def box(scene: Scene) -> tuple[float, float, float, float]:
    """(left, right, floor, lid) of a scene's tank [m], infinite where a side is open."""
    assert scene.walls is not None
    assert scene.walls.box is not None
    return scene.walls.box


def outside(sim: Simulation) -> float:
    """How far outside the tank the farthest particle is [m]."""
    left, right, floor, lid = box(sim.scene)
    x, y = sim.x[: sim.n_fluid].astype(float).T
    return float(max(left - x.min(), x.max() - right, floor - y.min(), y.max() - lid, 0.0))


def weight(sim: Simulation) -> float:
    """m g of all the fluid [N/m], by the strength that its gravity has for good."""
    gravity = sim.scene.effects.gravity_at(float("inf"))
    return float(sim.mass * sim.n_fluid * (gravity @ gravity) ** 0.5)


def observe(sim: Simulation) -> dict[str, Any]:
    """Mean density error, energy from nowhere, and how far outside the tank anybody is [m]."""
    numbers = sim.diagnostics()
    return {
        "density": numbers["density_error"],
        "excess": numbers["energy_excess"],
        "outside": outside(sim),
    }


def judge(run: Run) -> list[Measure]:
    """What can't be, or shouldn't, in any tank."""
    density, excess, farthest = (
        float(run.series(name).max()) for name in ("density", "excess", "outside")
    )
    return [
        Measure("largest mean density error", 100 * density, "%", 1.0),
        Measure("energy from nowhere", excess, "of what is at stake", 0.01),
        Measure("farthest particle outside the tank", farthest, "m", 0.0),
    ]
