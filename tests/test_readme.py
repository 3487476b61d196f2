"""What the README shows can be done as it stands there."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import sph_gym  # noqa: F401  registers the environments

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text()
PROGRAMS = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
CALLS = sorted(set(re.findall(r"`(env\.[\w.]+\(\))`", TEXT)))
LINES = "\n".join(re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL)).splitlines()
COMMANDS = [line.split("#")[0].strip() for line in LINES if line.startswith("python -m")]
TARGETS = [line.split()[1] for line in LINES if line.startswith("make ")]


def run(arguments, folder=ROOT):
    return subprocess.run(arguments, cwd=folder, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("program", PROGRAMS, ids=range(len(PROGRAMS)))
def test_every_program_runs(program, tmp_path):
    done = run([sys.executable, "-W", "error::UserWarning", "-c", program], tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("call", CALLS)
def test_every_call_is_answered_by_what_make_returns(call):
    import gymnasium as gym

    env = gym.make("sph_gym/DamBreak-v0", action_mode="discrete")
    env.reset(seed=0)
    assert eval(call, {"env": env}) is not None


@pytest.mark.parametrize("command", [c for c in COMMANDS if "sph_gym run" in c])
def test_every_run_runs(command, tmp_path):
    words = shlex.split(command)[1:]
    if "--window" in words:
        pytest.skip("waits for a person")
    shorter = ["--set", "dx=0.05", "--seconds", "0.05"]
    done = run([sys.executable, *words, *shorter], tmp_path)
    assert done.returncode == 0, done.stderr
    if "--video" in words:
        assert (tmp_path / words[words.index("--video") + 1]).exists()


@pytest.mark.parametrize("command", [c for c in COMMANDS if "agents." in c])
def test_every_agent_knows_its_options(command):
    words = shlex.split(command)[1:]
    shown = run([sys.executable, *words[:2], "--help"])
    assert shown.returncode == 0, shown.stderr
    for word in words:
        if word.startswith("--"):
            assert word in shown.stdout


@pytest.mark.parametrize("command", [c for c in COMMANDS if "sph_gym docs" in c])
def test_every_page_is_printed(command):
    words = shlex.split(command)[1:]
    done = run([sys.executable, *words])
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"# {words[3]}")


@pytest.mark.parametrize("command", [c for c in COMMANDS if "sph_gym recommend" in c])
def test_every_recommendation_is_made(command):
    done = run([sys.executable, *shlex.split(command)[1:]])
    assert done.returncode == 0, done.stderr
    wanted = "--error" in command or "--budget" in command
    assert ("expected error:" if wanted else "cheapest measured settings") in done.stdout


def test_every_study_is_known():
    named = {c.split()[4] for c in COMMANDS if " study " in c}
    from sph_gym import studies

    assert named == set(studies._STUDIES)


@pytest.mark.parametrize("target", TARGETS)
def test_every_target_is_made(target):
    done = run(["make", "--dry-run", target])
    assert done.returncode == 0
    assert ".venv" in done.stdout


def test_every_picture_is_there():
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", TEXT)
    assert pictures
    assert all((ROOT / picture).exists() for picture in pictures)


def test_the_table_of_environments_is_complete():
    import gymnasium as gym

    registered = {name for name in gym.registry if name.startswith("sph_gym/")}
    assert registered == set(re.findall(r"^\| `(sph_gym/[\w-]+)`", TEXT, re.MULTILINE))
