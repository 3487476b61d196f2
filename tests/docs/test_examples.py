"""The examples of the gallery run as they stand there."""

import runpy

import matplotlib.pyplot as plt
import pytest
from site_pages import EXAMPLES

from tests.docs.conftest import DOCS

# Its second scene is compiled for nothing else.
SLOW = ("effect.py",)


@pytest.fixture(autouse=True)
def without_a_screen(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plt.switch_backend("agg")
    yield
    plt.close("all")


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "name", [pytest.param(e, marks=pytest.mark.slow if e in SLOW else ()) for e in EXAMPLES]
)
def test_every_example_runs_and_draws(name, capsys):
    runpy.run_path(str(DOCS / "examples" / name), run_name="__main__")
    assert plt.get_fignums()
    assert all(plt.figure(k).axes for k in plt.get_fignums())
    assert "nan" not in capsys.readouterr().out


def test_every_example_has_its_place():
    assert {path.name for path in DOCS.glob("examples/*.py")} == set(EXAMPLES)
