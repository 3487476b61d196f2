"""The list of what `make test` leaves out names tests that exist."""

from pathlib import Path

import pytest

from tests.left_out import LEFT_OUT


@pytest.mark.parametrize("beginning", LEFT_OUT)
def test_it_is_there(beginning, collected):
    path = beginning.partition("::")[0]
    assert Path(path).exists()
    if not any(name.startswith(f"{path}::") for name in collected):
        pytest.skip("this file was not collected")
    assert any(name.startswith(beginning) for name in collected)
