"""The package as it is installed: what it contains, what it needs, and that it works elsewhere.

Slow tests build it and install it into empty environments, which takes a network.
"""

import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import sph_gym
from sph_gym import env, scenes
from sph_gym.env.distributions import FAMILIES

ROOT = Path(__file__).parent.parent
VERSIONS = ("3.10", "3.11", "3.12", "3.13")
MEGABYTE = 1e6
# Data without which an installed package can't do its work.
NEEDED = (
    "py.typed",
    "controllers/networks",
    "doctor/report.html.j2",
    "env/documentation/page.md",
    "env/manifests/dam_break.npz",
    "recommend/data/runs/dam_break.csv",
    "scenes/data/elliptical_drop.csv",
)
# First steps of a user, in a folder of their own. Nothing of them needs an extra or a display.
PROGRAM = """
import sys
from pathlib import Path

for name in ("torch", "stable_baselines3", "matplotlib", "scipy", "pandas", "agents"):
    sys.modules[name] = None
import gymnasium
import sph_gym

assert Path(sph_gym.__file__).is_relative_to(sys.prefix), sph_gym.__file__
from sph_gym import recommend
from sph_gym.controllers import shipped
from sph_gym.controllers.shipped import names
from sph_gym.doctor import check_solver

env = gymnasium.make("sph_gym/DamBreak-v1", instances="test", render_mode="rgb_array")
observation, info = env.reset(seed=0)
if names():
    policy = shipped("dam_break")
    assert policy.card["what"]
    assert env.action_space.contains(policy(observation))
*_, info = env.step(env.action_space.sample())
assert env.render().std() > 0
assert info["n_substeps"] > 0
assert "cheapest measured settings" in "\\n".join(recommend.summarize("dam_break"))
assert check_solver("sph_gym.doctor.plain:make").ok
"""


def run(*words, cwd, **options):
    """Run a program and return what it printed; it must not fail."""
    done = subprocess.run(
        list(map(str, words)), cwd=cwd, capture_output=True, text=True, check=False, **options
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def clean():
    """Return the environment variables without those that lead to this tree or to a display."""
    hidden = ("PYTHONPATH", "DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    return {name: value for name, value in os.environ.items() if name not in hidden}


# --- What `import sph_gym` does -------------------------------------------------------------


def test_every_public_name_is_there():
    namespace = {}
    exec("from sph_gym import *", namespace)
    assert set(sph_gym.__all__) <= set(namespace)
    assert set(dir(sph_gym)) == {*sph_gym.__all__, "__version__"}
    with pytest.raises(AttributeError, match="has no attribute 'Simulaton'"):
        sph_gym.Simulaton  # noqa: B018


def test_the_environments_are_known_without_importing_their_scenes():
    assert scenes.with_family() == tuple(FAMILIES) == env.SCENES


def test_importing_the_package_leaves_the_solver_alone():
    """Only so it is quick: numba and the solver take most of a second."""
    code = """
import sys
import gymnasium
import sph_gym
heavy = {"numba", "pygame", "sph_gym.solver.simulation", "sph_gym.view", "sph_gym.scenes.dam_break"}
assert not heavy & set(sys.modules), heavy & set(sys.modules)
assert gymnasium.spec("sph_gym/DamBreak-v1").kwargs == {"scene": "dam_break"}
from sph_gym.command_line import make_parser
make_parser()
assert not heavy & set(sys.modules), heavy & set(sys.modules)
"""
    run(sys.executable, "-c", code, cwd=ROOT)


# --- What is built --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def dist(tmp_path_factory):
    """Return the folder of the built sdist and wheel; the wheel is built from the sdist."""
    folder = tmp_path_factory.mktemp("dist")
    source = tmp_path_factory.mktemp("source") / "sph_gym"
    made = (".git", ".venv", "build", "dist", "runs")

    def ignore(folder, names):
        return made if folder == str(ROOT) else ("__pycache__",)

    shutil.copytree(ROOT, source, ignore=ignore)
    done = subprocess.run(
        [sys.executable, "-m", "build", "--outdir", str(folder), str(source)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "deprecated" not in done.stdout + done.stderr
    return folder


def wheel(dist):
    [path] = dist.glob("*.whl")
    return path


@pytest.mark.slow
def test_the_wheel_is_small_and_complete(dist):
    with zipfile.ZipFile(wheel(dist)) as archive:
        sizes = {info.filename: info.file_size for info in archive.infolist()}
    assert max(sizes.values()) <= MEGABYTE
    assert wheel(dist).stat().st_size <= 6 * MEGABYTE
    roots = {name.partition("/")[0] for name in sizes}
    assert roots == {"sph_gym", f"sph_gym-{sph_gym.__version__}.dist-info"}
    for path in ROOT.glob("sph_gym/**/*.py"):
        assert path.relative_to(ROOT).as_posix() in sizes
    for name in NEEDED:
        place = ROOT / "sph_gym" / name
        files = [place] if place.is_file() else place.glob("*")
        for path in files:
            assert path.relative_to(ROOT).as_posix() in sizes, path


def lowest():
    """Return the lowest versions that pyproject.toml allows, as constraints of pip."""
    text = (ROOT / "pyproject.toml").read_text()
    [block] = re.findall(r"^dependencies = \[\n(.*?)^\]", text, re.MULTILINE | re.DOTALL)
    bounds = re.findall(r'"([\w-]+)>=([\d.]+)"', block)
    assert len(bounds) == len(block.strip().splitlines())
    return "".join(f"{name}=={bound}\n" for name, bound in bounds)


def test_the_entry_for_gymnasium_names_the_version_that_is_needed():
    [badge] = re.findall(
        r"badge/Gymnasium-%3E%3D([\d.]+)-blue", (ROOT / "RELEASING.md").read_text()
    )
    assert f"gymnasium=={badge}" in lowest().splitlines()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("version", "constraints"),
    [("3.10", "lowest"), *((version, "newest") for version in VERSIONS)],
)
def test_it_works_where_nothing_else_is(version, constraints, dist, tmp_path):
    running = "{}.{}".format(*sys.version_info)
    python = sys.executable if version == running else shutil.which(f"python{version}")
    # a launcher of a version that is not chosen is there, but runs nothing
    if python is None or subprocess.run([python, "--version"], capture_output=True).returncode:
        pytest.skip(f"there is no python{version}")
    limits = tmp_path / "constraints.txt"
    limits.write_text(lowest() if constraints == "lowest" else "")
    run(python, "-m", "venv", tmp_path / "venv", cwd=tmp_path, env=clean())
    own = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin")
    install = (own / "python", "-m", "pip", "install", "--quiet", "--constraint", limits)
    run(*install, wheel(dist), cwd=tmp_path, env=clean())
    run(own / "python", "-c", PROGRAM, cwd=tmp_path, env=clean())
    assert "sph_gym/DamBreak-v1" in run(own / "sph-gym", "docs", cwd=tmp_path, env=clean())
    refused = subprocess.run(
        [own / "sph-gym", "agents"], cwd=tmp_path, env=clean(), capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert refused.returncode == 2
    assert "agents: expected to run in a clone of the project" in refused.stderr
