"""A page about every environment, written from the code, in the layout of Gymnasium's own."""

from collections.abc import Sequence
from pathlib import Path

import gymnasium as gym

from sph_gym.env import settings
from sph_gym.env.documentation.markdown import table
from sph_gym.env.documentation.sections import SECTIONS, head
from sph_gym.env.documentation.subject import Subject
from sph_gym.env.registration import SCENES
from sph_gym.solver.checks import known

PREFIX = "sph_gym/"
HEADINGS = ("id", "what happens", "label")


def ids() -> list[str]:
    """The ids that have a page: all that are registered."""
    return [name for name in gym.registry if name.startswith(PREFIX)]


def subject(id_: str) -> Subject:
    """What the page of an id is about. Raises ValueError that lists the ids."""
    scene = gym.spec(known("id", id_, ids())).kwargs.get("scene")
    shown = SCENES if scene == settings.MIXED else () if scene is None else (scene,)
    return Subject(id_, scene, tuple(shown))


def page(id_: str) -> str:
    """The page of an id as Markdown. Raises ValueError that lists the ids."""
    about = subject(id_)
    sections = [f"## {title}\n\n{write(about)}" for title, write in SECTIONS.items()]
    return "\n\n".join([f"# {id_}\n\n{head(about)}", *sections]) + "\n"


def index() -> str:
    """All ids and what they show, as Markdown."""
    return table(HEADINGS, [(f"`{id_}`", *_told(id_)) for id_ in ids()])


def _told(id_: str) -> tuple[str, str]:
    about = subject(id_)
    return about.summary, about.label


def write(folder: str | Path, chosen: Sequence[str] | None = None) -> list[Path]:
    """Write the pages of some ids, by default of all, and README.md that links them.

    Returns the paths. Raises ValueError that lists the ids, before anything is written.
    """
    place = Path(folder)
    names = {id_: f"{id_.removeprefix(PREFIX)}.md" for id_ in chosen or ids()}
    texts = {name: page(id_) for id_, name in names.items()}
    rows = [(f"[{id_}]({name})", *_told(id_)) for id_, name in names.items()]
    texts["README.md"] = f"# Environments\n\n{table(HEADINGS, rows)}\n"
    place.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (place / name).write_text(text)
    return [place / name for name in texts]
