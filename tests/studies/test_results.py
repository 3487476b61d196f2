"""The store of finished runs: a result is complete or absent, and never in the way."""

import errno
import json

import pytest

from sph_gym import files
from sph_gym.studies import results
from sph_gym.studies.results import Results


@pytest.fixture
def store(tmp_path):
    return Results(tmp_path / "deep", "studies/results.py")


def test_a_result_is_computed_once(store):
    assert store.get("key", lambda: (1, [2.5])) == [1, [2.5]]
    assert store.get("key", lambda: pytest.fail("computed twice")) == [1, [2.5]]
    assert json.loads(store.path("key").read_text())["key"] == "key"
    assert list(store.folder.iterdir()) == [store.path("key")]


@pytest.mark.parametrize("content", [b"", b'{"result": [1, ', b"[1]", b'{"key": 1}', b"\xff\xfe"])
def test_a_damaged_result_is_computed_again_with_a_warning(store, content):
    store.folder.mkdir()
    store.path("key").write_bytes(content)
    with pytest.warns(UserWarning, match="computed again"):
        assert store.get("key", lambda: 7) == 7
    assert store.get("key", lambda: pytest.fail("computed twice")) == 7


def test_a_result_of_another_key_or_shape_is_computed_again(store):
    store.save("another", 1)
    store.path("another").rename(store.path("key"))
    with pytest.warns(UserWarning, match="no result of key"):
        assert store.get("key", lambda: 2) == 2
    with pytest.warns(UserWarning, match="computed again"):
        assert store.get("key", lambda: [3], tuple) == (3,)


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    Results(tmp_path / "new").check_writable()
    assert list((tmp_path / "new").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=r"can't be written to.*file"):
        Results(tmp_path / "file").check_writable()
    with pytest.raises(OSError, match=r"can't be written.*\.json"):
        Results(tmp_path / "file").save("key", 1)


def test_a_full_disk_is_named_and_nothing_half_is_left(store, monkeypatch):
    def full(draft, kept):
        assert draft.stat().st_size > 0
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files.os, "replace", full)
    with pytest.raises(OSError, match=r"can't be written: No space left.*\.json"):
        store.save("key", 1)
    assert list(store.folder.iterdir()) == []


def test_a_path_depends_on_key_sources_and_compiler(tmp_path, monkeypatch):
    def path(*sources, key=1):
        return Results(tmp_path, *sources).path(key)

    paths = {path(), path(key=2), path("studies/results.py")}
    with monkeypatch.context() as patch:
        patch.setattr(results, "source_hash", lambda *places: "edited")
        paths.add(path())
    with monkeypatch.context() as patch:
        patch.setattr(results.jit, "source_hash", lambda: "another compiler")
        paths.add(path())
    assert len(paths) == 5
    assert path() in paths
