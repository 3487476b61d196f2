"""Pages of the site that are made when it is built: from the code, and from files beside docs/."""

import re
from pathlib import Path
from typing import Any

import films

from sph_gym.env import documentation

DOCS = Path(__file__).parent
GENERATED = DOCS / "generated"
ENVIRONMENTS, PROJECT = GENERATED / "environments", GENERATED / "project"
# Copied as it is to the root of the site.
EXTRA = GENERATED / "extra"
# Pages of the repository's root that the site has too.
ROOT_PAGES = ("README", "CHANGELOG", "CONTRIBUTING", "RELEASING")
PAGES_OF_FILES = {
    "examples/README.rst": "generated/gallery/index.rst",
    **{f"../{name}.md": f"generated/project/{name}.md" for name in ROOT_PAGES},
}
# The gallery from the first look to the last.
EXAMPLES = (
    "dam_break.py",
    "own_scene.py",
    "tuning.py",
    "episode.py",
    "blow_up.py",
    "effect.py",
    "recommendation.py",
    "diagnosis.py",
)
CONTENTS = "\n```{toctree}\n:hidden:\n:glob:\n\n*\n```\n"
FILM = """
## Film

<video src="../../films/{name}/side_by_side.mp4" poster="../../films/{name}/side_by_side.png"
  controls loop muted playsinline aria-label="The tuned rule and the trained policies"></video>

*The tuned CFL rule and the trained policies on the validation flow {instance}. The number in a tile
is the work of the frame.*

## Description"""


def write() -> None:
    """Write the pages of all environments and of the root; make films where there are networks."""
    paths = documentation.write(ENVIRONMENTS)
    EXTRA.mkdir(parents=True, exist_ok=True)
    filmed = films.make(EXTRA / "films")
    for path in paths:
        if path.stem in filmed:
            path.write_text(with_film(path.read_text(), path.stem, filmed[path.stem]))
    index = ENVIRONMENTS / "README.md"
    index.write_text(index.read_text().replace("# Environments", "# All ids", 1) + CONTENTS)
    PROJECT.mkdir(parents=True, exist_ok=True)
    for name in ROOT_PAGES:
        text = (DOCS.parent / f"{name}.md").read_text()
        (PROJECT / f"{name}.md").write_text(moved(text))


def with_film(text: str, name: str, instance: str) -> str:
    """Return the page of an environment with its film before the description."""
    return text.replace("\n## Description", FILM.format(name=name, instance=instance), 1)


def moved(text: str) -> str:
    """Return a page of the root with the links that it needs in its place on the site."""
    text = text.replace("](docs/", "](../../")
    return re.sub(r"\]\((CITATION\.cff|LICENSE)\)", r"](../../../\1)", text)


def redirect(_app: Any, docname: str, source: list[str]) -> None:
    """Let links to files lead to the pages that the site makes of them."""
    if "/" not in docname:
        for path, page in PAGES_OF_FILES.items():
            source[0] = source[0].replace(f"]({path}", f"]({page}")


def example_order(name: str) -> int:
    """Return the place of an example in the gallery. Raises ValueError for one without a place."""
    return EXAMPLES.index(name)


def as_rst(
    _app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]
) -> None:
    """Turn a docstring into what autodoc reads, in place: headings, lists, and bars in formulas."""
    text = "\n".join(lines)
    text = re.sub(r"^#+ (.+)$", r"\n**\1**\n", text, flags=re.MULTILINE)
    text = re.sub(r"(?<=\S)\n(?=- )", "\n\n", text)
    parts = re.split(r"(`[^`]*`)", text)
    parts[::2] = [part.replace("|", r"\|") for part in parts[::2]]
    lines[:] = "".join(parts).splitlines()


def skip(_app: Any, _what: str, _name: str, member: Any, skipped: bool, _options: Any) -> bool:
    """Return whether the API leaves a member out: fields of tuples, which the signature has."""
    return skipped or str(getattr(member, "__doc__", "")).startswith("Alias for field number")
