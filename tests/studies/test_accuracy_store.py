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
from sph_gym.recommend.runs import execute
from sph_gym.recommend.settings import nominal
from sph_gym.scenes.shared.refinement import refinement
from sph_gym.studies.accuracy import points, pysph, study
from sph_gym.studies.accuracy.points import Sampling
from sph_gym.studies.peers import Peers

ROOT = Path(__file__).parents[2]
DROP = replace(refinement("elliptical_drop"), sizes=(6, 8, 10), nominal=8)
# A small point again and again, each time with times of its own, or all of it.
SHARING = """
import sys
from dataclasses import replace
from pathlib import Path
from sph_gym.recommend.settings import nominal
from sph_gym.scenes.shared.refinement import refinement
from sph_gym.studies.accuracy import points
drop = replace(refinement("elliptical_drop"), sizes=(6, 8, 10), nominal=8)
points.rate, points.PATIENCE = lambda: 1e6, 0.0
once = points.execute(drop, nominal(drop, 6))
points.execute = lambda *arguments: once
folder = Path(sys.argv[1])
for k in range(150):
    sampling = points.Sampling(folder, 3, again=True)
    found = points.measure_point(drop, "nominal", nominal(drop, 6), sampling)
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


def measure(folder, **changes):
    setting = nominal(DROP)._replace(**changes)
    return points.measure_point(DROP, "nominal", setting, Sampling(folder, 2))


@pytest.mark.slow
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


def test_a_damaged_point_is_run_again_with_a_warning(tmp_path, monkeypatch):
    monkeypatch.setattr(points, "execute", lambda *a: once)
    once = execute(DROP, nominal(DROP))
    first = measure(tmp_path)
    [path] = (tmp_path / "points").iterdir()
    whole = path.read_text()
    swapped = [whole.replace(f'"{name}"', '"other"') for name in ("particles", "times", "cause")]
    for bad in ("", whole[:50], "[]", "{}", *swapped):
        path.write_text(bad)
        with pytest.warns(UserWarning, match=f"{path.name}.* computed again"):
            assert measure(tmp_path) == first
        assert path.read_text() == whole
    path.write_bytes(b"\xff\xfe")
    with pytest.warns(UserWarning, match=path.name):
        assert measure(tmp_path) == first


@pytest.mark.parametrize("bad", ["", "[]", "[[1.0, 2.0]]", "3"])
def test_a_damaged_schedule_is_made_again(tmp_path, monkeypatch, bad):
    dt = DROP.build(8).duration / 100
    played = [[dt / 100, 1e7, 0.0]]
    monkeypatch.setattr(points, "play", lambda name, scene: played)
    monkeypatch.setattr(points, "execute", lambda *a: once)
    once = execute(DROP, nominal(DROP))
    first = measure(tmp_path, controller="ppo")
    [path] = (tmp_path / "schedules").iterdir()
    whole = path.read_text()
    # an empty list is that of an agent that blew up
    path.write_text(whole.replace(json.dumps(played), bad) if bad != "[]" else bad)
    with pytest.warns(UserWarning, match=f"{path.name}.* computed again"):
        assert measure(tmp_path, controller="ppo") == first
    assert path.read_text() == whole


def test_a_kept_point_is_read_however_it_was_written(tmp_path, monkeypatch):
    first = measure(tmp_path)
    for path in tmp_path.rglob("*.json"):
        path.write_text(json.dumps(json.loads(path.read_text()), indent=1))
    monkeypatch.setattr(points, "execute", lambda *a: pytest.fail("run again"))
    assert measure(tmp_path) == first


def test_a_full_disk_is_told_of_with_the_file(tmp_path, monkeypatch):
    def full(draft, kept):
        assert draft.stat().st_size > 0
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(files.os, "replace", full)
    with pytest.raises(OSError, match=r"can't be written: No space left.*points.*json"):
        measure(tmp_path)
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_folder_that_cannot_be_written_to_is_told_of_before_work_starts(
    tmp_path, monkeypatch, capsys
):
    (tmp_path / "accuracy").write_text("a file, no folder")
    monkeypatch.setattr(study, "measure_point", lambda *a: pytest.fail("work has begun"))
    assert main(["study", "accuracy", "--quick", "--output", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("sph_gym: ")
    assert str(tmp_path / "accuracy") in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize("bad", ["", "[]", "{}", '{"seconds": 1.0, "own": 1.0}'])
def test_a_damaged_run_of_the_peer_is_made_again(tmp_path, monkeypatch, bad):
    (tmp_path / pysph.SCRIPT).write_text("")
    seen = {
        "seconds": 2.0, "own": 1.0, "dx": 0.1, "radius": 1.0, "particles": 314, "time": 0.005,
        "tip": 1.5,
    }  # fmt: skip
    monkeypatch.setattr(pysph.racing, "run", lambda *a: seen)
    first = pysph.run(Peers(tmp_path), "elliptical_drop", 20, tmp_path / "kept")
    [path] = (tmp_path / "kept" / "peer").iterdir()
    whole = path.read_text()
    path.write_text(whole.replace(json.dumps(seen), bad))
    with pytest.warns(UserWarning, match=f"{path.name}.* computed again"):
        assert pysph.run(Peers(tmp_path), "elliptical_drop", 20, tmp_path / "kept") == first
    assert path.read_text() == whole


def test_a_record_knows_the_version_which_is_no_part_of_its_key(tmp_path):
    found = measure(tmp_path)
    path = tmp_path / "points" / f"{found.key}.json"
    kept = json.loads(path.read_text())
    assert kept["result"]["versions"]["sph_gym"]
    assert "versions" not in kept["key"]
    results = Sampling(tmp_path).results("points", nominal(DROP))
    assert results.path(points.key_of(DROP, nominal(DROP), 0)) == path


def test_one_point_is_run_again(tmp_path, capsys, monkeypatch):
    drop = refinement("elliptical_drop")
    once = execute(drop, nominal(drop, 6))
    monkeypatch.setattr(points, "execute", lambda *a: execute(*a)._replace(own=once.own))
    sampling = Sampling(tmp_path / "accuracy", 1)
    found = points.measure_point(drop, "nominal", nominal(drop, 6), sampling)
    command = ["study", "accuracy", "--output", str(tmp_path), "--point"]
    assert main([*command, found.key[:6]]) == 0
    printed = capsys.readouterr().out
    assert f"error kept: {found.error!r}, now: {found.error!r}" in printed
    assert "now / kept: " in printed
    path = tmp_path / "accuracy" / "points" / f"{found.key}.json"
    whole = path.read_text()
    kept = json.loads(whole)
    kept["result"]["outcome"]["error"] *= 1 + 3e-16
    path.write_text(json.dumps(kept))
    assert main([*command, found.key]) == 1
    assert "the errors differ" in capsys.readouterr().out
    kept = json.loads(whole)
    kept["result"]["times"] = [[wall, 9 * own, rate] for wall, own, rate in kept["result"]["times"]]
    path.write_text(json.dumps(kept))
    assert main([*command, found.key]) == 1
    assert "beyond a factor 1.5" in capsys.readouterr().out
    path.write_text("{}")
    assert main([*command, found.key]) == 2
    assert main([*command, "../x"]) == 2
    assert main([*command, "0" * 20]) == 2
    assert main(["study", "effects", "--point", "0"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 4
