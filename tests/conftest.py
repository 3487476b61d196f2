"""Settings of the whole suite."""

from hypothesis import settings

settings.register_profile("suite", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("suite")


def pytest_configure(config):
    config.addinivalue_line("markers", "without_jit: runs a second time with NUMBA_DISABLE_JIT=1")
