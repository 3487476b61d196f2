"""The ids under which Gymnasium knows the environments."""

import gymnasium as gym

from sph_gym.env.distributions import FAMILIES
from sph_gym.env.selection import GROUPS

SCENES = tuple(FAMILIES)
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
    known = {env_id(scene): scene for scene in SCENES}
    if id_ not in known:
        raise ValueError(f"id: expected one of {', '.join(known)}, got {id_!r}")
    return known[id_]


def register_all() -> None:
    """Register an id for every scene and group of scenes, and Custom-v1 for one of the user's."""
    entry_point = "sph_gym.env.tuning:TuningEnv"
    vector = "sph_gym.env.vector:TuningVectorEnv"
    for scene in (*SCENES, *GROUPS):
        gym.register(env_id(scene), entry_point, vector_entry_point=vector, kwargs={"scene": scene})
    gym.register(f"sph_gym/Custom-{VERSION}", entry_point, vector_entry_point=vector)
