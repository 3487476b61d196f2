"""Settings of the whole suite."""

from hypothesis import settings

# Files that take minutes before anything is compiled: begun last, one would keep everybody waiting.
SLOW = ("test_stability.py", "test_without_jit.py", "test_paths.py", "test_forces.py")

settings.register_profile("suite", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("suite")


def pytest_configure(config):
    config.addinivalue_line("markers", "slow: minutes of work, left to `make test-all`")
    config.addinivalue_line("markers", "without_jit: runs a second time with NUMBA_DISABLE_JIT=1")


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: item.path.name not in SLOW)
