"""What an environment's arguments mean, checked once; shared by single and vector environments."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sph_gym.env import actions, instances, observations, rewards, viscous
from sph_gym.env.draws import FAMILIES
from sph_gym.env.episode import Rules
from sph_gym.env.reference import fingerprint
from sph_gym.solver.checks import in_range, known, positive
from sph_gym.solver.scene import Scene

# How often in a row a blow-up is taken back.
ROLLBACKS = {"terminate": 0, "rollback": 3}
REWARDS = ("scalar", "vector")
MIXED = "mixed"


class Settings:
    """Checked arguments of `TuningEnv`; see there. Raises ValueError that names the argument."""

    def __init__(
        self, scene: str | Scene | None, dx: float | None, split: str, action_mode: str,
        on_blowup: str, weights: dict[str, float] | None, tolerances: dict[str, float] | None,
        reward: str, rate_limit: float | None, observation: str,
    ) -> None:  # fmt: skip
        self._check_scene(scene, dx, split)
        known("on_blowup", on_blowup, ROLLBACKS)
        self._vector = known("reward", reward, REWARDS) == "vector"
        if rate_limit is not None:
            in_range("rate_limit", rate_limit, 1.0)
        rollbacks = ROLLBACKS[on_blowup]
        self.rules = Rules(
            actions.make(action_mode),
            observations.TYPES[known("observation", observation, observations.TYPES)](
                rollback=rollbacks > 0
            ),
            rewards.check_weights(weights),
            rewards.check_tolerances(tolerances),
            rollbacks,
            rate_limit,
        )

    def _check_scene(self, scene: str | Scene | None, dx: float | None, split: str) -> None:
        if scene is None:
            raise ValueError("scene: expected the name of a scene or a Scene of your own, got None")
        self._scene, self._dx, self._split = scene, dx, split
        if isinstance(scene, Scene):
            if dx is not None or split != "nominal":
                raise ValueError("scene: a Scene of your own has its own dx, and no instances")
            viscous.check("scene", scene)
            self._own_id = f"{scene.name}/{instances.CUSTOM}/{fingerprint(scene)}"
            return
        if dx is not None:
            positive("dx", dx)
        self._scenes = tuple(FAMILIES) if scene == MIXED else (scene,)
        for name in self._scenes:
            first = instances.instance(name, split, 0, dx)
            if dx is not None:
                _try(first, dx)

    # --- instances --------------------------------------------------------------------------

    def draw(self, rng: np.random.Generator, options: dict[str, Any] | None) -> tuple[str, Scene]:
        """Id and scene of an episode: from the options, or from the environment's generator.

        Raises ValueError for options that it doesn't know.
        """
        if not isinstance(options, dict | None):
            raise ValueError(f"options: expected a dictionary, got {options!r}")
        for name in options or {}:
            known("options", name, ("instance",))
        wanted = (options or {}).get("instance")
        if wanted is not None:
            return self.find(wanted)
        if isinstance(self._scene, Scene):
            return self._own_id, self._scene
        name = self._scenes[int(rng.integers(len(self._scenes)))]
        number = int(rng.integers(instances.SIZES[self._split]))
        chosen = instances.instance(name, self._split, number, self._dx)
        return chosen.id, chosen.build()

    def find(self, id_: str) -> tuple[str, Scene]:
        """The scene of an instance's id. Raises ValueError if this environment has none such."""
        if isinstance(self._scene, Scene):
            if id_ != self._own_id:
                raise ValueError(f"instance: a Scene of your own is {self._own_id!r}, got {id_!r}")
            return self._own_id, self._scene
        chosen = instances.parse(id_)
        known("scene of the instance", chosen.scene, self._scenes)
        built = chosen.build()
        viscous.check("instance", built)
        return chosen.id, built

    # --- rewards and masks ------------------------------------------------------------------

    def reward_of(self, terms: list[float]) -> Any:
        """What a step returns for its weighted terms: their sum, or all of them."""
        return np.array(terms, np.float32) if self._vector else sum(terms)

    def reward_space(self) -> spaces.Box:
        """Bounds of the terms of a step, whose blow-up is charged for every step that is left."""
        low = np.full(len(rewards.TERMS), -rewards.WORST)
        high = np.zeros(len(rewards.TERMS))
        work = rewards.TERMS.index("work")
        low[work], high[work] = 1.0 - rewards.MOST_WORK / 2, 1.0
        low[rewards.TERMS.index("blowup")] = -np.inf
        weights = np.array([self.rules.weights[term] for term in rewards.TERMS])
        ends = np.stack([low * weights, high * weights])
        ends[np.isnan(ends)] = 0.0
        return spaces.Box(*np.sort(ends, axis=0).astype(np.float32), dtype=np.float32)

    def masks(self, scene: Scene, coordinates: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which discrete actions do something of their own."""
        if not isinstance(self.rules.actions, actions.Discrete):
            raise AttributeError('action_masks: only with action_mode="discrete"')
        useful = actions.useful(scene, self.rules.rate_limit)
        return self.rules.actions.masks(coordinates, useful)


def _try(instance: instances.Instance, dx: float) -> None:
    """Only the scene itself knows which spacings are too coarse for it, or too fine."""
    try:
        built = instance.build()
    except ValueError as error:
        raise ValueError(
            f"dx: expected a spacing that {instance.scene} can be made with, got {dx:g} ({error})"
        ) from None
    viscous.check("dx", built)
