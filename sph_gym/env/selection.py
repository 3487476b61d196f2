"""The flows from which the resets of an environment choose."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from sph_gym.env import instances, manifest, viscous
from sph_gym.env.distributions import FAMILIES
from sph_gym.env.fingerprint import fingerprint
from sph_gym.env.reference import n_frames
from sph_gym.env.registration import env_id
from sph_gym.solver.checks import known, positive
from sph_gym.solver.scene import Scene

# The environments that the names of `sph_gym.env.registration.GROUPS` stand for.
GROUPS = {
    "mixed": tuple(FAMILIES),
    "benchmark": tuple(name for name in FAMILIES if name not in instances.DIAGNOSTIC),
}


def members(scene: Any) -> tuple[str, ...]:
    """Return the environments that a name stands for: one, or those of a group.

    "benchmark-long_fall" is a group without one of them, to learn what a policy does where it was
    not trained. Raises ValueError for unknown names.
    """
    group, _, left_out = str(scene).partition("-")
    if left_out in GROUPS.get(group, ()):
        return tuple(name for name in GROUPS[group] if name != left_out)
    found = known("scene", scene, (*FAMILIES, *GROUPS))
    return GROUPS.get(found, (found,))


def own_scene(scene: Any) -> Any:
    """Return the Scene of a `Scene.to_dict`, and anything else as it is.

    Raises ValueError for other dictionaries.
    """
    return Scene.from_dict(scene) if isinstance(scene, Mapping) else scene


def check_id(id_: str, scene: Any) -> None:
    """Raise ValueError unless an id may show the scene: its own, or one of those of its group.

    Ids of the user's own, and Custom, show whatever they are given.
    """
    names = {env_id(name): name for name in (*FAMILIES, *GROUPS)}
    if id_ not in names:
        return
    shown = members(names[id_])
    if isinstance(scene, str) and set(members(scene)) <= set(shown):
        return
    if isinstance(scene, str):
        given, right = repr(scene), scene.partition("-")[0]
    else:
        given, right = "a Scene", "custom"
    raise ValueError(
        f"scene: expected {' or '.join(map(repr, shown))}, which {id_} shows, got {given}: "
        f"make {env_id(right)!r} for that"
    )


class Selection:
    """The instances of one set, of one environment or of a group; a list; or a user's own scene.

    scene, dx, chosen: `scene`, `dx` and `instances` of `TuningEnv`. turn: place in the list that
    the next episode shows, counted on beyond its end. Raises ValueError that names the argument.
    """

    def __init__(self, scene: Any, dx: float | None, chosen: str | Sequence[str]) -> None:
        scene = own_scene(scene)
        if scene is None:
            raise ValueError("scene: expected the name of a scene or a Scene of your own, got None")
        self._scene, self._dx, self._set, self.turn = scene, dx, chosen, 0
        self._list: tuple[str, ...] = ()
        if isinstance(scene, Scene):
            if dx is not None or chosen != "nominal":
                raise ValueError("scene: a Scene of your own has its own dx, and no instances")
            viscous.check("scene", scene)
            self._own_id = f"{scene.name}/{instances.CUSTOM}/{fingerprint(scene)}"
            return
        if dx is not None:
            # a plain number, since ids spell it
            self._dx = dx = positive("dx", dx)
        self._names = members(scene)
        if isinstance(chosen, str):
            if chosen.count("/") > 1:
                raise ValueError(
                    f"instances: expected one of {', '.join(instances.SIZES)}, or a list for a "
                    f"single flow, [{chosen!r}], got {chosen!r}"
                )
            firsts = [instances.instance(name, chosen, 0, dx) for name in self._names]
        else:
            firsts = self._listed(chosen)
            self._list = tuple(first.id for first in firsts)
        if dx is not None:
            for first in firsts:
                _check_spacing(first, dx)

    def _listed(self, ids: Any) -> list[instances.Instance]:
        """Return the instances of a list, those whose ids name no spacing at that of `dx`."""
        if not isinstance(ids, Sequence) or len(ids) == 0:
            raise ValueError(
                f"instances: expected one of {', '.join(instances.SIZES)} or a list of ids such as "
                f"'dam_break/test/3', got {ids!r}"
            )
        found = [instances.parse(id_) for id_ in ids]
        for k, each in enumerate(found):
            known("scene of the instance", each.scene, self._names)
            if self._dx is not None and instances.SPACING not in each.id:
                found[k] = instances.instance(each.scene, each.split, each.number, self._dx)
        return found

    def draw(
        self, rng: np.random.Generator, options: dict[str, Any] | None, seed: int | None = None
    ) -> tuple[str, Scene]:
        """Return id and scene of an episode, from the options or by the environment's generator.

        Lists are shown in turn, from place `seed` on, if there is one. Raises ValueError for
        unknown options.
        """
        if not isinstance(options, dict | None):
            raise ValueError(f"options: expected a dictionary, got {options!r}")
        for name in options or {}:
            known("options", name, ("instance",))
        wanted = (options or {}).get("instance")
        if seed is not None:
            self.turn = int(seed)
        if wanted is not None:
            return self.find(wanted)
        if isinstance(self._scene, Scene):
            return self._own_id, self._scene
        if self._list:
            self.turn += 1
            return self.find(self._list[(self.turn - 1) % len(self._list)])
        name = self._names[int(rng.integers(len(self._names)))]
        number = int(rng.integers(instances.SIZES[str(self._set)]))
        chosen = instances.instance(name, str(self._set), number, self._dx)
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

    def n_steps(self) -> int | None:
        """Return the steps of every episode, None if they differ (or a large set isn't listed)."""
        if isinstance(self._scene, Scene):
            return n_frames(self._scene)
        found: int | None = None
        lengths = cache(manifest.lengths)
        for id_ in self._ids():
            n_steps = lengths(id_.split("/")[0]).get(id_)
            if n_steps is None and (self._list or self._set == "nominal"):
                n_steps = n_frames(instances.parse(id_).build())
            if n_steps is None or found not in (None, n_steps):
                return None
            found = n_steps
        return found

    def _ids(self) -> Iterator[str]:
        """Yield the ids of all flows that resets may choose."""
        if self._list:
            yield from self._list
            return
        for name in self._names:
            spacing = "" if self._dx in (None, FAMILIES[name].dx) else f"/dx={self._dx!r}"
            for number in range(instances.SIZES[str(self._set)]):
                yield f"{name}/{self._set}/{number}{spacing}"


def _check_spacing(instance: instances.Instance, dx: float) -> None:
    # only the scene itself knows which spacings are too coarse or too fine for it
    try:
        built = instance.build()
    except ValueError as error:
        raise ValueError(
            f"dx: expected a spacing that {instance.scene} can be made with, got {dx:g} ({error})"
        ) from None
    viscous.check("dx", built)
