"""Pages of the site that are made from the code and from files beside docs/."""

import importlib
import re
import shutil

import films
import pytest
import site_pages

from sph_gym.env import SCENES, documentation, env_id
from tests.networks import tiny

# the package has a function of this name
shipped_networks = importlib.import_module("sph_gym.controllers.shipped")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Let all that is generated go to a folder of its own."""
    for name, parts in {
        "ENVIRONMENTS": ("environments",),
        "PROJECT": ("project",),
        "EXTRA": ("extra",),
    }.items():
        monkeypatch.setattr(site_pages, name, tmp_path.joinpath(*parts))
    # with networks, there would be films as well
    monkeypatch.setattr(shipped_networks, "SHIPPED", tmp_path / "none")
    return tmp_path


def test_every_id_has_the_page_that_the_command_prints(folder):
    site_pages.write()
    for id_ in documentation.ids():
        page = folder / "environments" / f"{id_.removeprefix(documentation.PREFIX)}.md"
        assert page.read_text() == documentation.page(id_)
        assert f"({page.name})" in (folder / "environments" / "README.md").read_text()


def test_pages_of_the_root_link_to_where_things_are_on_the_site(folder):
    site_pages.write()
    text = (folder / "project" / "README.md").read_text()
    assert "](../../environments.md)" in text
    assert "](../../../LICENSE)" in text
    assert "](docs/" not in text


def test_pages_of_the_root_link_to_nothing_that_the_site_lacks(folder):
    site_pages.write()
    for page in (folder / "project").iterdir():
        text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S)
        targets = {one.partition("#")[0] for one in re.findall(r"\]\((?!https?:)([^)]+)\)", text)}
        here = {f"{name}.md" for name in site_pages.ROOT_PAGES}
        assert {one for one in targets if not one.startswith("../")} <= here


def test_links_to_pages_of_the_root_lead_to_their_copies():
    text = ["[a](../README.md#train-an-agent) [b](../sph_gym/run.py) [c](solver.md)"]
    site_pages.redirect(None, "environments", text)
    moved = "generated/project/README.md#train-an-agent"
    assert text == [f"[a]({moved}) [b](../sph_gym/run.py) [c](solver.md)"]


def test_docstrings_become_what_autodoc_reads():
    lines = ["Return |x|.", "", "## Arguments", "These:", "- `a|b`: one", "  and more", "- c: two"]
    site_pages.as_rst(None, "", "", None, None, lines)
    assert "\n".join(lines) == (
        r"Return \|x\|.\n\n\n**Arguments**\n\nThese:\n\n- `a|b`: one\n  and more\n\n- c: two"
    ).replace(r"\n", "\n")


# --- Films ----------------------------------------------------------------------------------


def test_without_networks_no_page_has_a_film(folder):
    site_pages.write()
    assert not list(folder.rglob("*.mp4"))
    assert not any("Film" in path.read_text() for path in folder.rglob("environments/*.md"))


def test_a_trained_policy_gets_a_film_beside_the_tuned_rule(folder, monkeypatch):
    scene = "patch_impact"
    networks = folder / "networks"
    networks.mkdir()
    monkeypatch.setattr(shipped_networks, "SHIPPED", networks)
    tiny().save(networks / f"ppo_{scene}.npz")
    site_pages.write()
    name = env_id(scene).rpartition("/")[2]
    made = folder / "extra" / "films" / name / "side_by_side.mp4"
    assert made.stat().st_size > 1000
    assert made.with_suffix(".png").exists()
    page = (folder / "environments" / f"{name}.md").read_text()
    assert f"../../films/{name}/{made.name}" in page
    assert page.index("## Film") < page.index("## Description")
    for other in set(SCENES) - {scene}:
        path = folder / "environments" / f"{env_id(other).rpartition('/')[2]}.md"
        assert "## Film" not in path.read_text()
    # it is not made again as long as the network is the same
    before = made.stat().st_mtime_ns
    films.make(folder / "extra" / "films")
    assert made.stat().st_mtime_ns == before
    shutil.rmtree(folder / "extra")
