"""A 2D SPH fluid solver, and Gymnasium environments in which an agent tunes it."""

from sph_gym import scenes
from sph_gym.env import TuningEnv, register_all
from sph_gym.solver.batch import advance_all
from sph_gym.solver.scene import Effects, Fluid, Gravity, Scene, sound_speed
from sph_gym.solver.simulation import Report, Simulation
from sph_gym.solver.state import Controls
from sph_gym.solver.walls import Walls, lattice, tank_particles

__version__ = "0.1.0"

register_all()

__all__ = [
    "Controls",
    "Effects",
    "Fluid",
    "Gravity",
    "Report",
    "Scene",
    "Simulation",
    "TuningEnv",
    "Walls",
    "advance_all",
    "lattice",
    "scenes",
    "sound_speed",
    "tank_particles",
]
