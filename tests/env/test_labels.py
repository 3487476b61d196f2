import pytest

from sph_gym.env import SCENES, documentation, instances, labels

FOUND = [
    ("dam_break", 2.345678, "benchmark"),
    ("sloshing", 1.2, "benchmark, small headroom"),
    ("long_fall", None, "benchmark, unknown headroom"),
    ("relaxation", None, "diagnostic"),
]


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "deep" / "headroom.csv"
    labels.write(FOUND, path)
    return path


def test_what_is_written_is_read(table):
    assert labels.measured(table) == {
        scene: (gain if gain is None else pytest.approx(gain, rel=1e-3), label)
        for scene, gain, label in FOUND
    }
    assert labels.headroom("dam_break", table) == "2.35 times less work"
    assert labels.label("sloshing", table) == "benchmark, small headroom"


def test_what_was_not_measured_says_so(table, tmp_path):
    assert labels.headroom("drop_impact", table) == "not measured"
    assert labels.headroom("long_fall", table).startswith("unknown")
    assert labels.label("drop_impact", table) == "benchmark"
    none = tmp_path / "none.csv"
    assert {labels.headroom(scene, none) for scene in SCENES} == {"not measured"}
    assert [labels.label(scene, none) for scene in SCENES] == [*map(instances.label, SCENES)]


def test_the_code_says_what_is_a_benchmark(table):
    labels.write([("relaxation", 2.0, "benchmark")], table)
    assert labels.label("relaxation", table) == "diagnostic"


@pytest.mark.parametrize("content", ["scene\n1\n", "scene,headroom,label\na,much,b\n", "x"])
def test_a_damaged_table_says_so(tmp_path, content):
    path = tmp_path / "headroom.csv"
    path.write_text(content + "a,b\n")
    with pytest.raises(OSError, match=r"headroom\.csv is damaged"):
        labels.measured(path)


def test_the_shipped_table_fits_to_the_code():
    told = labels.measured()
    assert set(told) <= set(SCENES)
    assert all(found.label.startswith(instances.label(scene)) for scene, found in told.items())


def test_the_pages_show_it(table, monkeypatch):
    monkeypatch.setattr(
        labels, "measured", lambda path: {"sloshing": labels.Measured(1.2, FOUND[1][2])}
    )
    page = documentation.page("sph_gym/Sloshing-v0")
    assert "| benchmark, small headroom |" in page
    assert "| 1.20 times less work |" in page
    assert "| benchmark, small headroom |" in documentation.index()
