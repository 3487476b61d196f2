"""The folder of the cache: where it is, and that it never hides a package."""

import os
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import sph_gym
from sph_gym import files
from sph_gym.files import cache_home

pytestmark = [
    pytest.mark.without_jit,
    pytest.mark.skipif(sys.platform == "win32", reason="other variables"),
]
NAMES = ("SPH_GYM_CACHE", "XDG_CACHE_HOME", "HOME")
UNUSABLE = ["", ".", "cache", "./cache", "a/b", "sph_gym"]


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    files._temporary_cache.cache_clear()
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    yield tmp_path / "home"
    files._temporary_cache.cache_clear()


@pytest.mark.parametrize("value", UNUSABLE)
def test_an_empty_or_relative_cache_folder_of_xdg_counts_as_unset(value, home, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", value)
    assert cache_home() == home / ".cache" / "sph-gym"


@pytest.mark.parametrize("value", UNUSABLE[1:])
def test_a_relative_folder_of_the_user_is_told_and_not_used(value, home, monkeypatch):
    monkeypatch.setenv("SPH_GYM_CACHE", value)
    with pytest.warns(UserWarning, match="SPH_GYM_CACHE: expected an absolute path"):
        assert cache_home() == home / ".cache" / "sph-gym"


def test_an_empty_one_counts_as_unset(home, monkeypatch):
    monkeypatch.setenv("SPH_GYM_CACHE", "")
    assert cache_home() == home / ".cache" / "sph-gym"


def test_no_folder_has_the_name_of_the_package(tmp_path, home, monkeypatch):
    assert not cache_home().name.isidentifier()
    monkeypatch.setenv("SPH_GYM_CACHE", str(tmp_path / "sph_gym"))
    with pytest.warns(UserWarning, match="SPH_GYM_CACHE"):
        assert cache_home() == home / ".cache" / "sph-gym"


@pytest.mark.parametrize("value", ["", "here", None])
def test_a_home_that_is_none_counts_as_unset(value, monkeypatch):
    import pwd

    if value is None:
        monkeypatch.delenv("HOME")
    else:
        monkeypatch.setenv("HOME", value)
    monkeypatch.setattr(files, "_can_be_written", lambda folder: True)
    assert cache_home() == Path(pwd.getpwuid(os.getuid()).pw_dir) / ".cache" / "sph-gym"


def test_without_a_home_that_can_be_written_it_is_a_private_temporary_folder(
    tmp_path, home, monkeypatch
):
    home.write_text("in the way")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.warns(UserWarning, match="set SPH_GYM_CACHE"):
        found = cache_home()
    assert found == tmp_path / f"sph-gym-{os.getuid()}"
    assert stat.S_IMODE(found.stat().st_mode) == 0o700
    # told once
    assert cache_home() == found


def test_a_temporary_folder_that_others_can_write_is_not_trusted(tmp_path, home, monkeypatch):
    home.write_text("in the way")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / f"sph-gym-{os.getuid()}").mkdir()
    (tmp_path / f"sph-gym-{os.getuid()}").chmod(0o777)
    with pytest.warns(UserWarning, match="set SPH_GYM_CACHE"):
        found = cache_home()
    assert found.parent == tmp_path
    assert found.name.startswith("sph-gym-")
    assert stat.S_IMODE(found.stat().st_mode) == 0o700


@pytest.mark.every(3)
@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", "SPH_GYM_CACHE"])
@pytest.mark.parametrize("value", ["", "sph_gym"])
def test_nothing_is_put_into_the_working_directory(variable, value, tmp_path, home):
    code = "import sph_gym, sph_gym.solver.stepping; print(sph_gym.__file__)"
    work = tmp_path / "work"
    for folder in (home, work):
        folder.mkdir()
    environment = {name: text for name, text in os.environ.items() if name not in NAMES}
    root = Path(sph_gym.__file__).parents[1]
    environment |= {variable: value, "HOME": str(home), "PYTHONPATH": str(root)}
    for _ in range(2):
        run = subprocess.run(
            [sys.executable, "-c", code], cwd=work, env=environment, check=True,
            capture_output=True, text=True,
        )  # fmt: skip
        assert run.stdout.strip() == sph_gym.__file__
        assert list(work.iterdir()) == []
