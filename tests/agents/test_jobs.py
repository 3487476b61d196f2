from pathlib import Path

import pandas as pd
import pytest

import sph_gym
from agents import evaluate, jobs, policies


def square(x, folder):
    """A job that leaves a trace of having run."""
    (folder / f"ran_{x}").touch()
    if x == 13:
        raise RuntimeError("unlucky")
    return {"square": x * x, "third": x / 3}


def run(numbers, folder, path):
    keys = [{"x": x} for x in numbers]
    return jobs.run_jobs(square, [(x, folder) for x in numbers], keys, path, "test", workers=1)


def ran(folder):
    return sorted(int(file.name[4:]) for file in folder.glob("ran_*"))


def clear(folder):
    for file in folder.glob("ran_*"):
        file.unlink()


def test_rows_come_in_the_order_of_the_jobs_and_finished_ones_are_kept(tmp_path):
    path = tmp_path / "deep" / "rows.csv"
    first = run([3, 1, 2], tmp_path, path)
    assert list(first["square"]) == [9, 1, 4]
    clear(tmp_path)
    again = run([3, 1, 2, 4], tmp_path, path)
    assert ran(tmp_path) == [4]
    assert list(again["third"]) == [1.0, 1 / 3, 2 / 3, 4 / 3]
    assert len(pd.read_csv(path)) == 4


def test_a_failure_keeps_what_is_done(tmp_path):
    path = tmp_path / "rows.csv"
    with pytest.raises(RuntimeError, match="unlucky"):
        run([1, 13], tmp_path, path)
    clear(tmp_path)
    run([1, 2], tmp_path, path)
    assert ran(tmp_path) == [2]


def test_a_torn_line_and_rows_of_other_code_are_run_again(tmp_path, monkeypatch):
    path = tmp_path / "rows.csv"
    run([1, 2], tmp_path, path)
    path.write_text(path.read_text()[:-8])
    clear(tmp_path)
    run([1, 2], tmp_path, path)
    assert ran(tmp_path) == [2]
    clear(tmp_path)
    monkeypatch.setattr(jobs, "code_version", lambda: "other")
    run([1, 2], tmp_path, path)
    assert ran(tmp_path) == [1, 2]


@pytest.mark.parametrize("content", ["", "\x00\x01", "a,b\n1,2\n"])
def test_a_foreign_file_is_replaced(tmp_path, content):
    path = tmp_path / "rows.csv"
    path.write_text(content)
    assert list(run([2], tmp_path, path)["square"]) == [4]


def test_rows_depend_on_the_package_its_manifests_and_the_agents():
    package = Path(sph_gym.__file__).parent
    needed = [
        package / "env" / "rewards.py",
        package / "env" / "manifests" / "dam_break.json",
        package / "env" / "manifests" / "dam_break.npz",
        Path(policies.__file__),
        Path(evaluate.__file__),
    ]
    assert set(needed) <= set(jobs.sources())


def test_a_change_of_any_source_runs_all_again(tmp_path, monkeypatch):
    path, source = tmp_path / "rows.csv", tmp_path / "dam_break.json"
    source.write_text("as it was")
    monkeypatch.setattr(jobs, "sources", lambda: [source])
    try:
        jobs.code_version.cache_clear()
        run([1], tmp_path, path)
        clear(tmp_path)
        source.write_text("as it is")
        jobs.code_version.cache_clear()
        run([1], tmp_path, path)
    finally:
        jobs.code_version.cache_clear()
    assert ran(tmp_path) == [1]
