"""The native vector environment in the form that Stable-Baselines3 wants."""

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices

from sph_gym.env.tuning import TuningEnv
from sph_gym.env.vector import TuningVectorEnv


class TuningVecEnv(VecEnv):
    """`num_envs` times `TuningEnv` for a Stable-Baselines3 algorithm: PPO("MlpPolicy", this).

    Takes the arguments of `TuningVectorEnv`; no processes and no pickling, since the solvers run
    on threads. Finished episodes are reset at once; the info of their last step holds
    "terminal_observation", "TimeLimit.truncated" and "episode" (return "r", length "l").

    Raises ValueError for what `TuningVectorEnv` refuses, and for reward="vector".
    """

    def __init__(self, num_envs: int = 1, **arguments: Any) -> None:
        if arguments.get("reward") == "vector":
            raise ValueError(
                "reward: expected 'scalar', for Stable-Baselines3 learns from one number, "
                "got 'vector'"
            )
        self.envs = TuningVectorEnv(num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **arguments)
        num_envs = self.envs.num_envs
        self._actions: Any = None
        self._returns, self._lengths = np.zeros(num_envs), np.zeros(num_envs, np.int64)
        super().__init__(
            num_envs, self.envs.single_observation_space, self.envs.single_action_space
        )

    def reset(self) -> NDArray[Any]:
        """Start an episode in all environments, with what `seed` and `set_options` left."""
        for k, env in enumerate(self.envs.envs):
            found = env.reset(seed=self._seeds[k], options=self._options[k] or None)
            self.envs.observations[k], self.reset_infos[k] = found
        self.envs.forget()
        self._returns[:], self._lengths[:] = 0.0, 0
        self._reset_seeds()
        self._reset_options()
        return np.stack(self.envs.observations)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Return observations, rewards (float32), dones and infos."""
        rewards, terminated, truncated, infos, finals = self.envs.play(self._actions)
        over = terminated | truncated
        self._returns += rewards
        self._lengths += 1
        for k, final in enumerate(finals):
            if final is not None:
                self.reset_infos[k] = infos[k]
                episode = {"r": float(self._returns[k]), "l": int(self._lengths[k]), "t": 0.0}
                infos[k] = final[1] | {"terminal_observation": final[0], "episode": episode}
                self._returns[k], self._lengths[k] = 0.0, 0
            infos[k]["TimeLimit.truncated"] = bool(truncated[k] and not terminated[k])
        return np.stack(self.envs.observations), np.array(rewards, np.float32), over, infos

    def close(self) -> None:
        """Close all environments."""
        self.envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return a picture of every environment; None without render_mode="rgb_array"."""
        return self.envs.render() if self.envs.render_mode else [None] * self.num_envs

    # --- single environments ----------------------------------------------------------------

    def _chosen(self, indices: VecEnvIndices) -> list[TuningEnv]:
        return [self.envs.envs[k] for k in self._get_indices(indices)]

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of the chosen environments."""
        return [getattr(env, attr_name) for env in self._chosen(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the chosen environments."""
        for env in self._chosen(indices):
            setattr(env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:  # fmt: skip
        """Call a method of the chosen environments."""
        return [
            getattr(env, method_name)(*method_args, **method_kwargs)
            for env in self._chosen(indices)
        ]

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Return False, except for Monitor: the infos hold episodes as it would add them."""
        from stable_baselines3.common.monitor import Monitor

        return [issubclass(wrapper_class, Monitor)] * len(self._chosen(indices))
