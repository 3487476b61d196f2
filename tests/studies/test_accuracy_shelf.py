"""The folder of the study: shared by processes, damaged, full; and what a record says."""

import errno
import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from sph_gym import files
from sph_gym.__main__ import main
from sph_gym.studies import accuracy, store
from sph_gym.studies.accuracy import peer, points, policies, problems, rerun, shelf
from sph_gym.studies.accuracy.running import execute
from sph_gym.studies.accuracy.settings import nominal
from sph_gym.studies.peers import Peers

ROOT = Path(__file__).parents[2]
DROP = replace(problems.problem("elliptical_drop"), sizes=(6, 8, 10), nominal=8)
# A small point again and again, each time with times of its own, or all of it.
SHARING = """
import sys
from dataclasses import replace
from pathlib import Path
from sph_gym.studies.accuracy import points, problems
from sph_gym.studies.accuracy.settings import nominal
drop = replace(problems.problem("elliptical_drop"), sizes=(6, 8, 10), nominal=8)
points.rate, points.PATIENCE = lambda: 1e6, 0.0
once = points.execute(drop, nominal(drop, 6))
points.execute = lambda *arguments: once
folder = Path(sys.argv[1])
for k in range(150):
    found = points.point(drop, "nominal", nominal(drop, 6), folder, 3, again=True)
    if k % 5 == 0:
        for path in folder.glob("points/*.json"):
            path.unlink(missing_ok=True)
assert found.runs == 3 and not found.differing
print(found.error)
"""


@pytest.fixture(autouse=True)
def steady_clock(monkeypatch):
    """A benchmark that takes no time."""
    monkeypatch.setattr(points, "rate", lambda: 1e6)
    monkeypatch.setattr(points, "PATIENCE", 0.0)
    monkeypatch.setattr(points, "AGREED", math.inf)


def buy(folder, **changes):
    return points.point(DROP, "nominal", nominal(DROP)._replace(**changes), folder, repeats=2)


def test_two_processes_share_a_folder(tmp_path):
    both = [
        subprocess.Popen(
            [sys.executable, "-W", "error", "-c", SHARING, str(tmp_path)],
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    one, other = (process.communicate(timeout=300)[0] for process in both)
    assert [process.returncode for process in both] == [0, 0]
    assert one == other
    assert not list(tmp_path.rglob("*.tmp"))


@pytest.mark.parametrize("place", ["points", "times"])
def test_what_is_damaged_is_made_anew_with_a_warning(tmp_path, place, monkeypatch):
    monkeypatch.setattr(points, "execute", lambda *a: once)
    once = execute(DROP, nominal(DROP))
    first = buy(tmp_path)
    [path] = (tmp_path / place).iterdir()
    whole = path.read_text()
    swapped = whole.replace('"particles"', '"parts"').replace('"own"', '"mine"')
    for bad in ("", whole[:50], "[]", "{}", swapped):
        path.write_text(bad)
        with pytest.warns(UserWarning, match=f"{path.name}.* made anew"):
            assert buy(tmp_path) == first
        assert path.read_text() == whole
    path.write_bytes(b"\xff\xfe")
    with pytest.warns(UserWarning, match=path.name):
        assert buy(tmp_path) == first


@pytest.mark.parametrize("bad", ["", "[]", '{"controls": [[1.0, 2.0]]}', '{"controls": 3}'])
def test_a_damaged_schedule_is_made_anew(tmp_path, monkeypatch, bad):
    dt = DROP.build(8).duration / 100
    monkeypatch.setattr(policies, "schedule", lambda name, scene: [[dt / 100, 1e7, 0.0]])
    monkeypatch.setattr(points, "execute", lambda *a: once)
    once = execute(DROP, nominal(DROP))
    first = buy(tmp_path, controller="ppo")
    [path] = (tmp_path / "schedules").iterdir()
    whole = path.read_text()
    path.write_text(bad)
    with pytest.warns(UserWarning, match=f"{path.name}.* made anew"):
        assert buy(tmp_path, controller="ppo") == first
    assert path.read_text() == whole


def test_a_kept_point_is_read_however_it_was_written(tmp_path, monkeypatch):
    first = buy(tmp_path)
    for path in tmp_path.rglob("*.json"):
        path.write_text(json.dumps(json.loads(path.read_text()), indent=1))
    monkeypatch.setattr(points, "execute", lambda *a: pytest.fail("run again"))
    assert buy(tmp_path) == first


def test_a_full_disk_is_told_of_with_the_file(tmp_path, monkeypatch):
    def full(draft, kept):
        assert draft.stat().st_size > 0
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(files.os, "replace", full)
    with pytest.raises(OSError, match=r"can't be written: No space left.*points.*json"):
        buy(tmp_path)
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_folder_that_cannot_be_written_to_is_told_of_before_work_starts(
    tmp_path, monkeypatch, capsys
):
    def full(path, stored):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(store, "write", full)
    monkeypatch.setattr(accuracy.study, "point", lambda *a: pytest.fail("work has begun"))
    assert main(["study", "accuracy", "--quick", "--output", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("sph_gym: ")
    assert str(tmp_path / "accuracy") in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize("bad", ["", "[]", "{}", '{"seconds": 1.0, "own": 1.0}'])
def test_a_damaged_run_of_the_peer_is_made_anew(tmp_path, monkeypatch, bad):
    (tmp_path / peer.SCRIPT).write_text("")
    seen = {
        "seconds": 2.0, "own": 1.0, "dx": 0.1, "radius": 1.0, "particles": 314, "time": 0.005,
        "tip": 1.5,
    }  # fmt: skip
    monkeypatch.setattr(peer, "_call", lambda *a: seen)
    first = peer.run(Peers(tmp_path), "elliptical_drop", 20, tmp_path / "kept")
    [path] = (tmp_path / "kept" / "peer").iterdir()
    path.write_text(bad)
    with pytest.warns(UserWarning, match=f"{path.name}.* made anew"):
        assert peer.run(Peers(tmp_path), "elliptical_drop", 20, tmp_path / "kept") == first
    assert json.loads(path.read_text()) == seen


def test_a_record_knows_the_version_and_the_commit_which_are_no_part_of_its_key(tmp_path):
    found = buy(tmp_path)
    kept = json.loads((tmp_path / "points" / f"{found.key}.json").read_text())
    assert kept["versions"]["sph_gym"]
    if (ROOT / ".git").exists():
        assert len(kept["versions"]["commit"].removesuffix("-dirty")) == 40
    facts = shelf.manifest(DROP, nominal(DROP), False)
    assert shelf.key_of(facts | {"versions": {}}) == found.key


def test_one_point_is_run_again(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(rerun, "rate", lambda: 1e6)
    real, first = rerun.execute, []

    def steady(*arguments):
        first.append(real(*arguments))
        return first[-1]._replace(own=found.own)

    monkeypatch.setattr(rerun, "execute", steady)
    drop = problems.problem("elliptical_drop")
    setting = nominal(drop, 6)
    found = points.point(drop, "nominal", setting, tmp_path / "accuracy", repeats=1)
    command = ["study", "accuracy", "--output", str(tmp_path), "--point"]
    assert main([*command, found.key[:6]]) == 0
    printed = capsys.readouterr().out
    assert f"error kept: {found.error!r}, now: {found.error!r}" in printed
    assert "now / kept: " in printed
    path = tmp_path / "accuracy" / "points" / f"{found.key}.json"
    kept = json.loads(path.read_text())
    kept["outcome"]["error"] *= 1 + 3e-16
    path.write_text(json.dumps(kept))
    assert main([*command, found.key]) == 1
    assert "the errors differ" in capsys.readouterr().out
    path.write_text(json.dumps({**kept, "outcome": {**kept["outcome"], "error": found.error}}))
    times = tmp_path / "accuracy" / "times" / path.name
    taken = json.loads(times.read_text())
    times.write_text(json.dumps(taken | {"own": [9 * own for own in taken["own"]]}))
    assert main([*command, found.key]) == 1
    assert "beyond a factor 1.5" in capsys.readouterr().out
    assert main([*command, "../x"]) == 2
    assert main([*command, "0" * 20]) == 2
    assert main(["study", "effects", "--point", "0"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 3
