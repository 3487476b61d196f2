"""The cache of machine code: named by the sources, put where the user says, done without."""

import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numba
import pytest

from sph_gym.solver import jit
from sph_gym.solver.jit import FASTMATH, cache_home, source_hash

SOLVER = Path(jit.__file__).parent

# compiles one small function, in a fresh interpreter
SMALL = """
from sph_gym.solver.jit import jit
from sph_gym.solver.confinement import reflect

@jit
def bounce(x, u):
    return reflect(0.0, 1.0, 0.0, 0.0, 0.5, x, u)

print(bounce(-1.0, -2.0))
"""


@pytest.fixture
def copied(tmp_path, monkeypatch):
    """A copy of the solver's sources that `source_hash` takes for the real ones."""
    copy = tmp_path / "solver"
    shutil.copytree(SOLVER, copy, ignore=shutil.ignore_patterns("__pycache__"))
    # remembered from now on: it must not be that of the copy
    source_hash()
    monkeypatch.setattr(jit, "__file__", str(copy / "jit.py"))
    return copy


@pytest.mark.without_jit
def test_the_hash_of_a_copy_is_the_same(copied):
    assert source_hash.__wrapped__() == source_hash()


@pytest.mark.without_jit
@pytest.mark.parametrize("name", sorted(path.name for path in SOLVER.glob("*.py")))
def test_any_changed_source_changes_the_hash(copied, name):
    with (copied / name).open("a") as source:
        source.write("# changed\n")
    assert source_hash.__wrapped__() != source_hash()


@pytest.mark.without_jit
def test_a_new_a_lost_and_a_renamed_source_change_the_hash(copied):
    hashes = {source_hash.__wrapped__()}
    (copied / "new.py").write_text("")
    hashes.add(source_hash.__wrapped__())
    (copied / "new.py").rename(copied / "newer.py")
    hashes.add(source_hash.__wrapped__())
    (copied / "lanes.py").unlink()
    hashes.add(source_hash.__wrapped__())
    assert len(hashes) == 4


@pytest.mark.without_jit
def test_another_compiler_changes_the_hash(monkeypatch):
    monkeypatch.setattr(numba, "__version__", "0.0")
    assert source_hash.__wrapped__() != source_hash()


@pytest.mark.without_jit
def test_the_users_folder_comes_first(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.setenv("SPH_GYM_CACHE", str(tmp_path / "mine"))
    assert cache_home() == tmp_path / "mine"
    monkeypatch.delenv("SPH_GYM_CACHE")
    if sys.platform != "win32":
        assert cache_home() == tmp_path / "xdg" / "sph-gym"


# a function of numba's own calls helpers, three deep, that an entry point was made of before
OWN = """
import numba
from sph_gym.solver.jit import jit, jitable

@jitable
def third(x):
    return x + 1.0

@jitable
def second(x):
    return 2.0 * third(x)

@jitable
def first(x):
    return second(x) - 3.0

@jit
def entry(x):
    return first(x)

@numba.njit
def own(x):
    return 10.0 * first(x)

print(entry(5.0), own(5.0))
"""


def run(folder, cache, program=SMALL):
    """A program, put into `folder`, in another interpreter, with `cache` for its cache."""
    script = folder / "small.py"
    script.write_text(program)
    # the tree that is tested here, wherever it is installed
    environment = os.environ | {
        "SPH_GYM_CACHE": str(cache),
        "NUMBA_DISABLE_JIT": "0",
        "PYTHONPATH": str(SOLVER.parents[1]),
    }
    return subprocess.run(
        [sys.executable, "-W", "error", script],
        env=environment,
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()


def test_machine_code_goes_to_the_chosen_folder(tmp_path):
    assert run(tmp_path, tmp_path / "cache") == "(0.0, 1.0)"
    assert {path.name for path in (tmp_path / "cache" / "jit").iterdir()} == {source_hash()}
    assert list(tmp_path.glob("cache/jit/*/**/*.nbc"))


def test_helpers_can_be_used_by_functions_of_numbas_own(tmp_path):
    assert run(tmp_path, tmp_path / "cache", OWN) == "9.0 90.0"


def test_without_a_folder_to_write_to_it_still_runs(tmp_path):
    a_file = tmp_path / "file"
    a_file.write_text("")
    assert run(tmp_path, a_file / "cache") == "(0.0, 1.0)"


def test_fast_math_leaves_what_is_not_finite_alone():
    assert not FASTMATH & {"nnan", "ninf", "fast"}


# --- A cache that fails ---------------------------------------------------------------------


def again(folder, cache):
    """SMALL once more; what it printed, and its warnings."""
    environment = os.environ | {
        "SPH_GYM_CACHE": str(cache),
        "NUMBA_DISABLE_JIT": "0",
        "PYTHONPATH": str(SOLVER.parents[1]),
    }
    done = subprocess.run(
        [sys.executable, "-W", "always::UserWarning", folder / "small.py"],
        env=environment,
        capture_output=True,
        text=True,
    )
    return done.stdout.strip(), done.stderr


@pytest.mark.parametrize(("kind", "content"), [("nbi", b""), ("nbc", None)])
def test_damaged_machine_code_is_made_anew_with_a_warning(tmp_path, kind, content):
    cache = tmp_path / "cache"
    run(tmp_path, cache)
    [file] = cache.glob(f"jit/*/**/small.bounce*.{kind}")
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2] if content is None else content)
    shown, warning = again(tmp_path, cache)
    assert shown == "(0.0, 1.0)"
    assert "is damaged and made anew" in warning
    assert again(tmp_path, cache) == ("(0.0, 1.0)", "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no disk that is always full")
def test_on_a_full_disk_it_runs_with_a_warning(tmp_path, monkeypatch):
    from numba.core.caching import IndexDataCacheFile

    def full(*arguments):
        Path("/dev/full").write_text("no room for this")

    monkeypatch.setenv("SPH_GYM_CACHE", str(tmp_path))
    monkeypatch.setattr(IndexDataCacheFile, "_save_data", full)

    @jit.jit
    def twice(x):
        return 2 * x

    with pytest.warns(UserWarning, match=r"can't be kept in .*No space left"):
        assert twice(21) == 42


def test_two_processes_never_run_the_code_of_each_other(tmp_path, monkeypatch):
    """Both look into the index before either has written to it, which numba alone can't stand."""
    monkeypatch.setenv("SPH_GYM_CACHE", str(tmp_path))

    @jit.jit
    def twice(x):
        return 2 * x

    file = twice._cache._cache_file
    file.save("of one", "code of one")
    before = file._load_index()
    file.save("of another", "code of another")
    with monkeypatch.context() as race:
        race.setattr(file, "_load_index", lambda: before)
        file.save("of a third", "code of a third")
    assert file.load("of a third") == "code of a third"
    # lost, and so compiled once more; never that of the third
    assert file.load("of another") is None
    assert file.load("of one") == "code of one"


def test_of_two_processes_at_once_one_compiles(tmp_path):
    script, cache = tmp_path / "small.py", tmp_path / "cache"
    script.write_text(SMALL)
    environment = os.environ | {
        "SPH_GYM_CACHE": str(cache),
        "NUMBA_DISABLE_JIT": "0",
        "PYTHONPATH": str(SOLVER.parents[1]),
    }
    both = [
        subprocess.Popen(
            [sys.executable, "-W", "error", script],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    assert [each.communicate()[0].strip() for each in both] == ["(0.0, 1.0)"] * 2
    assert run(tmp_path, cache) == "(0.0, 1.0)"
    # one of them has compiled, the other one has waited for it
    assert len(list(cache.rglob("*.nbc"))) == 1


def test_a_compilation_that_failed_keeps_nobody_waiting(tmp_path, monkeypatch):
    monkeypatch.setenv("SPH_GYM_CACHE", str(tmp_path))

    @jit.jit
    def twice(x):
        return 2 * x

    def interrupted(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as user:
        user.setattr(twice._compiler, "compile", interrupted)
        with pytest.raises(KeyboardInterrupt):
            twice(21)
    monkeypatch.setattr(jit.time, "sleep", lambda pause: pytest.fail("it waits"))
    assert twice(21) == 42


@pytest.mark.skipif(jit.fcntl is None, reason="no such locks on this system")
def test_who_is_tired_of_waiting_leaves_no_open_file(tmp_path, monkeypatch):
    asked, flock = [], jit.fcntl.flock

    def ask(file, how):
        asked.append(file)
        flock(file, how)

    def interrupted(pause):
        raise KeyboardInterrupt

    lock = jit._wait_for_others(tmp_path, "a version")
    monkeypatch.setattr(jit.fcntl, "flock", ask)
    monkeypatch.setattr(jit.time, "sleep", interrupted)
    with pytest.raises(KeyboardInterrupt):
        jit._wait_for_others(tmp_path, "a version")
    assert [file.closed for file in asked] == [True]
    jit._release(lock)


@pytest.mark.skipif(jit.fcntl is None, reason="no such locks on this system")
def test_two_who_finish_at_once_both_keep_what_they_made(tmp_path, monkeypatch):
    monkeypatch.setenv("SPH_GYM_CACHE", str(tmp_path))

    @jit.jit
    def twice(x):
        return 2 * x

    file = twice._cache._cache_file
    other = threading.Thread(target=file.save, args=("of another", "code of another"))
    load = file._load_index

    def slowly():
        found = load()
        if threading.current_thread() is not other:
            other.start()
            # long enough for the other one to have written, unless it has to wait
            other.join(0.3)
        return found

    monkeypatch.setattr(file, "_load_index", slowly)
    file.save("of one", "code of one")
    other.join()
    monkeypatch.undo()
    assert file.load("of one") == "code of one"
    assert file.load("of another") == "code of another"


@pytest.mark.skipif(jit.fcntl is None, reason="no such locks on this system")
@pytest.mark.parametrize("announcing", [False, True])
def test_a_wait_for_another_process_is_announced(tmp_path, monkeypatch, capsys, announcing):
    monkeypatch.setenv("SPH_GYM_CACHE", str(tmp_path))
    monkeypatch.setattr(jit, "_announcing", announcing)

    @jit.jit
    def advance(x):
        return 2 * x

    # what the other one holds, until it is waited for
    wait, held = jit._wait_for_others, []

    def wait_twice(*arguments):
        held.append(wait(*arguments))
        return wait(*arguments)

    monkeypatch.setattr(jit, "_wait_for_others", wait_twice)
    monkeypatch.setattr(jit.time, "sleep", lambda pause: jit._release(held.pop()))
    assert advance(21) == 42
    shown = capsys.readouterr().err.splitlines()
    assert [line.partition(" ")[0] for line in shown] == ["another", "compiling"] * announcing
