import pytest

from sph_gym.studies import startup


# it compiles with an empty cache, as a first start does
@pytest.mark.slow
def test_startup_measures_a_process(tmp_path):
    seconds = startup._seconds("sph_gym/Relaxation-v1", str(tmp_path))
    assert seconds > 0
    assert (tmp_path / "jit").exists()
