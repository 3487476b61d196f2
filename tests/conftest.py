"""Settings of the whole suite, and its compile budget.

Each kind of scene needs a compiled version of the solver of its own, which takes about ten seconds
and memory that is never given back. The versions are counted over all workers and the number is
printed at the end; `make test` fails above the budget, so that it stays quick.
"""

import hashlib
import resource
import sys
from collections import Counter

import pytest
from hypothesis import settings

from sph_gym.solver import stepping

# The run that must stay within the budget: `make test`.
QUICK = "not slow"
# Compiled versions of the solver, and peak memory of each worker [GB].
MAX_VERSIONS = 80
MAX_MEMORY = 2.5

settings.register_profile("suite", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("suite")

# In a worker, by signature: the file whose tests were the first to need that version.
_versions: dict[str, str] = {}
# In the controller: one entry a worker.
_workers: list[dict] = []


def pytest_configure(config):
    config.addinivalue_line("markers", "slow: left out by `make test`, run by `make test-all`")
    config.addinivalue_line("markers", "without_jit: run once more with NUMBA_DISABLE_JIT=1")


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item):
    signatures = getattr(stepping.advance, "signatures", ())
    for signature in signatures[len(_versions) :]:
        key = hashlib.sha256(str(signature).encode()).hexdigest()
        _versions[key] = item.path.name


def _measure():
    """Return what this process has compiled or loaded, and its peak memory [GB]."""
    unit = 1 if sys.platform == "darwin" else 1024
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9
    stats = getattr(stepping.advance, "stats", None)
    compiled = 0 if stats is None else sum(stats.cache_misses.values())
    return {"versions": _versions, "compiled": compiled, "memory": memory}


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    _workers.append(node.workeroutput["solver"])


def pytest_sessionfinish(session):
    output = getattr(session.config, "workeroutput", None)
    if output is not None:
        output["solver"] = _measure()
        return
    if not _workers:
        _workers.append(_measure())
    if session.config.option.markexpr == QUICK and _over_budget() and session.exitstatus == 0:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _used():
    """Return the files that were the first to need each version, and the largest memory [GB]."""
    versions = {key: name for worker in _workers for key, name in worker["versions"].items()}
    return versions, max(worker["memory"] for worker in _workers)


def _over_budget():
    versions, memory = _used()
    return len(versions) > MAX_VERSIONS or memory > MAX_MEMORY


def pytest_terminal_summary(terminalreporter, config):
    versions, _ = _used()
    compiled = sum(worker["compiled"] for worker in _workers)
    memories = ", ".join(f"{worker['memory']:.2f} GB" for worker in _workers)
    terminalreporter.section("compile budget")
    terminalreporter.line(
        f"{len(versions)} versions of the solver ({compiled} compilations, the others were cached; "
        f"budget {MAX_VERSIONS}); peak memory of the workers: {memories} (limit {MAX_MEMORY} GB)"
    )
    if _over_budget():
        for name, count in Counter(versions.values()).most_common():
            terminalreporter.line(f"{count:4d} first needed by {name}")
        if config.option.markexpr == QUICK:
            terminalreporter.line("above the budget: share configurations (tests/cases.py)")
