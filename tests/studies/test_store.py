"""Finished runs on disk: whole or not at all, and never in the way."""

import errno
import json

import pytest

from sph_gym import files
from sph_gym.studies import episodes, store, validation


def test_what_was_computed_once_is_read(tmp_path):
    path = tmp_path / "deep" / "run.json"
    assert store.kept(path, "key", lambda: (1, [2.5])) == [1, [2.5]]
    assert store.kept(path, "key", lambda: pytest.fail("computed twice")) == [1, [2.5]]
    assert json.loads(path.read_text())["key"] == "key"
    assert [file.name for file in path.parent.iterdir()] == ["run.json"]


@pytest.mark.parametrize("content", [b"", b'{"result": [1, ', b"[1]", b'{"key": 1}', b"\xff\xfe"])
def test_what_is_damaged_is_computed_again_with_a_warning(tmp_path, content):
    path = tmp_path / "run.json"
    path.write_bytes(content)
    with pytest.warns(UserWarning, match="made anew"):
        assert store.kept(path, "key", lambda: 7) == 7
    assert store.kept(path, "key", lambda: pytest.fail("computed twice")) == 7


def test_a_run_of_another_key_or_shape_is_computed_again(tmp_path):
    path = tmp_path / "run.json"
    store.write(path, {"key": "another", "result": 1})
    with pytest.warns(UserWarning, match="no run of key"):
        assert store.kept(path, "key", lambda: 2) == 2
    with pytest.warns(UserWarning, match="made anew"):
        assert store.kept(path, "key", lambda: [3], lambda kept: kept == [3]) == [3]


def test_a_probe_names_the_folder(tmp_path):
    store.probe(tmp_path / "new")
    assert list((tmp_path / "new").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=r"can't be written to.*file"):
        store.probe(tmp_path / "file")


def test_a_full_disk_is_named_and_nothing_half_is_left(tmp_path, monkeypatch):
    path = tmp_path / "run.json"

    def full(draft, kept):
        assert draft.stat().st_size > 0
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files.os, "replace", full)
    with pytest.raises(OSError, match=r"can't be written: No space left.*run\.json"):
        store.write(path, {"result": 1})
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_way_of_the_folder_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=r"can't be written.*run\.json"):
        store.write(tmp_path / "file" / "run.json", {"result": 1})


def test_a_name_depends_on_the_key_and_on_the_sources(tmp_path):
    source = tmp_path / "own.py"
    source.write_text("a = 1")
    names = {store.name(1), store.name(2), store.name(1, source)}
    store._sources.cache_clear()
    source.write_text("a = 2")
    names.add(store.name(1, source))
    assert len(names) == 4


def test_studies_make_damaged_runs_anew(tmp_path):
    (tmp_path / "bad.json").write_text("{")
    with pytest.warns(UserWarning, match="made anew"):
        assert validation._read(tmp_path / "bad.json") is None
    assert episodes.kept(tmp_path, "key", lambda: 1) == 1
    [file] = [path for path in tmp_path.glob("*.json") if path.name != "bad.json"]
    file.write_text("torn")
    with pytest.warns(UserWarning, match="made anew"):
        assert episodes.kept(tmp_path, "key", lambda: 2) == 2
