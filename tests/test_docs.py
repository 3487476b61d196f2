"""Everything that README.md and the pages in docs/ show works as it stands there.

Python blocks are run. A block that begins with `# path/to/file.py` is a new file of an example, one
with `# path/to/file.py, before "text"` a new part of a file, and a diff block changes a file. All
of a section are put into a copy of the tree, where its tests are run. A section with a `TO FILL`
comment is not finished; its examples are skipped.
"""

import io
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import warnings
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path
from typing import NamedTuple

import gymnasium as gym
import pytest

import sph_gym
import sph_gym.doctor  # noqa: F401  fills CHECKS
from sph_gym import scenes, studies
from sph_gym.doctor.faults import FAULTS
from sph_gym.doctor.registry import CHECKS
from sph_gym.env.selection import members
from sph_gym.solver.registry import EFFECTS

ROOT = Path(__file__).parent.parent
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text()
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/*.md")))
}
README, ARCHITECTURE = PAGES["README.md"], PAGES["docs/architecture.md"]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
FILE = re.compile(r'# ([\w/]+\.py)(?:, before "(.+)")?\n')
CODE = re.compile(r"`([^`\n]+)`")


class Block(NamedTuple):
    """A fenced block: its page, the heading that it stands under, its language and its text."""

    page: str
    heading: str
    language: str
    text: str


def blocks(page):
    """Yield the blocks of a page."""
    text = PAGES[page]
    for found in BLOCK.finditer(text):
        *_, heading = re.findall(r"^#+ (.+)$", BLOCK.sub("", text[: found.start()]), re.MULTILINE)
        yield Block(page, heading, *found.groups())


BLOCKS = [block for page in PAGES for block in blocks(page)]
# Pages whose blocks are one program.
TUTORIALS = ("docs/own_scene.md",)
PROGRAMS = [b for b in BLOCKS if b.language == "python" and not FILE.match(b.text)]
for page in TUTORIALS:
    parts = [b.text for b in PROGRAMS if b.page == page]
    whole = Block(page, "all of it", "python", "\n".join(parts))
    PROGRAMS = [b for b in PROGRAMS if b.page != page] + [whole]
SHELL = [line.split("#")[0].strip() for b in BLOCKS if b.language == "sh"
         for line in b.text.splitlines()]  # fmt: skip
INLINE = [code for text in PAGES.values() for code in CODE.findall(BLOCK.sub("", text))]
COMMANDS = sorted({line for line in SHELL if line.startswith("python -m")})
MENTIONED = sorted({code for code in INLINE if code.startswith("python -m")})
TARGETS = sorted({line.split()[1] for line in [*SHELL, *INLINE] if line.startswith("make ")})
NEW = {Path(found[1]).stem for b in BLOCKS if (found := FILE.match(b.text))}
CALLS = sorted({code for code in INLINE if re.fullmatch(r"env\.[\w.]+\(\)", code)})


def of(module):
    """Return the commands of a module (and its command) that stand in blocks."""
    return [command for command in COMMANDS if command.startswith(f"python -m {module}")]


def run_command(words):
    """Run `python -m WORDS` in this process; return its exit code and what it printed."""
    printed, argv = io.StringIO(), sys.argv
    sys.argv = list(words)
    try:
        with redirect_stdout(printed), warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*found in sys.modules")
            runpy.run_module(words[0], run_name="__main__")
    except SystemExit as end:
        return end.code or 0, printed.getvalue()
    finally:
        sys.argv = argv
    return 0, printed.getvalue()


@cache
def options(*words):
    """Return the help of a command; one page serves all lines with that command."""
    code, text = run_command([*words, "--help"])
    assert code == 0
    return text


# --- Programs and commands ------------------------------------------------------------------


@pytest.mark.parametrize("program", PROGRAMS, ids=[f"{b.page}, {b.heading}" for b in PROGRAMS])
def test_every_program_runs(program, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(program.text, program.page, "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize("call", CALLS)
def test_every_call_is_answered_by_what_make_returns(call):
    env = gym.make("sph_gym/DamBreak-v1", action_mode="discrete")
    env.reset(seed=0)
    assert eval(call, {"env": env}) is not None


@pytest.mark.parametrize("command", [*COMMANDS, *MENTIONED])
def test_every_command_knows_its_options(command):
    words = shlex.split(command)[2:]
    n_words = 2 if words[0] == "sph_gym" and len(words) > 1 else 1
    if words[0].split(".")[-1] in NEW:
        pytest.skip("of an example")
    shown = options(*words[:n_words])
    for word in words:
        if word.startswith("--"):
            assert word in shown


@pytest.mark.parametrize("command", [*COMMANDS, *MENTIONED])
def test_every_name_in_a_command_exists(command):
    words = shlex.split(command)[2:]
    if words[:2] == ["sph_gym", "study"] and len(words) > 2:
        assert words[2] in (*studies.STUDIES, "NAME")
    if words[:2] in (["sph_gym", "run"], ["sph_gym", "recommend"]) and len(words) > 2:
        assert words[2] in {*scenes.names(), *NEW, "SCENE"}
    if "--scene" in words:
        assert members(words[words.index("--scene") + 1])


@pytest.mark.parametrize("command", of("sph_gym run"))
def test_every_run_runs(command, tmp_path, monkeypatch):
    words = shlex.split(command)[2:]
    if "--window" in words:
        pytest.skip("waits for a person")
    monkeypatch.chdir(tmp_path)
    code, _ = run_command([*words, "--set", "dx=0.05", "--seconds", "0.05"])
    assert code == 0
    for option in ("--video", "--save"):
        if option in words:
            assert (tmp_path / words[words.index(option) + 1]).exists()


@pytest.mark.parametrize("command", of("sph_gym docs"))
def test_every_page_is_printed(command):
    words = shlex.split(command)[2:]
    code, printed = run_command(words)
    assert code == 0
    assert printed.startswith(f"# {words[2]}")


# a budget is spent, and an error is tried out
@pytest.mark.parametrize(
    "command",
    [
        pytest.param(command, marks=pytest.mark.slow if "--" in command else ())
        for command in of("sph_gym recommend")
    ],
)
def test_every_recommendation_is_made(command):
    code, printed = run_command(shlex.split(command)[2:])
    assert code == 0
    wanted = "--error" in command or "--budget" in command
    assert ("expected error:" if wanted else "cheapest measured settings") in printed


def test_every_study_has_its_command():
    assert {command.split()[4] for command in of("sph_gym study")} == set(studies.STUDIES)


@pytest.mark.parametrize("target", TARGETS)
def test_every_target_is_made(target):
    done = subprocess.run(
        ["make", "--dry-run", target], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert ".venv" in done.stdout


# --- Links, tables, the tree ----------------------------------------------------------------


def anchors(text):
    """Return the anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", BLOCK.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES)
def test_every_link_and_picture_is_there(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", BLOCK.sub("", PAGES[page])):
        if link.startswith("http"):
            continue
        path, _, anchor = link.partition("#")
        target = ((ROOT / page).parent / path).resolve() if path else ROOT / page
        assert target.exists(), link
        if anchor:
            assert anchor in anchors(target.read_text()), link


def test_every_page_and_every_picture_is_linked():
    text = "".join(PAGES.values())
    for path in (*ROOT.glob("docs/*.md"), *ROOT.glob("docs/pictures/*")):
        assert f"{path.name})" in text, path.name


def test_the_playbook_names_all_checks_and_only_faults_that_exist():
    page = PAGES["docs/playbook.md"]
    named = {word for code in CODE.findall(page) for word in [code] if word.isidentifier()}
    setup = {name for name, check in CHECKS.items() if check.link == "setup"}
    assert set(CHECKS) - setup <= named
    faults = set(re.findall(r"\(`(\w+)`(?:,\s`\w+`)?\)", page))
    assert faults <= set(FAULTS)


def test_the_readme_is_short():
    assert len(README.splitlines()) <= 150


def test_the_table_of_environments_is_complete():
    registered = {name for name in gym.registry if name.startswith("sph_gym/")}
    assert registered == set(re.findall(r"^\| `(sph_gym/[\w-]+)`", README, re.MULTILINE))


def test_every_effect_has_its_row_in_the_table():
    for each in EFFECTS:
        assert "|" not in each.meaning + each.source, f"a | would end a cell: {each.name}"
        row = f"| `{each.name}` | {each.meaning} | {each.source} |"
        assert row in PAGES["docs/solver.md"].splitlines(), f"expected in docs/solver.md:\n{row}"


def section(text, heading):
    """Return the part of a page under a heading of the second level."""
    found = re.search(rf"^## {heading}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    assert found, heading
    if "<!-- TO FILL" in found[1]:
        pytest.skip(f"{heading}: not finished")
    return found[1]


def tree():
    """Return the paths of the tree in the page on architecture, folders with a slash."""
    (_, text), *_ = BLOCK.findall(section(ARCHITECTURE, "The tree"))
    folders, paths = [], set()
    for line in text.splitlines():
        indent, name = len(line) - len(line.lstrip()), line.split()[0]
        folders[indent // 2 :] = [name]
        paths.add("".join(folders))
    return paths


def test_the_tree_is_what_is_there():
    shown = tree()
    for path in shown:
        assert (ROOT / path).is_dir() == path.endswith("/"), path
        assert (ROOT / path).exists(), path
    solver = {f"sph_gym/solver/{path.name}" for path in ROOT.glob("sph_gym/solver/[!_]*.py")}
    assert solver <= shown
    packages = {f"sph_gym/{path.parent.name}/" for path in ROOT.glob("sph_gym/*/__init__.py")}
    assert packages <= shown


# --- Examples of how to add something -------------------------------------------------------


EXAMPLES = re.findall(r"^## (Add .+)$", ARCHITECTURE, re.MULTILINE)
# Those that are quick enough without being compiled.
QUICK_EXAMPLES = [heading for heading in EXAMPLES if heading != "Add a hard case"]


def change(folder, text):
    """Apply a diff block: `--- path`, then hunks after `@@`, found once each; return the path."""
    head, *hunks = re.split(r"^@@.*\n", text, flags=re.MULTILINE)
    name = head.split()[1]
    for hunk in hunks:
        lines = hunk.splitlines(keepends=True)
        old = "".join(line[1:] for line in lines if line[0] in " -")
        new = "".join(line[1:] for line in lines if line[0] in " +")
        before = (folder / name).read_text()
        assert before.count(old) == 1, f"{name}: expected once:\n{old}"
        (folder / name).write_text(before.replace(old, new))
    return name


def insert(path, body, before):
    """Write a new file, or put text before the only line of a file that begins with `before`."""
    assert path.exists() == (before is not None), path
    if before is not None:
        head, *rest = re.split(rf"^(?={re.escape(before)})", path.read_text(), flags=re.MULTILINE)
        assert len(rest) == 1, f"{path.name}: expected once: {before}"
        body = f"{head}{body}\n\n{rest[0]}"
    path.write_text(body)


def put_in(folder, heading):
    """Put the example of a section into a copy of the tree; return the paths that it touches."""
    touched = []
    for language, text in BLOCK.findall(section(ARCHITECTURE, heading)):
        if language == "diff":
            touched.append(change(folder, text))
        elif named := FILE.match(text):
            touched.append(named[1])
            insert(folder / named[1], text[named.end() :].lstrip("\n"), before=named[2])
    return touched


@pytest.fixture
def copy(tmp_path):
    """Return a copy of the sources in which an example may change anything."""
    for name in ("sph_gym", "agents", "tests"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, tmp_path / name, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def check(folder, heading, without_jit):
    touched = put_in(folder, heading)
    [tests] = re.findall(
        r"^[\w= ]*\.venv/bin/python -m (pytest .+)$", section(ARCHITECTURE, heading), re.M
    )
    for tool in (
        [*shlex.split(tests), "-p", "no:cacheprovider", "-n0"],
        ["ruff", "check", "--no-cache", *touched],
        ["ruff", "format", "--check", "--no-cache", *touched],
    ):
        done = subprocess.run(
            [sys.executable, "-m", *tool], cwd=folder, capture_output=True, text=True, timeout=600,
            env=os.environ | {"NUMBA_DISABLE_JIT": without_jit, "PYTHONPATH": str(folder)},
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("heading", QUICK_EXAMPLES)
def test_every_example_passes_its_tests(heading, copy):
    check(copy, heading, without_jit="1")


@pytest.mark.slow
@pytest.mark.parametrize("heading", EXAMPLES)
def test_every_example_passes_its_tests_when_compiled(heading, copy):
    check(copy, heading, without_jit="0")
