import pytest


@pytest.fixture
def jobs_here():
    """A `run_jobs` without processes, and the list of the jobs that it has run."""
    run = []

    def run_jobs(function, jobs, keys, results, title, backend):
        done = []
        for job, key in zip(jobs, keys, strict=True):
            kept = results.load(key)
            if kept is None:
                run.append(job)
                kept = results.save(key, function(*job))
            done.append(kept)
        return done

    return run_jobs, run
