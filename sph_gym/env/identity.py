"""Identity of the flow of an episode: all that is needed to make the same flow again."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from sph_gym.env import contexts, instances, manifest
from sph_gym.env.distributions import FAMILIES, SPLITS
from sph_gym.env.fingerprint import fingerprint
from sph_gym.solver.scene import Scene


class Identity(NamedTuple):
    """A flow and its origin; plain values, to be kept with data that was made from it.

    - `id`: as in info
    - `scene`: of the environment
    - `split`: "nominal", "train", "val", "test", "ood" or, for a Scene of your own, "custom"
    - `number`: within the split, None for a Scene of your own
    - `shift`: what is out of distribution, of `instances.SHIFTS`; empty but in "ood"
    - `builder`: the scene that shows it, as `sph_gym.scenes.make` knows it; empty if it is your own
    - `arguments`: of the builder, lengths in metres
    - `context`: the numerics (`sph_gym.env.contexts.Context`)
    - `seed`: of the generator that drew it, as `numpy.random.default_rng` takes it; empty if
      nothing was drawn
    - `fingerprint`: a hash of the particles, the fluid, the effects, the walls and the duration
    - `manifest`: version of the manifest that lists exactly this flow; empty if none does
    """

    id: str
    scene: str
    split: str
    number: int | None
    shift: str
    builder: str
    arguments: Mapping[str, Any]
    context: Mapping[str, Any]
    seed: tuple[int, ...]
    fingerprint: str
    manifest: str


def identify(instance_id: str, scene: Scene) -> Identity:
    """Return the identity of the flow that an environment shows under an id.

    A Scene of one's own has an id that `instances.parse` doesn't know, and no instances.
    """
    found, numerics = fingerprint(scene), contexts.of(scene)._asdict()
    name, split, *_ = instance_id.rsplit("/", 2)
    if split == instances.CUSTOM:
        return Identity(instance_id, name, split, None, "", "", {}, numerics, (), found, "")
    flow, entry = instances.parse(instance_id), manifest.entry(instance_id)
    listed = entry is not None and entry.fingerprint == found
    builder, arguments, _ = flow.drawn
    drawn = flow.split != "nominal"
    return Identity(
        instance_id,
        flow.scene,
        flow.split,
        flow.number,
        instances.shift(instance_id),
        builder,
        dict(arguments),
        numerics,
        (FAMILIES[flow.scene].seed, SPLITS[flow.split], flow.number) if drawn else (),
        found,
        manifest.VERSION if listed else "",
    )
