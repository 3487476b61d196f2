"""The ids under which Gymnasium knows the environments."""

import gymnasium as gym

from sph_gym import scenes
from sph_gym.solver.checks import known

SCENES = scenes.with_family()
# Names that stand for several of them; `sph_gym.env.selection` knows which.
GROUPS = ("mixed", "benchmark")
VERSION = "v1"
# Changes of the environments, the newest first.
HISTORY = {
    "v1": (
        "the first version that was published: contexts, a reference with matched kernels, the "
        "noise term, epsilon from 0 to 1; ids follow the scenes"
    ),
    "v0": "a draft, gone",
}


def env_id(scene: str) -> str:
    """Return the id of an environment: "dam_break" -> "sph_gym/DamBreak-v1"."""
    return f"sph_gym/{scene.title().replace('_', '')}-{VERSION}"


def scene_of(id_: str) -> str:
    """Return the name of the environment of an id. Raises ValueError that lists the known ids."""
    by_id = {env_id(scene): scene for scene in SCENES}
    return by_id[known("id", id_, by_id)]


def register_all() -> None:
    """Register an id for every scene and group of scenes, and Custom-v1 for one of the user's."""
    entry_point = "sph_gym.env.tuning:TuningEnv"
    vector = "sph_gym.env.vector:TuningVectorEnv"
    for scene in (*SCENES, *GROUPS):
        gym.register(env_id(scene), entry_point, vector_entry_point=vector, kwargs={"scene": scene})
    gym.register(f"sph_gym/Custom-{VERSION}", entry_point, vector_entry_point=vector)
