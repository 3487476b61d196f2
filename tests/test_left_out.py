"""The list of what `make test` leaves out names tests that exist."""

from pathlib import Path

import pytest

from tests.left_out import LEFT_OUT


@pytest.mark.parametrize("beginning", LEFT_OUT)
def test_it_is_there(beginning):
    path, _, name = beginning.partition("::")
    assert f"def {name.partition('[')[0]}" in Path(path).read_text()
