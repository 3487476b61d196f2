"""The environment: one step is one frame of physical time with the controls of the action."""

import copy
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import Enum
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from sph_gym.env import rewards
from sph_gym.env.episode import Episode
from sph_gym.env.fingerprint import digest
from sph_gym.env.identity import Identity, identify
from sph_gym.env.rules import ARGUMENTS, Rules
from sph_gym.env.selection import Selection, check_id
from sph_gym.solver.checks import known, whole
from sph_gym.solver.plain import to_plain
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Report, Simulation

if TYPE_CHECKING:
    from sph_gym.view import Painter, Window

PICTURE_WIDTH = 640
# Version of the form of states.
STATE_VERSION = 2
STATE_PARTS = ("version", "rules", "instance", "episode", "generator", "turn", "checksum")


class TuningEnv(gym.Env[NDArray[Any], Any]):
    """An agent tunes the time step, the stiffness and the XSPH epsilon of a running SPH solver.

    ## Arguments
    - `scene`: the name of a scene, "mixed" for any of them, "benchmark" for any that is no
      diagnostic, "benchmark-long_fall" for these but one, or a `Scene` of your own, also as its
      `Scene.to_dict()`; an id brings its own, and only Custom takes any other
    - `dx`: particle spacing [m], by default a coarse one; drawn lengths grow with it, and
      "dam_break/test/3/finer=2" is a flow with half the usual spacing
    - `instances`: "nominal" or a numbered set, "train", "val", "test" or "ood", from which every
      reset draws with the environment's own generator; or a list of ids, which resets show in
      turn, from place seed (modulo its length) on after a reset with a seed
    - `action_mode`: "absolute", "stable", "delta" or "discrete" (`sph_gym.env.actions`)
    - `on_blowup`: "terminate", or "rollback", which charges for the step, goes back to where it
      began and tells the agent, at most three times in a row
    - `reward_weights`: weights of the terms density, clumping, noise, fidelity, work, blowup,
      of a magnitude of at most 1e6
    - `tolerances`: of `sph_gym.env.rewards.Tolerances`, by name
    - `reward`: "scalar", or "vector" for the six terms as an array, as MO-Gymnasium wants them;
      to be made with `gymnasium.make(..., disable_env_checker=True)`
    - `rate_limit`: the largest factor by which the sound speed may change in a step
    - `observation`: "features", "features+context" or "field" (`sph_gym.env.observations`)
    - `render_mode`: None, "rgb_array" or "human"

    ## Episode
    duration / frame steps of `frame` seconds each, then truncation. A blow-up terminates, with
    the last finite state as the observation. reset(options={"instance": "dam_break/train/17"})
    chooses an instance. `env.unwrapped.sim` is the running `Simulation`, `env.unwrapped.instance`
    tells all about the flow (`sph_gym.env.identity`).

    ## Info
    Flat Python floats and three strings, each explained in `sph_gym.env.episode.INFO`; the
    entries reward_density, reward_clumping, reward_noise, reward_fidelity, reward_work and
    reward_blowup sum to the reward. `python -m sph_gym docs ID` prints all of this for one id,
    with tables.

    Raises ValueError for unknown names, for fluids so viscous that no action asks for a step that
    is short enough, and for actions that aren't finite and in the space.
    """

    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 30}  # noqa: RUF012

    def __init__(
        self,
        scene: str | Scene | dict[str, Any] | None = None,
        dx: float | None = None,
        instances: str | Sequence[str] = "nominal",
        *,
        render_mode: str | None = None,
        **rules: Any,
    ) -> None:
        unknown = [name for name in rules if name not in ARGUMENTS]
        if unknown:
            raise TypeError(
                f"{unknown[0]!r} is no argument of the environment: expected scene, dx, instances, "
                f"render_mode, {', '.join(ARGUMENTS)}"
            )
        self.selection, self.rules = Selection(scene, dx, instances), Rules(**rules)
        if render_mode is not None:
            known("render_mode", render_mode, self.metadata["render_modes"])
        self.action_space = self.rules.actions.space()
        self.observation_space: Any = self.rules.observations.space()
        if self.rules.reward == "vector":
            self.reward_space = self.rules.reward_space()
            self.reward_dim = len(rewards.TERMS)
        self.render_mode = render_mode
        self._spec: EnvSpec | None = None
        self._episode: Episode | None = None
        self._painter: Painter | None = None
        self._window: Window | None = None

    # --- Gymnasium --------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Start an episode; options may name the instance."""
        super().reset(seed=seed)
        self._begin(*self.selection.draw(self.np_random, options, seed))
        if self.render_mode == "human":
            self.render()
        return self.episode.observe(), dict(self.episode.info)

    def _begin(self, instance_id: str, scene: Scene) -> None:
        self._episode = Episode(self.rules, instance_id, scene)
        self._painter = None

    def step(self, action: Any) -> tuple[NDArray[Any], Any, bool, bool, dict[str, Any]]:
        """Advance by a frame of physical time with the controls that the action asks for."""
        self._require_episode()
        self.begin_step(action)
        result = self.end_step(self.sim.advance(self.episode.scene.frame))
        if self.render_mode == "human":
            self.render()
        return result

    def check(self, action: Any) -> None:
        """Raise ResetNeeded without an episode to go on with, ValueError unless action is one."""
        self._require_episode()
        self.episode.check(action)

    def _require_episode(self) -> None:
        if self._episode is None or self._episode.over:
            raise ResetNeeded("the episode is over (or has not begun): call reset() first")

    def begin_step(self, action: Any) -> None:
        """Do the part of a step before the solver runs. Raises ValueError unless action is one."""
        self.episode.act(action)

    def end_step(self, report: Report) -> tuple[NDArray[Any], Any, bool, bool, dict[str, Any]]:
        """Return the result of a step, after the solver has run for a frame."""
        observation, terms, terminated, truncated, info = self.episode.conclude(report)
        return observation, self.rules.reward_of(terms), terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """Return the present state as (height, width, 3) uint8, or show it ("human")."""
        episode = self.episode
        lines = (
            f"step {episode.step}/{episode.n_steps}",
            f"work {episode.info['work']:.2f} of CFL",
        )
        if self.render_mode == "rgb_array":
            if self._painter is None:
                from sph_gym.view import Painter

                self._painter = Painter(episode.scene, size=PICTURE_WIDTH)
            return self._painter.paint(episode.sim, title=episode.instance_id, lines=lines)
        if self.render_mode == "human":
            if self._window is None:
                self._window = _open_window(episode.scene)
            terms = {k: v for k, v in episode.info.items() if k.startswith("reward_")}
            self._window.show(episode.sim, lines=lines, numbers=terms)
            return None
        gym.logger.warn("render() was called without a render_mode; give one to gymnasium.make")
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def __getstate__(self) -> dict[str, Any]:
        # pictures can't be copied; they are made anew when they are needed
        return self.__dict__ | {"_painter": None, "_window": None}

    @property
    def spec(self) -> EnvSpec | None:
        """The recipe of this environment: plain data for JSON, with a Scene as `to_dict`.

        `max_episode_steps` is the length of all episodes, None if they differ. No `TimeLimit` is
        there: the environment itself truncates.
        """
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec and plain_spec(spec, self.fixed_length())

    def fixed_length(self) -> int | None:
        """Return the steps of every episode, None if they differ or blow-ups are taken back."""
        return None if self.rules.rollbacks else self.selection.n_steps()

    # --- the present episode ----------------------------------------------------------------

    @property
    def episode(self) -> Episode:
        """The present episode. Raises ResetNeeded before the first reset."""
        if self._episode is None:
            raise ResetNeeded("no episode has begun: call reset() first")
        return self._episode

    @property
    def sim(self) -> Simulation:
        """The running solver."""
        return self.episode.sim

    @property
    def instance_id(self) -> str:
        """Id of the flow that the present episode shows."""
        return self.episode.instance_id

    @property
    def instance(self) -> Identity:
        """Identity of that flow: its scene, arguments, seed and hash."""
        return identify(self.episode.instance_id, self.episode.scene)

    @property
    def n_steps(self) -> int:
        """Frames of the present episode."""
        return self.episode.n_steps

    def action_toward(self, controls: Any) -> Any:
        """Return the action that brings the controls as close as possible to the given ones."""
        return self.episode.toward(controls)

    def action_masks(self) -> NDArray[np.bool_]:
        """Return (27,) True for discrete actions that do something of their own, for sb3-contrib.

        Raises AttributeError unless action_mode="discrete".
        """
        return self.rules.masks(self.episode.scene, self.episode.coordinates)

    def get_state(self) -> dict[str, Any]:
        """Return the whole environment as plain arrays, numbers and texts, with a checksum."""
        state = {
            "version": STATE_VERSION,
            "rules": self.rules.plain(),
            "instance": self.instance_id,
            "episode": self.episode.state(),
            "generator": self.np_random.bit_generator.state,
            "turn": self.selection.turn,
        }
        return state | {"checksum": digest(state)}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to the `get_state` of an environment with the same arguments.

        What follows is the same to the last bit. Raises ValueError for a state that was changed,
        that is of other arguments or of another kind of environment, and then nothing has changed.
        """
        self._check_state(state)
        # on a copy first, so that a wrong state changes nothing
        generator = copy.deepcopy(self.np_random.bit_generator)
        turn = whole("state: turn", state["turn"])
        try:
            generator.state = state["generator"]
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"state: expected a state of the generator: {error!r}") from None
        present = self._episode
        if present is None or present.instance_id != state["instance"]:
            present = Episode(self.rules, *self.selection.find(state["instance"]))
        try:
            present.restore(state["episode"])
        except ValueError as error:
            raise ValueError(f"state: {error}") from None
        if present is not self._episode:
            self._episode, self._painter = present, None
        self.np_random.bit_generator.state = state["generator"]
        self.selection.turn = turn

    def _check_state(self, state: Any) -> None:
        """Raise ValueError for a state that was changed, and for one of other rules."""
        if not isinstance(state, dict) or set(state) != set(STATE_PARTS):
            raise ValueError(f"state: expected one of get_state() with {', '.join(STATE_PARTS)}")
        if state["version"] != STATE_VERSION:
            raise ValueError(f"state: expected version {STATE_VERSION}, got {state['version']!r}")
        if state["checksum"] != digest({k: v for k, v in state.items() if k != "checksum"}):
            raise ValueError("state: changed since get_state() returned it: its checksum is wrong")
        for name, here in self.rules.plain().items():
            if state["rules"][name] != here:
                raise ValueError(
                    f"state: of an environment with {name} = {state['rules'][name]!r}, but here it "
                    f"is {here!r}"
                )


def _open_window(scene: Scene) -> "Window":
    """Return a window, one that nobody sees if there is no screen; a warning says so."""
    from sph_gym.view import Window

    try:
        return Window(scene)
    except RuntimeError as error:
        gym.logger.warn(f"render_mode='human': {error}; nothing is shown")
    chosen = os.environ.get("SDL_VIDEODRIVER")
    os.environ["SDL_VIDEODRIVER"] = "dummy"
    try:
        return Window(scene)
    finally:
        del os.environ["SDL_VIDEODRIVER"]
        os.environ |= {} if chosen is None else {"SDL_VIDEODRIVER": chosen}


def _plain_argument(value: Any) -> Any:
    if isinstance(value, Scene):
        return value.to_dict()
    if isinstance(value, Enum):
        return value.value
    return to_plain(value, "") if isinstance(value, (Mapping, np.generic)) else value


def plain_spec(spec: EnvSpec, n_steps: int | None) -> EnvSpec:
    """Return a spec as plain data for JSON; n_steps: of every episode, unless it has a limit.

    Raises ValueError for the id of another scene, which `gymnasium.make` doesn't see.
    """
    check_id(spec.id, spec.kwargs.get("scene"))
    kwargs = {name: _plain_argument(value) for name, value in spec.kwargs.items()}
    return replace(spec, kwargs=kwargs, max_episode_steps=spec.max_episode_steps or n_steps)
