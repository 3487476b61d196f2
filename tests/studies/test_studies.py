import csv

import pytest

from sph_gym.__main__ import main
from sph_gym.studies import startup, validation
from sph_gym.studies.table import Row, show


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


def test_a_study_fails_aloud(tmp_path, monkeypatch, capsys):
    rows = [Row("speed", "a", 1.0, "m/s", 2.0), Row("speed", "b", 3.0, "m/s", 2.0)]
    monkeypatch.setattr("sph_gym.studies._STUDIES", {"validation": lambda quick: rows})
    assert main(["study", "validation", "--output", str(tmp_path)]) == 1
    assert "FAILS" in capsys.readouterr().out
    with (tmp_path / "validation.csv").open() as file:
        assert [line["holds"] for line in csv.DictReader(file)] == ["True", "False"]


def test_a_value_that_is_no_number_does_not_hold():
    assert not Row("x", "a", float("nan"), "m", 1.0).holds


def test_startup_measures_a_process(tmp_path):
    seconds = startup._seconds("sph_gym/Relaxation-v0", str(tmp_path))
    assert seconds > 0
    assert (tmp_path / "jit").exists()


def test_show_writes_all_columns(tmp_path):
    show("t", [Row("q", "c", 1.0, "m", 2.0)], tmp_path / "deep" / "t.csv")
    assert "quantity,case,value,unit,bound,holds" in (tmp_path / "deep" / "t.csv").read_text()
