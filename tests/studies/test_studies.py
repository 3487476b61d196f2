from sph_gym.studies import startup


def test_startup_measures_a_process(tmp_path):
    seconds = startup._seconds("sph_gym/Relaxation-v1", str(tmp_path))
    assert seconds > 0
    assert (tmp_path / "jit").exists()
