"""Kills, two processes at once, disks that are full or in the way, files that aren't ours."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from sph_gym.__main__ import main

ROOT = Path(__file__).parents[1]
STUDY = """
import sys
from pathlib import Path
from sph_gym.studies import stability
names = ("one particle", "two particles", "no neighbours at all", "a coincident row")
chosen = [case for case in stability.cases() if case.name in names]
for row in stability.catalogue(True, Path(sys.argv[1]), chosen):
    print(row)
"""
ALL = 4 * 3
TRAINING = """
import sys
from pathlib import Path
from agents import ppo, training
small = {"n_steps": 32, "batch_size": 32, "n_epochs": 1, "learning_rate": 1e-3}
environment = {"env": {"action_mode": "stable"}}
training.hyperparameters = lambda algorithm, scene, file: small | environment
arguments = training.TrainingArgs(
    scene="relaxation", steps=int(sys.argv[2]), n_envs=1, output=Path(sys.argv[1]),
    evaluate_every=32, n_evaluations=1, resume=sys.argv[3] == "resume", trust_checkpoints=True,
)
ppo.train(arguments)
"""


def begin(script, *arguments):
    """The script in another interpreter."""
    return subprocess.Popen(
        [sys.executable, "-c", script, *map(str, arguments)],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )


def listed(folder, pattern):
    """Return the files of a pattern, none if others vanish while they are looked for."""
    try:
        return list(folder.rglob(pattern))
    except FileNotFoundError:
        return []


def kill_after(process, folder, pattern, n):
    """Kill it, without mercy, as soon as there are n such files; their times of writing."""
    deadline = time.monotonic() + 240
    while len(listed(folder, pattern)) < n and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.005)
    process.kill()
    process.communicate()
    return {path: path.stat().st_mtime_ns for path in folder.rglob(pattern)}


def finished(process):
    """What it printed, after it has ended well."""
    text, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    return text


@pytest.mark.slow
def test_a_killed_study_loses_the_run_in_hand_only(tmp_path):
    done = kill_after(begin(STUDY, tmp_path), tmp_path, "*.json", 2)
    assert 2 <= len(done) < ALL
    for path in done:
        assert "result" in json.loads(path.read_text())
    finished(begin(STUDY, tmp_path))
    assert len(list(tmp_path.glob("*.json"))) == ALL
    assert {path: path.stat().st_mtime_ns for path in done} == done


@pytest.mark.slow
def test_two_processes_share_folder_and_caches(tmp_path):
    both = [begin(STUDY, tmp_path) for _ in range(2)]
    one, other = map(finished, both)
    assert one == other
    assert one.count("Row(") > 30
    assert len(list(tmp_path.iterdir())) == ALL


@pytest.mark.slow
def test_a_killed_training_goes_on_from_its_newest_checkpoint(tmp_path):
    pytest.importorskip("stable_baselines3")
    kept = kill_after(begin(TRAINING, tmp_path, 10**6, "anew"), tmp_path, "*_steps.zip", 2)
    assert len(kept) >= 2
    steps = max(int(path.stem.split("_")[1]) for path in kept)
    # a best that nobody beats: what is shipped stays what it was
    [log], [network] = tmp_path.rglob("validation.csv"), tmp_path.rglob("network.npz")
    past = pd.read_csv(log)
    past.loc[0, "return"] = 1e6
    past.to_csv(log, index=False)
    best = network.read_bytes()
    finished(begin(TRAINING, tmp_path, steps + 32, "resume"))
    assert network.read_bytes() == best
    assert len(pd.read_csv(log)) > len(past)
    newest = max(int(path.stem.split("_")[1]) for path in tmp_path.rglob("*_steps.zip"))
    assert steps < newest <= steps + 64


def test_a_folder_that_is_none_gives_one_clear_line(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["study", "stability", "--quick", "--output", str(tmp_path / "file")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("sph_gym: ")
    assert str(tmp_path / "file") in error


class Trap:
    """Unpickling it would leave a trace."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def test_a_foreign_reference_runs_no_code_and_is_made_anew(tmp_path, monkeypatch):
    from sph_gym import scenes
    from sph_gym.env import reference

    monkeypatch.setattr(reference, "cache_home", lambda: tmp_path)
    scene = scenes.make("relaxation", dx=0.1)
    path = tmp_path / "references" / f"{reference._key(scene)}.npz"
    path.parent.mkdir()
    trap = np.array([Trap(tmp_path / "trace")], dtype=object)
    np.savez(path, cfl_substeps=trap, **{f"{n}0": trap for n in reference.Observables._fields})
    assert reference._read(path) is None
    assert not (tmp_path / "trace").exists()
