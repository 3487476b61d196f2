"""What a page is about, and the scenes that it shows."""

from functools import cache
from typing import Any, NamedTuple

from sph_gym import scenes
from sph_gym.env import instances, labels, settings
from sph_gym.env.draws import FAMILIES


class Subject(NamedTuple):
    """What a page is about.

    id: of the environment; scene: the argument that it is registered with, None for one of the
    user's own; scenes: the names of those that it shows.
    """

    id: str
    scene: str | None
    scenes: tuple[str, ...]

    @property
    def summary(self) -> str:
        """What happens, in a sentence."""
        return " ".join(self.story.split("\n\n")[0].split())

    @property
    def label(self) -> str:
        """What it is good for; empty for a scene of one's own, of which nothing is known."""
        told = dict.fromkeys(instances.label(name) for name in self.scenes)
        return labels.label(self.scenes[0]) if len(self.scenes) == 1 else " and ".join(told)

    @property
    def story(self) -> str:
        """What happens, in any number of paragraphs."""
        if self.scene is None:
            return "A `Scene` of your own, given as `scene=`."
        if self.scene == settings.MIXED:
            return f"Every reset draws one of the scenes {', '.join(self.scenes)}."
        return scenes.description(FAMILIES[self.scene].builder)[0]


@cache
def built(name: str, split: str) -> list[Any]:
    """All scenes of a set."""
    size = instances.SIZES[split]
    return [instances.instance(name, split, number).build() for number in range(size)]
