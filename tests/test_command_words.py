"""The words of the command line: helps, suggestions, completion, and programs of a clone."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sph_gym.__main__ import main
from sph_gym.command_line import INTERRUPTED, PIPE_CLOSED, make_parser
from sph_gym.command_line.parser import FAILED, WRONG

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "command-line.md").read_text()


def commands():
    """Return the parsers of all commands, by name."""
    [chosen] = [action for action in make_parser()._actions if isinstance(action.choices, dict)]
    return chosen.choices


@pytest.mark.parametrize("name", commands())
def test_every_example_of_a_help_can_be_typed(name):
    parser = commands()[name]
    assert parser.examples
    for line in parser.examples:
        words = shlex.split(line.partition(" > ")[0])
        assert words[:2] == ["sph-gym", name]
        if "--help" not in words:
            assert make_parser().parse_args(words[1:]).function
        assert line in parser.format_help()


def test_examples_of_the_first_help_can_be_typed():
    parser = make_parser()
    for line in parser.examples:
        words = shlex.split(line)[1:]
        assert "--help" in words or parser.parse_args(words).function
    assert len(parser.examples) > 2


def test_an_interrupted_start_has_no_traceback(tmp_path):
    # stands for Ctrl-C while modules are imported
    (tmp_path / "tqdm.py").write_text("raise KeyboardInterrupt")
    done = subprocess.run(
        [sys.executable, "-m", "sph_gym", "doctor", "--list"], cwd=tmp_path, capture_output=True,
        text=True, check=False, env=os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (INTERRUPTED, "sph_gym: interrupted\n")


def test_the_page_is_true():
    blocks = re.findall(r"^```sh\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines() if "sph-gym" in line]
    assert len(lines) > 5
    for line in lines:
        assert make_parser().parse_args(shlex.split(line.partition(" > ")[0])[1:]).function
    assert set(re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE)) >= set(commands())
    statuses = re.findall(r"^\| (\d+) \|", PAGE, re.MULTILINE)
    assert [*map(int, statuses)] == [0, FAILED, WRONG, INTERRUPTED, PIPE_CLOSED]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("rnu", "COMMAND: expected one of run, .*, got 'rnu' .did you mean run"),
        ("run relaxation --secnods 1", "--secnods: no such argument .did you mean --seconds"),
        ("run relaxation --secnods=1", "--secnods=1: no such argument .did you mean --seconds"),
        ("run relaxation --sec 1", "--sec: no such argument"),
        ("run relaxation pool", "pool: no such argument"),
        ("run relaxation --dt small", "--dt: expected a number, got 'small'"),
        ("run", "the following arguments are required: scene"),
        ("completion bsh", "SHELL: expected one of bash, .*, got 'bsh' .did you mean bash"),
    ],
)
def test_a_word_that_is_not_known_gives_one_line_with_the_nearest(line, message, capsys):
    with pytest.raises(SystemExit) as end:
        main(line.split())
    assert end.value.code == WRONG
    [error] = capsys.readouterr().err.splitlines()
    assert re.match(f"sph_gym: {message}", error), error
    assert error.endswith("--help")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("run dam_brek", "scene: .*did you mean 'dam_break'"),
        ("run dam_break --set widht=1", "argument of dam_break: .*did you mean 'width'"),
        ("run relaxation --controller adaptiv", "did you mean 'adaptive'"),
        ("study soaks", "did you mean 'soak'"),
        ("study soak --scenes dam_break", "^sph_gym: --scenes: only the studies"),
        ("run nothing.npz", "^sph_gym: nothing.npz: there is no such file"),
        (f"docs --output {ROOT}/README.md", "^sph_gym: [^ ]*README.md: File exists$"),
        ("docs sph_gym/DamBreak-v2", "did you mean 'sph_gym/DamBreak-v1'"),
        ("doctor --fault atracts", "did you mean 'attracts'"),
        ("recommend eliptical_drop --error 1%", "did you mean 'elliptical_drop'"),
        ("recommend dam_break --json x.json", "^sph_gym: --json: expected --error or --budget"),
        ("run relaxation --log -3", "^sph_gym: --log: expected a number at least 0, got -3"),
        ("run relaxation --video x.avi", "^sph_gym: --video: expected a name ending in .mp4 or"),
        ("run relaxation --video no/x.gif", "^sph_gym: --video: there is no directory 'no'$"),
        (
            "run relaxation --save x.foo",
            "^sph_gym: --save: expected a name ending in .npz or .*, got 'x.foo'",
        ),
        (
            "run relaxation --gauge level:0 --gauges no/such/x.csv",
            "^sph_gym: --gauges: there is no directory 'no/such'$",
        ),
        ("run relaxation --json no/o.json", "^sph_gym: --json: there is no directory 'no'$"),
        (f"run relaxation --json {ROOT}", "^sph_gym: --json: expected a file, got the directory"),
    ],
)
def test_a_name_that_is_not_known_gives_one_line_with_the_nearest(line, message, capsys):
    assert main(line.split()) == WRONG
    [error] = capsys.readouterr().err.splitlines()
    assert error.startswith("sph_gym: ")
    assert re.search(message, error), error


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_the_shell_completes_names(shell, capsys, tmp_path):
    pytest.importorskip("shtab")
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    for word in ("dam_break", "tuned_cfl", "validation", "sph_gym/DamBreak-v1", "--seconds"):
        assert word.removeprefix("--") in script
    if shutil.which(shell):
        (tmp_path / "script").write_text(script)
        subprocess.run([shell, "-n", str(tmp_path / "script")], check=True)


PROGRAM = '''"""Greet somebody: `python -m agents.hello NAME`."""
import sys

if __name__ == "__main__":
    print("hello", *sys.argv[1:])
    sys.exit(3)
'''


def agents(folder, *words):
    """Run `sph-gym agents` in a folder; return the finished process."""
    return subprocess.run(
        [sys.executable, "-m", "sph_gym", "agents", *words], cwd=folder, capture_output=True,
        text=True, check=False, env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip


def test_programs_of_a_clone_are_commands(tmp_path):
    (tmp_path / "agents").mkdir()
    for name in ("__init__.py", "compare.py"):
        (tmp_path / "agents" / name).touch()
    (tmp_path / "agents" / "hello.py").write_text(PROGRAM)
    assert agents(tmp_path).stdout == "hello  Greet somebody\n"
    done = agents(tmp_path, "hello", "--loud", "you")
    assert (done.returncode, done.stdout) == (3, "hello --loud you\n")
    refused = agents(tmp_path, "helo")
    assert refused.returncode == WRONG
    assert "did you mean 'hello'" in refused.stderr


def test_a_program_names_itself_as_it_was_called():
    shown = agents(ROOT, "random_agent", "--help").stdout
    assert shown.startswith("usage: sph-gym agents random_agent [-h]")
    done = subprocess.run(
        [sys.executable, "-m", "agents.random_agent", "--help"], cwd=ROOT, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    assert done.stdout.startswith("usage: python -m agents.random_agent [-h]")


def test_the_agents_of_this_clone_are_listed():
    listed = agents(ROOT).stdout
    for name in ("compare", "grid_search", "record"):
        assert re.search(rf"^{name} +\w", listed, re.MULTILINE)
