"""The built site: no warning, no link that leads nowhere, nothing from the network."""

import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

import pytest
import site_pages

from sph_gym.env.selection import GROUPS
from tests.docs.conftest import DOCS

ROOT = DOCS.parent
# Attributes whose targets a browser fetches by itself.
FETCHED = {
    "audio": ("src",), "embed": ("src",), "iframe": ("src",), "img": ("src", "srcset"),
    "link": ("href",), "object": ("data",), "script": ("src",), "source": ("src", "srcset"),
    "video": ("src", "poster"),
}  # fmt: skip
# Relations of a link that nothing is fetched for.
IDLE = {"canonical", "next", "prev", "index", "search", "author"}
REMOTE = re.compile(r"""(?:url\(\s*|@import\s+)["']?(?:https?:)?//""")


class Page(HTMLParser):
    """Anchors of a page, targets of its links, and what it fetches."""

    def __init__(self, text):
        super().__init__()
        self.anchors, self.links, self.fetched = set(), [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = {name: value or "" for name, value in attrs}
        self.anchors.update(given[name] for name in ("id", "name") if name in given)
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag == "link" and set(given.get("rel", "").split()) & IDLE:
            return
        self.fetched += [given[name] for name in FETCHED.get(tag, ()) if given.get(name)]


class Fault(NamedTuple):
    """Fault of a target on a page."""

    page: str
    target: str


def read(folder):
    """Return the pages of a site by their resolved paths."""
    return {path.resolve(): Page(path.read_text()) for path in folder.rglob("*.html")}


def from_network(folder):
    """Return what pages and style sheets would fetch from the network."""
    found = [
        Fault(path.name, target)
        for path, page in read(folder).items()
        for target in page.fetched
        if urlsplit(target).netloc
    ]
    for path in (*folder.rglob("*.css"), *folder.rglob("*.html")):
        found += [Fault(path.name, text) for text in REMOTE.findall(path.read_text())]
    return found


def dead(folder):
    """Return the targets within the site that aren't there: pages, anchors, pictures, files."""
    pages, found = read(folder), []
    for path, page in pages.items():
        for target in (*page.links, *page.fetched):
            parts = urlsplit(target)
            if parts.scheme or parts.netloc or target == "#":
                continue
            there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchors = pages[there].anchors if there in pages else None
            missing = anchors is not None and unquote(parts.fragment) not in {"", *anchors}
            if not there.is_file() or missing:
                found.append(Fault(path.relative_to(folder.resolve()).as_posix(), target))
    return found


def test_faults_of_a_site_are_found(tmp_path):
    (tmp_path / "a.html").write_text(
        '<h1 id="top"></h1><a href="b.html#here"></a><a href="b.html#gone"></a>'
        '<a href="https://example.org"></a><img src="missing.png">'
        '<script src="https://example.org/x.js"></script><link rel="stylesheet" href="s.css">'
    )
    (tmp_path / "b.html").write_text('<p id="here"></p><a href="a.html"></a>')
    (tmp_path / "s.css").write_text('@import "https://example.org/font.css";')
    assert {fault.target for fault in dead(tmp_path)} == {"b.html#gone", "missing.png"}
    assert [fault.page for fault in from_network(tmp_path)] == ["a.html", "s.css"]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return the site as `make docs` builds it, but for the examples, which other tests run."""
    copy = tmp_path_factory.mktemp("site")
    ignored = shutil.ignore_patterns("_build", "generated", "__pycache__")
    shutil.copytree(DOCS, copy / "docs", ignore=ignored)
    pages = [f"{name}.md" for name in site_pages.ROOT_PAGES]
    for name in (*pages, "CITATION.cff", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    options = ["-W", "--keep-going", "-q", "-D", "plot_gallery=0", "-b", "html"]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, "docs", "html"],
        cwd=copy, capture_output=True, text=True, timeout=900,
        # films are made with agents of the clone
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return Path(copy / "html")


@pytest.mark.slow
def test_the_site_is_whole_and_needs_no_network(site):
    assert (site / "index.html").exists()
    assert (site / "generated" / "gallery" / "dam_break.html").exists()
    assert len(list(site.glob("films/*/*.mp4"))) == len(GROUPS["benchmark"])
    assert from_network(site) == []
    assert dead(site) == []
