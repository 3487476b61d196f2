"""The flows from which the resets of an environment choose."""

from typing import Any

import numpy as np

from sph_gym.env import instances, viscous
from sph_gym.env.distributions import FAMILIES
from sph_gym.env.fingerprint import fingerprint
from sph_gym.solver.checks import known, positive
from sph_gym.solver.scene import Scene

MIXED = "mixed"


class Selection:
    """The instances of one set, of one environment or of all; or a user's own scene.

    scene, dx, split: `scene`, `dx` and `instances` of `TuningEnv`. Raises ValueError that names
    the argument.
    """

    def __init__(self, scene: str | Scene | None, dx: float | None, split: str) -> None:
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
        self._names = tuple(FAMILIES) if scene == MIXED else (scene,)
        for name in self._names:
            first = instances.instance(name, split, 0, dx)
            if dx is not None:
                _check_spacing(first, dx)

    def draw(self, rng: np.random.Generator, options: dict[str, Any] | None) -> tuple[str, Scene]:
        """Return id and scene of an episode, from the options or by the environment's generator.

        Raises ValueError for unknown options.
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
        name = self._names[int(rng.integers(len(self._names)))]
        number = int(rng.integers(instances.SIZES[self._split]))
        chosen = instances.instance(name, self._split, number, self._dx)
        return chosen.id, chosen.build()

    def find(self, id_: str) -> tuple[str, Scene]:
        """Return id and scene of an instance. Raises ValueError for one of another environment."""
        if isinstance(self._scene, Scene):
            if id_ != self._own_id:
                raise ValueError(f"instance: a Scene of your own is {self._own_id!r}, got {id_!r}")
            return self._own_id, self._scene
        chosen = instances.parse(id_)
        known("scene of the instance", chosen.scene, self._names)
        built = chosen.build()
        viscous.check("instance", built)
        return chosen.id, built


def _check_spacing(instance: instances.Instance, dx: float) -> None:
    # only the scene itself knows which spacings are too coarse or too fine for it
    try:
        built = instance.build()
    except ValueError as error:
        raise ValueError(
            f"dx: expected a spacing that {instance.scene} can be made with, got {dx:g} ({error})"
        ) from None
    viscous.check("dx", built)
