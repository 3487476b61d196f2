"""Water in a tank: what every scene of this kind observes, and what none of them may do."""

from typing import Any

from sph_gym.scenes.shared.reference import Measure, Run
from sph_gym.solver.checks import ROUNDING
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation


def box(scene: Scene) -> tuple[float, float, float, float]:
    """Return (left, right, floor, lid) of a scene's tank [m], infinite where a side is open."""
    assert scene.walls is not None
    assert scene.walls.box is not None
    return scene.walls.box


def check_room(diameter: float, width: float, dx: float) -> None:
    """Raise ValueError for a drop that has less than three spacings to either wall of its tank."""
    most = width - 6 * dx
    if not diameter <= most * (1 + ROUNDING):
        raise ValueError(
            f"diameter: expected at most width - 6 dx = {most:g} m, got {diameter:g} m"
        )


def outside(sim: Simulation) -> float:
    """Return the distance of the farthest particle outside the tank [m], 0 for none."""
    left, right, floor, lid = box(sim.scene)
    x, y = sim.x[: sim.n_fluid].astype(float).T
    return float(max(left - x.min(), x.max() - right, floor - y.min(), y.max() - lid, 0.0))


def weight(sim: Simulation) -> float:
    """Return m g of all the fluid [N/m], by the final strength of its gravity."""
    gravity = sim.scene.effects.gravity_at(float("inf"))
    return float(sim.mass * sim.n_fluid * (gravity @ gravity) ** 0.5)


def observe(sim: Simulation) -> dict[str, Any]:
    """Return the mean density error, the energy excess, and the distance outside the tank [m]."""
    numbers = sim.diagnostics()
    return {
        "density": numbers["density_error"],
        "excess": numbers["energy_excess"],
        "outside": outside(sim),
    }


def judge(run: Run) -> list[Measure]:
    """Judge compression, spurious energy and leaks, none of which may occur in any tank."""
    density, excess, farthest = (
        float(run.series(name).max()) for name in ("density", "excess", "outside")
    )
    return [
        Measure("largest mean density error", 100 * density, "%", 1.0),
        Measure("spurious energy", excess, "of what is at stake", 0.01),
        Measure("farthest particle outside the tank", farthest, "m", 0.0),
    ]
