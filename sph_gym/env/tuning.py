"""The environment: one step is one frame of physical time with the controls of the action."""

from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from sph_gym.env import actions, instances, rewards
from sph_gym.env.observations import Features
from sph_gym.env.reference import n_frames, reference
from sph_gym.solver.checks import known, positive
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Report, Simulation

if TYPE_CHECKING:
    from sph_gym.view import Painter, Window

OBSERVATIONS = {"features": Features}
ON_BLOWUP = ("terminate",)
PICTURE_WIDTH = 640


class TuningEnv(gym.Env[NDArray[np.float32], Any]):
    """An agent tunes the time step, the stiffness and the XSPH epsilon of a running SPH solver.

    ## Arguments
    scene: the name of a scene, or a `Scene` of your own; dx: particle spacing [m], by default a
    coarse one; instances: "nominal" or a numbered set, "train", "val" or "test", from which every
    reset draws with the environment's own generator; action_mode: "absolute", "delta" or
    "discrete" (`sph_gym.env.actions`); on_blowup: "terminate"; reward_weights: weights of the
    terms density, clumping, fidelity, work, blowup; observation: "features"
    (`sph_gym.env.observations`); render_mode: None, "rgb_array" or "human".

    ## Episode
    duration / frame steps of `frame` seconds each, then truncation. A blow-up terminates, with
    the last finite state as the observation. reset(options={"instance": "dam_break/train/17"})
    chooses an instance. `env.unwrapped.sim` is the running `Simulation`.

    ## Info
    instance_id, blowup_cause (strings); time [s], dt [s], stiffness [Pa], xsph, n_substeps, work
    (substeps / mean substeps a step of the tuned CFL rule), density_error (mean of
    max(rho/rho0 - 1, 0)), clumping (share closer than 0.6 dx), fidelity_error (drift from the
    reference in multiples of its tolerance), blowup (0 or 1), and reward_density,
    reward_clumping, reward_fidelity, reward_work, reward_blowup, whose sum is the reward.

    Raises ValueError for unknown names and for actions that aren't finite and in the space.
    """

    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 30}  # noqa: RUF012

    def __init__(
        self,
        scene: str | Scene | None = None,
        dx: float | None = None,
        instances: str = "nominal",
        action_mode: str = "absolute",
        on_blowup: str = "terminate",
        reward_weights: dict[str, float] | None = None,
        observation: str = "features",
        render_mode: str | None = None,
    ) -> None:
        self._check_scene(scene, dx, instances)
        known("on_blowup", on_blowup, ON_BLOWUP)
        if render_mode is not None:
            known("render_mode", render_mode, self.metadata["render_modes"])
        self.action_type = actions.make(action_mode)
        self.observation_type = OBSERVATIONS[known("observation", observation, OBSERVATIONS)]()
        self.action_space = self.action_type.space()
        self.observation_space: Any = self.observation_type.space()
        self.reward_weights = rewards.check_weights(reward_weights)
        self.render_mode = render_mode
        self.sim: Simulation
        self._over = True
        self._painter: Painter | None = None
        self._window: Window | None = None

    def _check_scene(self, scene: str | Scene | None, dx: float | None, split: str) -> None:
        if scene is None:
            raise ValueError("scene: expected the name of a scene or a Scene of your own, got None")
        self._scene, self._dx, self._split = scene, dx, split
        if isinstance(scene, Scene):
            if dx is not None or split != "nominal":
                raise ValueError("scene: a Scene of your own has its own dx, and no instances")
            return
        if dx is not None:
            positive("dx", dx)
        instances.instance(scene, split, 0, dx)

    def _draw(self, options: dict[str, Any] | None) -> tuple[str, Scene]:
        """The instance of this episode: from the options, or from the environment's generator."""
        for name in options or {}:
            known("options", name, ("instance",))
        wanted = (options or {}).get("instance")
        if isinstance(self._scene, Scene):
            if wanted is not None:
                raise ValueError("instance: a Scene of your own has no instances")
            return f"{self._scene.name}/custom/0", self._scene
        if wanted is None:
            number = int(self.np_random.integers(instances.SIZES[self._split]))
            chosen = instances.instance(self._scene, self._split, number, self._dx)
        else:
            chosen = instances.parse(wanted, self._dx)
            known("scene of the instance", chosen.scene, (self._scene,))
        return chosen.id, chosen.build()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode; options may name the instance."""
        super().reset(seed=seed)
        self.instance_id, scene = self._draw(options)
        self.sim = Simulation(scene)
        self.n_steps = n_frames(scene)
        self._reference = reference(scene)
        fluid_mass = self.sim.mass * self.sim.n_fluid
        self._judge = rewards.Judge(self._reference, scene, fluid_mass, rewards.Tolerances())
        self._step, self._over = 0, False
        self._coordinates = actions.encode(scene, self.sim.controls)
        self._numbers = self._before = self.observation_type.look(self.sim)
        self._report = Report(0, self.sim.controls.dt)
        self._painter = None
        self._info = self._make_info(0.0, 0.0, dict.fromkeys(rewards.TERMS, 0.0))
        if self.render_mode == "human":
            self.render()
        return self._observe(), dict(self._info)

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """One frame of physical time with the controls that the action asks for."""
        if self._over:
            raise ResetNeeded("the episode is over (or has not begun): call reset() first")
        scene = self.sim.scene
        self._coordinates = self.action_type.act(action, self._coordinates)
        self.sim.controls = actions.decode(scene, self._coordinates)
        self._report = report = self.sim.advance(scene.frame)
        self._step += 1
        self._before, self._numbers = self._numbers, self.observation_type.look(self.sim)
        work = report.n_substeps / self._reference.cfl_substeps
        errors = self._judge.errors(self._step, self._numbers)
        if report.diverged:
            terms = rewards.blowup_terms(self.n_steps - self._step + 1)
        else:
            terms = rewards.terms(errors, work)
        weighted = {term: self.reward_weights[term] * value for term, value in terms.items()}
        self._info = self._make_info(work, errors.fidelity, weighted)
        terminated = report.diverged
        truncated = self._step >= self.n_steps and not terminated
        self._over = terminated or truncated
        if self.render_mode == "human":
            self.render()
        return self._observe(), sum(weighted.values()), terminated, truncated, dict(self._info)

    def action_toward(self, controls: Any) -> Any:
        """The action that brings the controls as close as possible to the given ones."""
        wanted = actions.encode(self.sim.scene, controls)
        return self.action_type.toward(wanted, self._coordinates)

    def _observe(self) -> NDArray[np.float32]:
        return self.observation_type.observe(
            self.sim,
            self._numbers,
            self._before,
            self._coordinates,
            self._step / self.n_steps,
            self._report.n_substeps,
        )

    def _make_info(self, work: float, fidelity: float, terms: dict[str, float]) -> dict[str, Any]:
        controls = self.sim.controls
        return {
            "instance_id": self.instance_id,
            "blowup_cause": self._report.cause,
            "time": self.sim.time,
            "dt": self._report.dt,
            "stiffness": controls.stiffness,
            "xsph": controls.xsph,
            "n_substeps": float(self._report.n_substeps),
            "work": work,
            "density_error": self._numbers["density_error"],
            "clumping": self._numbers["clumping"],
            "fidelity_error": fidelity,
            "blowup": float(self._report.diverged),
            **{f"reward_{term}": value for term, value in terms.items()},
        }

    def render(self) -> NDArray[np.uint8] | None:
        """The present state as (height, width, 3) uint8, or shown in the window of "human"."""
        if self._over and not hasattr(self, "sim"):
            raise ResetNeeded("there is nothing to render before the first reset()")
        lines = (
            f"step {self._step}/{self.n_steps}",
            f"work {self._info['work']:.2f} of CFL",
        )
        if self.render_mode == "rgb_array":
            if self._painter is None:
                from sph_gym.view import Painter

                self._painter = Painter(self.sim.scene, size=PICTURE_WIDTH)
            return self._painter.paint(self.sim, title=self.instance_id, lines=lines)
        if self.render_mode == "human":
            if self._window is None:
                from sph_gym.view import Window

                self._window = Window(self.sim.scene)
            self._window.show(self.sim, lines=lines)
            return None
        gym.logger.warn("render() was called without a render_mode; give one to gymnasium.make")
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None
