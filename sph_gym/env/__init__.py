"""The Gymnasium environments: an agent tunes dt, stiffness and XSPH of a running solver."""

from typing import TYPE_CHECKING, Any

from sph_gym.env.registration import SCENES, env_id, register_all, scene_of

if TYPE_CHECKING:
    from sph_gym.env.tuning import TuningEnv
else:

    def __getattr__(name: str) -> Any:
        """Import `TuningEnv` when it is first used: the solver behind it takes most of a second."""
        if name != "TuningEnv":
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from sph_gym.env.tuning import TuningEnv

        return TuningEnv


__all__ = ["SCENES", "TuningEnv", "env_id", "register_all", "scene_of"]
