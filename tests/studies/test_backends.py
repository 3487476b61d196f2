"""Ray on several nodes and Dask with a scheduler and workers, all on this machine."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pandas as pd
import pytest

from agents.evaluate import evaluate
from agents.policies import Spec
from sph_gym.studies import backends
from sph_gym.studies.backends import OBJECT_STORE, RAY_SETTINGS, Backend
from sph_gym.studies.jobs import run_jobs
from sph_gym.studies.results import Results
from tests.studies import test_accuracy, test_stability
from tests.studies.test_jobs import fragile, square

pytestmark = [
    pytest.mark.slow,
    # of the clusters themselves, when they come and go
    pytest.mark.filterwarnings("ignore"),
]


@contextmanager
def ray_cluster():
    """Yield a Ray cluster of two nodes with a processor each."""
    pytest.importorskip("ray")
    os.environ |= RAY_SETTINGS
    from ray.cluster_utils import Cluster

    node = {"num_cpus": 1, "object_store_memory": OBJECT_STORE, "include_dashboard": False}
    cluster = Cluster(initialize_head=True, head_node_args=node)
    try:
        del node["include_dashboard"]
        cluster.add_node(**node)
        yield Backend("ray", cluster.address)
    finally:
        cluster.shutdown()


@contextmanager
def dask_cluster(folder):
    """Yield a Dask scheduler with two workers, each a process that is started by its command."""
    pytest.importorskip("distributed")
    place = folder / "scheduler.json"
    common = ["--scheduler-file", str(place), "--no-dashboard"]
    scheduler = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", *common]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1", *common]
    worker += ["--local-directory", str(folder), "--memory-limit", "0"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    programs = [subprocess.Popen(words, **quiet) for words in (scheduler, worker, worker)]
    try:
        yield Backend("dask", str(place))
    finally:
        for program in reversed(programs):
            program.send_signal(signal.SIGTERM)
            program.wait(30)


@pytest.fixture(scope="module", params=["ray", "dask", "ray, started", "dask, started"])
def backend(request, tmp_path_factory):
    name, _, started = request.param.partition(", ")
    if started:
        pytest.importorskip({"ray": "ray", "dask": "distributed"}[name])
        yield Backend(name, workers=2)
        return
    with ray_cluster() if name == "ray" else dask_cluster(tmp_path_factory.mktemp("dask")) as found:
        yield found


def test_episodes_give_the_same_bytes_as_on_this_machine(backend, tmp_path):
    instances = ["relaxation/nominal/0"]
    specs = [Spec("tuned_cfl"), Spec("random")]
    tables = []
    for where in (Backend(workers=1), backend):
        path = tmp_path / where.name / "runs.csv"
        evaluate(specs, "relaxation", instances, path, where)
        tables.append(path.read_bytes())
    assert tables[0] == tables[1]
    assert len(pd.read_csv(path)) == len(specs)


def test_hard_cases_give_the_same_bytes_as_in_this_process(backend, tmp_path, monkeypatch):
    test_stability.check_backend(backend, tmp_path, monkeypatch)


def test_points_are_the_same_as_in_this_process(backend, tmp_path, monkeypatch):
    plan = test_accuracy.SMALL._replace(chain=False)
    test_accuracy.check_backend(backend, plan, tmp_path, monkeypatch)


def test_a_failure_keeps_what_is_done_and_says_what_it_was(backend, tmp_path):
    results = Results(tmp_path / "kept")
    with pytest.raises(RuntimeError, match="unlucky"):
        run_jobs(square, [(1, tmp_path), (13, tmp_path)], (1, 13), results, "test", backend)
    jobs = [(x, tmp_path) for x in (1, 2, 3)]
    found = run_jobs(square, jobs, (1, 2, 3), results, "test", backend)
    assert [row["square"] for row in found] == [1, 4, 9]


def test_a_worker_that_is_killed_loses_its_own_job_only_which_runs_again(backend, tmp_path):
    (tmp_path / "kill_1_once").touch()
    jobs = [(x, tmp_path) for x in range(4)]
    found = run_jobs(fragile, jobs, range(4), Results(tmp_path / "kept"), "test", backend)
    assert all(found)


def test_no_cluster_at_an_address_is_told(tmp_path):
    pytest.importorskip("distributed")
    nobody = Backend("dask", "tcp://127.0.0.1:9")
    with pytest.raises(OSError, match="127"):
        run_jobs(square, [(1, tmp_path)], [1], Results(tmp_path), "test", nobody)


def test_a_scheduler_file_that_nobody_writes_is_told(tmp_path, monkeypatch, capsys):
    pytest.importorskip("distributed")
    monkeypatch.setattr(backends, "PATIENCE", 0.3)
    nobody = Backend("dask", str(tmp_path / "schedular.json"))
    with pytest.raises(FileNotFoundError, match=r"address: expected a file .*schedular.json"):
        run_jobs(square, [(1, tmp_path)], [1], Results(tmp_path), "test", nobody)
    assert "waiting for the scheduler file" in capsys.readouterr().err


def test_what_waits_when_a_block_ends_is_dropped():
    pytest.importorskip("distributed")
    began = time.monotonic()
    with backends.open_pool(Backend("dask", workers=1), 1) as submit:
        waiting = [submit(time.sleep, 20) for _ in range(10)]
    assert time.monotonic() - began < 100 < 20 * len(waiting)
