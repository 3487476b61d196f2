"""A page about every environment, in the layout of Gymnasium's own: templates filled by the code.

The prose is in the Markdown files of this folder, everything that depends on the code in `values`.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

import gymnasium as gym

from sph_gym import scenes
from sph_gym.env.distributions import FAMILIES
from sph_gym.env.documentation import values
from sph_gym.env.documentation.markdown import table
from sph_gym.env.selection import GROUPS, members
from sph_gym.files import atomic_write
from sph_gym.solver.checks import known

PREFIX = "sph_gym/"
HEADINGS = ("id", "what happens", "label")


class Subject(NamedTuple):
    """Environment of a page.

    id: its id; scene: the argument that it is registered with, None for a user's own; scenes: the
    names of the environments that it plays.
    """

    id: str
    scene: str | None
    scenes: tuple[str, ...]

    @property
    def summary(self) -> str:
        """First paragraph of the story, in one line."""
        return " ".join(self.story.split("\n\n")[0].split())

    @property
    def label(self) -> str:
        """Label of its scene, kinds of several; empty for a user's own."""
        if len(self.scenes) == 1:
            return FAMILIES[self.scenes[0]].label
        return " and ".join(dict.fromkeys(FAMILIES[name].kind for name in self.scenes))

    @property
    def story(self) -> str:
        """Description of the flow, in any number of paragraphs."""
        if self.scene is None:
            return "A `Scene` of your own, given as `scene=`."
        if self.scene in GROUPS:
            return f"Every reset draws one of the scenes {', '.join(self.scenes)}."
        return scenes.description(FAMILIES[self.scene].scene)[0]


def ids() -> list[str]:
    """Return the ids that have a page: all that are registered."""
    return [name for name in gym.registry if name.startswith(PREFIX)]


def subject(id_: str) -> Subject:
    """Return the subject of the page of an id. Raises ValueError that lists the ids."""
    scene = gym.spec(known("id", id_, ids())).kwargs.get("scene")
    return Subject(id_, scene, () if scene is None else members(scene))


def page(id_: str) -> str:
    """Return the page of an id as Markdown. Raises ValueError that lists the ids."""
    about = subject(id_)
    names = about.scenes
    found: dict[str, Any] = values.general(about.scene) | {
        "id": id_,
        "own": "" if names else ", scene=scene",
        "story": about.story,
        "builders": values.builders(names),
        "labels": _fill("labels", {"table": values.labels(names)}) if names else "",
        "units": values.units(names),
        "flows": _fill("flows", values.flows(names)) if names else values.OWN_FLOW,
        "n_steps": values.n_steps(names),
        "manifests": values.MANIFESTS if names else "",
    }
    return _fill("page", found) + "\n"


def _fill(name: str, found: Mapping[str, Any]) -> str:
    """Return a template with its values; what is empty leaves no gap."""
    text = Path(__file__).with_name(f"{name}.md").read_text()
    return re.sub(r"\n{3,}", "\n\n", Template(text).substitute(found)).strip()


def index() -> str:
    """Return all ids and what they show, as Markdown."""
    return table(HEADINGS, [(f"`{id_}`", *_row(id_)) for id_ in ids()])


def _row(id_: str) -> tuple[str, str]:
    about = subject(id_)
    return about.summary, about.label


def write(folder: str | Path, chosen: Sequence[str] | None = None) -> list[Path]:
    """Write the pages of some ids, by default of all, and README.md that links them.

    Returns the paths. Raises ValueError that lists the ids, before anything is written.
    """
    place = Path(folder)
    names = {id_: f"{id_.removeprefix(PREFIX)}.md" for id_ in chosen or ids()}
    texts = {name: page(id_) for id_, name in names.items()}
    rows = [(f"[{id_}]({name})", *_row(id_)) for id_, name in names.items()]
    texts["README.md"] = f"# Environments\n\n{table(HEADINGS, rows)}\n"
    place.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        with atomic_write(place / name) as draft:
            draft.write_text(text, encoding="utf-8")
    return [place / name for name in texts]
