import pytest

from sph_gym.recommend.tables import write
from tests.recommend.made_up import samples


@pytest.fixture
def table(tmp_path):
    """Two lines: one that takes a third of the other's time."""
    path = tmp_path / "lines.csv"
    write([*samples(), *samples(1 / 3, dtype="float32")], path, "made up")
    return path
