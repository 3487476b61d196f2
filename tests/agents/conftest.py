import importlib

import pytest


@pytest.fixture
def jobs_here():
    """A `run_jobs` without processes, and the list of what the jobs that it has run were given."""
    run = []

    def run_jobs(function, jobs, keys, results, title, backend):
        done = []
        for job, key in zip(jobs, keys, strict=True):
            kept = results.load(key)
            if kept is None:
                run.extend(job)
                kept = results.save(key, function(*job))
            done.append(kept)
        return done

    return run_jobs, run


@pytest.fixture
def shipped_here(tmp_path, monkeypatch):
    """The folder of the package's networks, which is an empty one here."""
    folder = tmp_path / "shipped"
    for name in ("agents.cards", "sph_gym.controllers.shipped", "sph_gym.controllers.network"):
        monkeypatch.setattr(importlib.import_module(name), "SHIPPED", folder)
    return folder
