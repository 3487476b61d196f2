"""Settings of the whole suite, and its compile budget.

Each kind of scene needs a compiled version of the solver of its own, which takes about ten seconds
and memory that is never given back. The versions are counted over all workers and the number is
printed at the end; `make test` fails above the budget, so that it stays quick.
"""

import hashlib
import os
import re
import resource
import sys
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings
from numba.core import config as numba_config

from sph_gym.solver import stepping
from sph_gym.solver.teams import most_threads
from tests.left_out import LEFT_OUT

# The run that must stay within the budget: `make test`.
QUICK = "not slow"
# Compiled versions of the solver, and peak memory of each worker [GB].
MAX_VERSIONS = 36
MAX_MEMORY = 2.5

settings.register_profile("suite", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("suite")

# In a worker, by signature: the file whose tests were the first to need that version.
_versions: dict[str, str] = {}
# In a worker: the ids of all tests that were collected, also of those that are not run.
_collected: list[str] = []
# In a worker: what the next test is to report.
_faults: list[str] = []
# In the controller: one entry a worker.
_workers: list[dict] = []


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config):
    """Return the workers: more than processors, since some wait for what others compile.

    Where nothing is compiled, as many as processors that this process may use.
    """
    if not numba_config.DISABLE_JIT:
        return 2 * most_threads()
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark as slow what is left out, and put tests of one configuration side by side.

    Else two workers compile one version at once.
    """
    _collected[:] = [item.nodeid for item in items]
    cases: Counter[str] = Counter()
    for item in items:
        if item.nodeid.startswith(LEFT_OUT):
            item.add_marker(pytest.mark.slow)
        mark = item.get_closest_marker("every")
        if mark is not None and item.get_closest_marker("slow") is None:
            name = item.nodeid.partition("[")[0]
            if cases[name] % mark.args[0]:
                item.add_marker(pytest.mark.slow)
            cases[name] += 1
    items.sort(key=_configuration)


@pytest.fixture
def collected():
    """Return the ids of all tests that were collected, also of those that are not run."""
    return _collected


def _configuration(item):
    parameters = item.callspec.params if hasattr(item, "callspec") else {}
    if "configuration" not in parameters:
        return ()
    return str(parameters["configuration"]), str(parameters.get("dtype", "float64"))


def pytest_collection_finish():
    if getattr(stepping.advance, "signatures", ()):
        _faults.append("a simulation was run while tests were collected, and so in every worker")


def pytest_runtest_setup():
    if _faults:
        pytest.fail(_faults.pop(), pytrace=False)


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item):
    signatures = getattr(stepping.advance, "signatures", ())
    for signature in signatures[len(_versions) :]:
        key = hashlib.sha256(str(signature).encode()).hexdigest()
        _versions[key] = item.path.name


def _peak_memory():
    """Return the peak memory of this process [GB]."""
    status = Path("/proc/self/status")
    if status.exists():
        # what `getrusage` says begins with the memory of the process that started this one
        return int(re.search(r"VmHWM:\s*(\d+)", status.read_text())[1]) * 1024 / 1e9
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9


def _measure():
    """Return what this process has compiled or loaded, and its peak memory [GB]."""
    memory = _peak_memory()
    stats = getattr(stepping.advance, "stats", None)
    compiled = 0 if stats is None else sum(stats.cache_misses.values())
    return {"versions": _versions, "compiled": compiled, "memory": memory}


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    # a worker that has crashed has no output
    if "solver" in getattr(node, "workeroutput", {}):
        _workers.append(node.workeroutput["solver"])


def pytest_sessionfinish(session):
    output = getattr(session.config, "workeroutput", None)
    if output is not None:
        output["solver"] = _measure()
        return
    if not _workers:
        _workers.append(_measure())
    if _fails(session.config) and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _all_versions():
    """Return the versions of all workers, by signature the file that was the first to need it."""
    return {key: name for worker in _workers for key, name in worker["versions"].items()}


def _fails(config):
    """Return whether this is `make test` and needs more than the budget."""
    above = len(_all_versions()) > MAX_VERSIONS
    return config.option.markexpr == QUICK and (
        above or any(worker["memory"] > MAX_MEMORY for worker in _workers)
    )


def pytest_terminal_summary(terminalreporter, config):
    versions = _all_versions()
    if not versions:
        return
    compiled = sum(worker["compiled"] for worker in _workers)
    memories = ", ".join(f"{worker['memory']:.2f} GB" for worker in _workers)
    terminalreporter.section("compile budget")
    terminalreporter.line(
        f"{len(versions)} solver versions (at most {MAX_VERSIONS}) in {compiled} compilations; "
        f"peak memory of the workers: {memories} (at most {MAX_MEMORY} GB)"
    )
    if _fails(config):
        terminalreporter.line("FAILED: more than the budget. Share configurations: tests/cases.py")
        for name, count in Counter(versions.values()).most_common():
            terminalreporter.line(f"{count:4d} first needed by {name}")
