"""Many environments at once: the same episodes, advanced side by side on threads."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, iterate
from numpy.typing import NDArray

from sph_gym.env.selection import own_scene
from sph_gym.env.tuning import TuningEnv, plain_spec
from sph_gym.solver import teams
from sph_gym.solver.checks import known, whole

MODES = {mode.value: mode for mode in AutoresetMode}


class TuningVectorEnv(VectorEnv[NDArray[Any], NDArray[Any], NDArray[Any]]):
    """`num_envs` times `TuningEnv`, to the last bit, but faster.

    It steps single environments side by side on threads: their solvers are compiled code that
    needs no interpreter. Environment k of a vector that is reset with seed s gets s + k.

    - `num_envs`: how many
    - `threads`: how many at most, by default the CPUs that the process may use; changes no result
    - `autoreset_mode`: of `gymnasium.vector.AutoresetMode`, or its value
    - `max_episode_steps`: truncate after so many steps, as `gymnasium.make` would
    - `render_mode`: None or "rgb_array"

    All other arguments are those of `TuningEnv`.

    Raises ValueError for what `TuningEnv` refuses.
    """

    metadata = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": 30,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        threads: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        self.num_envs = num_envs = whole("num_envs", num_envs, at_least=1)
        self.threads = None if threads is None else whole("threads", threads, at_least=1)
        if not isinstance(autoreset_mode, AutoresetMode):
            autoreset_mode = MODES[known("autoreset_mode", autoreset_mode, MODES)]
        self.autoreset_mode = autoreset_mode
        self.metadata = {**self.metadata, "autoreset_mode": autoreset_mode}
        if max_episode_steps is not None:
            max_episode_steps = whole("max_episode_steps", max_episode_steps, at_least=1)
        self.max_episode_steps = max_episode_steps
        if render_mode is not None:
            known("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self._spec: EnvSpec | None = None
        arguments["scene"] = own_scene(arguments.get("scene"))
        self.envs = [TuningEnv(**arguments, render_mode=render_mode) for _ in range(num_envs)]
        for k, env in enumerate(self.envs):
            # a list of instances is shown from another place on in each of them
            env.selection.turn = k
        self.single_action_space = self.envs[0].action_space
        self.single_observation_space = self.envs[0].observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.observations: list[Any] = [None] * num_envs
        self._elapsed = np.zeros(num_envs, np.int64)
        self._over = np.zeros(num_envs, np.bool_)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The generators of all environments."""
        return tuple(env.np_random for env in self.envs)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """Their seeds."""
        return tuple(env.np_random_seed for env in self.envs)

    @property
    def spec(self) -> EnvSpec | None:
        """The recipe of this vector; see `TuningEnv.spec`."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        n_steps = None if self.max_episode_steps else self.envs[0].fixed_length()
        self._spec = spec and plain_spec(spec, n_steps)

    # --- reset ------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Any = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Start an episode in all environments, or in those of `options["reset_mask"]`.

        seed: of the first environment, the others count on; or one each, None for no new one.
        Raises ValueError for wrong seeds and options, before anything is reset.
        """
        if not isinstance(options, dict | None):
            raise ValueError(f"options: expected a dictionary, got {options!r}")
        options = dict(options or {})
        mask, seeds = self._mask(options.pop("reset_mask", None)), self._seeds(seed)
        infos: list[dict[str, Any] | None] = [None] * self.num_envs
        chosen = np.flatnonzero(mask).tolist()
        tasks = [partial(self._reset, k, seeds[k], options or None) for k in chosen]
        for k, info in zip(chosen, side_by_side(tasks, self.threads), strict=True):
            infos[k] = info
        return np.stack(self.observations), _columns(infos)

    def _reset(self, k: int, seed: int | None = None, options: Any = None) -> dict[str, Any]:
        self.observations[k], info = self.envs[k].reset(seed=seed, options=options)
        self._elapsed[k], self._over[k] = 0, False
        return info

    def forget(self) -> None:
        """Count all episodes as new, after single environments were reset from outside."""
        self._elapsed[:], self._over[:] = 0, False

    def _mask(self, mask: Any) -> NDArray[np.bool_]:
        if mask is None:
            return np.ones(self.num_envs, np.bool_)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f"reset_mask: expected an array of booleans, got {mask!r}")
        if mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(
                f"reset_mask: expected shape ({self.num_envs},) and at least one True, got {mask!r}"
            )
        new = [k for k, seen in enumerate(self.observations) if seen is None and not mask[k]]
        if new:
            raise ValueError(f"reset_mask: expected {new} too, which were never reset")
        return mask

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, (Sequence, np.ndarray)) and not isinstance(seed, str):
            if len(seed) != self.num_envs:
                raise ValueError(f"seed: expected {self.num_envs} of them, got {len(seed)}")
            return [None if each is None else whole("seed", each) for each in seed]
        first = whole("seed", seed)
        return [first + k for k in range(self.num_envs)]

    # --- step -------------------------------------------------------------------------------

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Play one step of every environment; what has ended is reset, as the mode says.

        Raises ValueError for actions that are none, before anything moves, and ResetNeeded for
        ended episodes if the mode is "Disabled".
        """
        rewards, terminated, truncated, infos, finals = self.play(actions)
        result = _columns(infos) | _final(finals)
        return np.stack(self.observations), np.array(rewards), terminated, truncated, result

    def play(
        self, actions: NDArray[Any]
    ) -> tuple[list[Any], NDArray[np.bool_], NDArray[np.bool_], list[Any], list[Any]]:
        """Do a `step`, and return a list of infos, and one of last observations and infos or None.

        Raises as `step`.
        """
        waiting = self._over & (self.autoreset_mode == AutoresetMode.NEXT_STEP)
        playing, resting = np.flatnonzero(~waiting).tolist(), np.flatnonzero(waiting).tolist()
        given = self._check(actions, playing)
        infos: list[Any] = [None] * self.num_envs
        finals: list[Any] = [None] * self.num_envs
        terminated, truncated = np.zeros((2, self.num_envs), np.bool_)
        rules = self.envs[0].rules
        rewards: list[Any] = [rules.reward_of([0.0] * len(rules.weights))] * self.num_envs
        tasks: list[Callable[[], Any]] = [partial(self._step, k, given[k]) for k in playing]
        tasks += [partial(self._reset, k) for k in resting]
        results = side_by_side(tasks, self.threads)
        for k, result in zip(playing, results, strict=False):
            self.observations[k], rewards[k], terminated[k], truncated[k], infos[k] = result
        for k, info in zip(resting, results[len(playing) :], strict=True):
            infos[k] = info
        self._elapsed[playing] += 1
        if self.max_episode_steps is not None:
            truncated[playing] |= self._elapsed[playing] >= self.max_episode_steps
        self._over = terminated | truncated
        if self.autoreset_mode == AutoresetMode.SAME_STEP:
            ended = np.flatnonzero(self._over).tolist()
            for k in ended:
                finals[k] = self.observations[k], infos[k]
            begun = side_by_side([partial(self._reset, k) for k in ended], self.threads)
            for k, info in zip(ended, begun, strict=True):
                infos[k] = info
        return rewards, terminated, truncated, infos, finals

    def _check(self, actions: NDArray[Any], playing: list[int]) -> list[Any]:
        """Return one action an environment, once all are known to be possible."""
        try:
            given = list(iterate(self.action_space, actions))
        except TypeError:
            given = []
        if len(given) != self.num_envs:
            raise ValueError(f"actions: expected {self.num_envs} of them, got {actions!r}")
        if self.autoreset_mode == AutoresetMode.DISABLED and self._over.any():
            raise ResetNeeded(f"episodes {np.flatnonzero(self._over)} are over: reset them first")
        for k in playing:
            self.envs[k].check(given[k])
        return given

    def _step(self, k: int, action: Any) -> Any:
        env = self.envs[k]
        env.begin_step(action)
        return env.end_step(env.sim.advance(env.episode.scene.frame))

    # --- everything else --------------------------------------------------------------------

    def render(self) -> tuple[NDArray[np.uint8] | None, ...]:  # type: ignore[override]
        """Return a picture of every environment."""
        return tuple(env.render() for env in self.envs)

    def close_extras(self, **kwargs: Any) -> None:
        """Close every environment."""
        for env in self.envs:
            env.close()

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return the attribute `name`, or the result of the method, of every environment."""
        found = (getattr(env, name) for env in self.envs)
        return tuple(each(*args, **kwargs) if callable(each) else each for each in found)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return the attribute `name` of every environment."""
        return self.call(name)


def side_by_side(tasks: Sequence[Callable[[], Any]], threads: int | None = None) -> list[Any]:
    """Return the results of tasks; every thread takes the next one that is left.

    threads: how many at most, by default the CPUs that the process may use.
    """
    results: list[Any] = [None] * len(tasks)
    left, team = iter(range(len(tasks))), teams.make_team()

    def part(rank: int, n_threads: int) -> None:
        for i in left:
            if team[teams.STOP]:
                return
            results[i] = tasks[i]()

    most = teams.most_threads() if threads is None else threads
    with teams.borrow(min(most, max(len(tasks), 1))) as n_threads:
        teams.run(part, n_threads, team)
    return results


def _columns(infos: Sequence[dict[str, Any] | None]) -> dict[str, Any]:
    """Return infos of single environments as arrays, with the masks that Gymnasium adds.

    All have the same keys, so that this needs no look at every value, which Gymnasium's does.
    """
    there = np.array([info is not None for info in infos])
    known_infos = [info for info in infos if info is not None]
    if not known_infos:
        return {}
    first = known_infos[0]
    names = [key for key, value in first.items() if not isinstance(value, str)]
    # in one go: an array for each of them takes three times as long
    numbers = np.zeros((len(names), len(infos)))
    numbers[:, there] = np.array([[info[name] for name in names] for info in known_infos]).T
    columns: dict[str, Any] = dict(zip(names, numbers, strict=True))
    for key in [key for key in first if key not in columns]:
        columns[key] = np.full(len(infos), None, object)
        columns[key][there] = [info[key] for info in known_infos]
    masks = np.tile(there, (len(columns), 1))
    columns |= {f"_{key}": mask for key, mask in zip(columns, masks, strict=True)}
    return columns


def _final(finals: Sequence[tuple[Any, dict[str, Any]] | None]) -> dict[str, Any]:
    """Return "final_obs" and "final_info": last observations and infos of episodes that ended."""
    if all(final is None for final in finals):
        return {}
    there = np.array([final is not None for final in finals])
    observations = np.full(len(finals), None, object)
    for k, final in enumerate(finals):
        observations[k] = None if final is None else final[0]
    return {
        "final_obs": observations,
        "_final_obs": there.copy(),
        "final_info": _columns([None if final is None else final[1] for final in finals]),
        "_final_info": there.copy(),
    }
