import pytest

from sph_gym.studies import startup, validation


@pytest.mark.parametrize(
    "measure",
    [lambda: validation.dam_break(0.02), validation.hydrostatic_tank, validation.relaxation],
    ids=["dam_break", "hydrostatic_tank", "relaxation"],
)
def test_the_physics_holds(measure):
    for row in measure():
        assert row.holds, row


def test_finer_dam_breaks_hold_too():
    for row in validation.dam_break(0.0125):
        assert row.holds, row


def test_startup_measures_a_process(tmp_path):
    seconds = startup._seconds("sph_gym/Relaxation-v0", str(tmp_path))
    assert seconds > 0
    assert (tmp_path / "jit").exists()
