"""The Gymnasium environments: an agent tunes dt, stiffness and XSPH of a running solver."""

from sph_gym.env.registration import SCENES, env_id, register_all, scene_of
from sph_gym.env.tuning import TuningEnv

__all__ = ["SCENES", "TuningEnv", "env_id", "register_all", "scene_of"]
