import pytest

from agents import jobs
from sph_gym.studies.results import Results


def square(x, folder):
    """A job that leaves a trace of having run."""
    (folder / f"ran_{x}").touch()
    if x == 13:
        raise RuntimeError("unlucky")
    if x == 14:
        raise KeyboardInterrupt
    return {"square": x * x, "third": x / 3}


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Runs the jobs one by one; returns their results, and the jobs that were not kept."""
    monkeypatch.setattr(jobs, "most_threads", lambda: 1)

    def run(*numbers):
        for file in tmp_path.glob("ran_*"):
            file.unlink()
        results = Results(tmp_path / "kept")
        found = jobs.run_jobs(square, [(x, tmp_path) for x in numbers], numbers, results, "test")
        return found, sorted(int(file.name[4:]) for file in tmp_path.glob("ran_*"))

    return run


def test_results_come_in_the_order_of_the_jobs_and_finished_ones_are_kept(run):
    first, ran = run(3, 1, 2)
    assert [row["square"] for row in first] == [9, 1, 4]
    assert ran == [1, 2, 3]
    again, ran = run(3, 1, 2, 4)
    assert [row["third"] for row in again] == [1.0, 1 / 3, 2 / 3, 4 / 3]
    assert ran == [4]


def test_a_failure_keeps_what_is_done(run):
    with pytest.raises(RuntimeError, match="unlucky"):
        run(1, 13)
    assert run(1, 2)[1] == [2]


def test_an_interruption_keeps_what_is_done_and_exits(run, capsys):
    with pytest.raises(SystemExit) as exit_:
        run(1, 14)
    assert exit_.value.code == jobs.INTERRUPTED
    assert "what is done is kept in" in capsys.readouterr().err
    assert run(1, 2)[1] == [2]


def test_a_torn_result_is_computed_again(run, tmp_path):
    run(1, 2)
    path = Results(tmp_path / "kept").path(2)
    path.write_text(path.read_text()[:-8])
    with pytest.warns(UserWarning, match="can't be read"):
        assert run(1, 2)[1] == [2]
