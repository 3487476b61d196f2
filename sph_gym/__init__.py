"""A 2D SPH fluid solver, and Gymnasium environments in which an agent tunes it."""

from sph_gym import scenes
from sph_gym.env import TuningEnv, register_all
from sph_gym.provenance import VERSION
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
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.simulation import Report, Simulation
from sph_gym.solver.state import Controls
from sph_gym.solver.walls import Motion, Walls

__version__ = VERSION

register_all()

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
