import csv
import json

import pytest

from sph_gym import studies
from sph_gym.__main__ import main
from sph_gym.studies import machine, validation
from sph_gym.studies.peers import Peers
from sph_gym.studies.table import Row, show


@pytest.mark.parametrize(
    ("value", "bound", "at_least", "holds", "demand"),
    [
        (1.0, 1.0, False, True, "at most 1"),
        (1.1, 1.0, False, False, "at most 1"),
        (2.5, 2.5, True, True, "at least 2.5"),
        (2.4, 2.5, True, False, "at least 2.5"),
        (9.9, None, False, True, ""),
        (float("nan"), 1.0, False, False, "at most 1"),
        (float("nan"), 1.0, True, False, "at least 1"),
        (float("nan"), None, False, False, ""),
    ],
)
def test_bounds(value, bound, at_least, holds, demand):
    row = Row("q", "c", value, "m", bound, at_least)
    assert row.holds is holds
    assert row.demand == demand
    assert ("FAILS" in row.verdict) is not holds


def test_show_writes_all_columns(tmp_path, capsys):
    show("t", [Row("q", "c", 1.0, "m", 2.0), Row("r", "c", 3.0, "s")], tmp_path / "deep" / "t.csv")
    with (tmp_path / "deep" / "t.csv").open() as file:
        first, second = csv.DictReader(file)
    assert first == {
        "quantity": "q", "case": "c", "value": "1.0", "unit": "m", "bound": "2.0",
        "at_least": "False", "holds": "True",
    }  # fmt: skip
    assert second["bound"] == ""
    assert "at most 2" in capsys.readouterr().out


def test_a_study_fails_aloud(tmp_path, monkeypatch, capsys):
    rows = [Row("speed", "a", 1.0, "m/s", 2.0), Row("speed", "b", 3.0, "m/s", 2.0)]
    monkeypatch.setattr(validation, "measure", lambda quick, folder: rows)
    assert main(["study", "validation", "--output", str(tmp_path)]) == 1
    assert "FAILS" in capsys.readouterr().out
    with (tmp_path / "validation.csv").open() as file:
        assert [line["holds"] for line in csv.DictReader(file)] == ["True", "False"]


def test_an_interrupted_study_keeps_its_rows(tmp_path, monkeypatch, capsys):
    def rows(quick, folder):
        yield Row("speed", "a", 1.0, "m/s")
        raise KeyboardInterrupt

    monkeypatch.setattr(validation, "measure", rows)
    assert main(["study", "validation", "--output", str(tmp_path)]) == 130
    assert "speed" in (tmp_path / "validation.csv").read_text()
    assert "speed" in capsys.readouterr().out


def test_the_machine_is_described(tmp_path, capsys):
    machine.write(tmp_path / "m.json")
    found = json.loads((tmp_path / "m.json").read_text())
    assert found == machine.describe()
    assert set(found) == {
        "processor", "cores", "vectors", "system", "python", "numba", "numpy",
    }  # fmt: skip
    assert all(found.values())
    assert found["processor"] in capsys.readouterr().out


def test_only_one_study_has_peers(tmp_path):
    with pytest.raises(ValueError, match="peers: only the studies throughput and accuracy"):
        studies.run_study("validation", folder=tmp_path, peers=Peers(tmp_path))


@pytest.mark.parametrize("words", [("--backend", "local"), ("--workers", "2")])
def test_a_backend_is_refused_by_studies_that_have_none(tmp_path, capsys, words):
    assert main(["study", "soak", "--output", str(tmp_path), *words]) == 2
    owners = "headroom, exploits, stability, accuracy and overhead"
    assert f"backend: only the studies {owners} have it, not soak" in capsys.readouterr().err


def test_peers_are_a_folder_with_the_script(tmp_path):
    with pytest.raises(ValueError, match=r"--peers: no .*taichi_bench\.py"):
        studies.run_study("throughput", folder=tmp_path, peers=Peers(tmp_path))
