"""A 2D SPH fluid solver, and Gymnasium environments in which an agent tunes it."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from sph_gym.env import register_all
from sph_gym.provenance import VERSION

if TYPE_CHECKING:
    # "as" tells type checkers that the names are public
    from sph_gym import scenes as scenes
    from sph_gym.env import TuningEnv as TuningEnv
    from sph_gym.solver.batch import advance_all as advance_all
    from sph_gym.solver.gauges import Gauge as Gauge
    from sph_gym.solver.geometry import channel_particles as channel_particles
    from sph_gym.solver.geometry import disc as disc
    from sph_gym.solver.geometry import lattice as lattice
    from sph_gym.solver.geometry import plate_particles as plate_particles
    from sph_gym.solver.geometry import tank_particles as tank_particles
    from sph_gym.solver.gravity import CentralGravity as CentralGravity
    from sph_gym.solver.gravity import Gravity as Gravity
    from sph_gym.solver.gravity import RecordedGravity as RecordedGravity
    from sph_gym.solver.gravity import RollingTank as RollingTank
    from sph_gym.solver.gravity import ShakenGravity as ShakenGravity
    from sph_gym.solver.report import Report as Report
    from sph_gym.solver.scene import Effects as Effects
    from sph_gym.solver.scene import Fluid as Fluid
    from sph_gym.solver.scene import Scene as Scene
    from sph_gym.solver.scene import sound_speed as sound_speed
    from sph_gym.solver.simulation import Simulation as Simulation
    from sph_gym.solver.state import Controls as Controls
    from sph_gym.solver.walls import Motion as Motion
    from sph_gym.solver.walls import Walls as Walls

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
__all__ = sorted(["scenes", *_MODULES])

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
