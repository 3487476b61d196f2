import multiprocessing
import os
import pickle
import signal
import time

import pytest

from sph_gym.studies import jobs
from sph_gym.studies.backends import ATTEMPTS, Backend
from sph_gym.studies.results import Results

ONE = Backend(workers=1)


def square(x, folder):
    """A job that leaves a trace of having run."""
    (folder / f"ran_{x}").touch()
    if x == 13:
        raise RuntimeError("unlucky")
    if x == 14:
        raise KeyboardInterrupt
    return {"square": x * x, "third": x / 3}


def run_here(function, jobs, keys, results, title, backend):
    """`run_jobs` in this process, of what a worker would get."""
    sent = pickle.loads(pickle.dumps((function, jobs)))
    return [
        results.get(key, lambda job=job: sent[0](*job))
        for key, job in zip(keys, sent[1], strict=True)
    ]


def fragile(x, folder):
    """A job whose worker is killed, as often as there are files."""
    for file in folder.glob(f"kill_{x}_*"):
        file.unlink()
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


@pytest.fixture
def run(tmp_path):
    """Runs the jobs one by one; returns their results, and the jobs that were not kept."""

    def run(*numbers, backend=ONE):
        for file in tmp_path.glob("ran_*"):
            file.unlink()
        results = Results(tmp_path / "kept")
        given = [(x, tmp_path) for x in numbers]
        found = jobs.run_jobs(square, given, numbers, results, "test", backend)
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


def test_a_worker_that_is_killed_loses_its_own_job_only_which_runs_again(tmp_path):
    (tmp_path / "kill_1_once").touch()
    results = Results(tmp_path / "kept")
    given = [(x, tmp_path) for x in range(3)]
    ids = jobs.run_jobs(fragile, given, range(3), results, "test", ONE)
    assert ids[0] != ids[1] == ids[2]


# starts four processes
@pytest.mark.slow
def test_a_job_that_kills_every_worker_is_given_up(tmp_path):
    for k in range(ATTEMPTS):
        (tmp_path / f"kill_1_{k}").touch()
    results = Results(tmp_path / "kept")
    with pytest.raises(RuntimeError, match=f"ended {ATTEMPTS} workers"):
        jobs.run_jobs(fragile, [(0, tmp_path), (1, tmp_path)], (0, 1), results, "test", ONE)
    assert results.load(0) is not None


def driver(folder):
    """A driver whose second job takes for ever."""
    given = [(0, folder), (1, folder)]
    jobs.run_jobs(endless, given, (0, 1), Results(folder / "kept"), "test", ONE)


def endless(x, folder):
    """A job that tells who does it, and doesn't end the second time."""
    if x:
        (folder / "draft").write_text(str(os.getpid()))
        (folder / "draft").rename(folder / "worker")
        time.sleep(600)
    return x


def test_a_driver_that_is_killed_loses_what_is_in_hand_and_leaves_no_worker(tmp_path):
    process = multiprocessing.get_context("spawn").Process(target=driver, args=(tmp_path,))
    process.start()
    wait_for((tmp_path / "worker").exists)
    process.kill()
    process.join()
    assert Results(tmp_path / "kept").load(0) == 0
    worker = int((tmp_path / "worker").read_text())
    wait_for(lambda: not is_alive(worker))


def is_alive(process_id):
    try:
        os.kill(process_id, 0)
    except ProcessLookupError:
        return False
    # one that nobody waits for is a zombie
    with open(f"/proc/{process_id}/stat") as file:
        return file.read().rsplit(")", 1)[1].split()[0] != "Z"


def wait_for(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


@pytest.mark.parametrize(
    ("backend", "message"),
    [
        (Backend("slurm"), "backend: expected one of local, ray, dask, got 'slurm'"),
        (Backend(address="auto"), "address: expected none with the backend 'local'"),
        (Backend(workers=0), "workers"),
        (Backend("ray", "auto", 2), "workers: a cluster with an address has workers"),
    ],
)
def test_wrong_backends_are_refused(backend, message, run):
    with pytest.raises(ValueError, match=message):
        run(1, backend=backend)
