"""A 2D SPH fluid solver, and Gymnasium environments in which an agent tunes it."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from sph_gym.env import register_all
from sph_gym.provenance import VERSION

if TYPE_CHECKING:
    from sph_gym import scenes
    from sph_gym.env import TuningEnv
    from sph_gym.solver.batch import advance_all
    from sph_gym.solver.gauges import Gauge
    from sph_gym.solver.geometry import (
        channel_particles,
        disc,
        lattice,
        plate_particles,
        tank_particles,
    )
    from sph_gym.solver.gravity import (
        CentralGravity,
        Gravity,
        RecordedGravity,
        RollingTank,
        ShakenGravity,
    )
    from sph_gym.solver.report import Report
    from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
    from sph_gym.solver.simulation import Simulation
    from sph_gym.solver.state import Controls
    from sph_gym.solver.walls import Motion, Walls

__version__ = VERSION

register_all()

# Public names by the module that has them. They are imported when they are first used: numba and
# the solver take most of a second, and a look-up of an environment's id needs neither.
_PLACES = {
    "env.tuning": ("TuningEnv",),
    "solver.batch": ("advance_all",),
    "solver.gauges": ("Gauge",),
    "solver.geometry": (
        "channel_particles", "disc", "lattice", "plate_particles", "tank_particles",
    ),
    "solver.gravity": (
        "CentralGravity", "Gravity", "RecordedGravity", "RollingTank", "ShakenGravity",
    ),
    "solver.report": ("Report",),
    "solver.scene": ("Effects", "Fluid", "Scene", "sound_speed"),
    "solver.simulation": ("Simulation",),
    "solver.state": ("Controls",),
    "solver.walls": ("Motion", "Walls"),
}  # fmt: skip
_MODULES = {name: module for module, names in _PLACES.items() for name in names}

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Import a public name. Raises AttributeError for others."""
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])


__all__ = [
    "CentralGravity",
    "Controls",
    "Effects",
    "Fluid",
    "Gauge",
    "Gravity",
    "Motion",
    "RecordedGravity",
    "Report",
    "RollingTank",
    "Scene",
    "ShakenGravity",
    "Simulation",
    "TuningEnv",
    "Walls",
    "advance_all",
    "channel_particles",
    "disc",
    "lattice",
    "plate_particles",
    "scenes",
    "sound_speed",
    "tank_particles",
]
