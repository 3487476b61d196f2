"""Manifests: what the ids of instances mean, and their references, as data that is shipped.

Of every scene there are NAME.json, with what makes each flow and the fingerprint of the scene that
it made, and NAME.npz, with all references one after the other. `python -m sph_gym manifest` writes
them. On top of NAME.json stand the version of the ids, digests of flows and references, so that
none changes unseen, and a hash of the sources that computed the references.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.env.draws import Drawn

FOLDER = Path(__file__).parent / "manifests"
# Of the meaning of the ids; a change of any flow or reference is a new one. Manifests of another
# version are not read, and none of this version is written with other flows unless that is asked
# for.
VERSION = "v0"
DIGESTS = ("flows", "references")


class Entry(NamedTuple):
    """A flow; fingerprint: of the scene that it made when its reference was computed."""

    drawn: Drawn
    fingerprint: str


class Manifest(NamedTuple):
    """The flows of a scene by their ids, in the order of the references.

    version: of the ids; digests: of flows and references when they were written, empty if they
    weren't stamped; sources: hash of the sources that computed the references, empty if unknown.
    """

    path: Path
    entries: dict[str, Entry]
    version: str
    digests: dict[str, str]
    sources: str

    def arrays(self, id_: str) -> dict[str, NDArray[Any]]:
        """The reference of an instance: arrays by name, a row for every frame."""
        columns = _columns(self.path)
        k = list(self.entries).index(id_)
        begin, end = columns["offsets"][k : k + 2]
        rows = {name: column[begin:end] for name, column in columns.items() if name not in _WHOLE}
        return rows | {"cfl_substeps": columns["cfl_substeps"][k]}


_WHOLE = ("offsets", "cfl_substeps")


def entry(id_: str) -> Entry | None:
    """What the manifests say about an id; None if they don't."""
    found = load(id_.split("/")[0])
    return None if found is None else found.entries.get(id_)


@cache
def load(scene: str, folder: Path = FOLDER) -> Manifest | None:
    """The manifest of a scene; None if it has none.

    Raises OSError if it can't be read or is of another version.
    """
    path = folder / f"{scene}.json"
    if not path.is_file():
        return None
    try:
        data = json.loads(path.read_text())
        version, rows = data["version"], data["instances"]
        digests = {name: data[name] for name in DIGESTS if name in data}
        entries = {
            id_: Entry(Drawn(row["scene"], row["arguments"], row.get("viscosity")), row["hash"])
            for id_, row in rows.items()
        }
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise _damaged(path, error) from None
    if version != VERSION:
        raise OSError(
            f"{path} is of version {version!r}, expected {VERSION!r}: install sph_gym anew, or "
            "write it with `python -m sph_gym manifest`"
        )
    return Manifest(path, entries, version, digests, data.get("sources", ""))


@cache
def _columns(path: Path) -> dict[str, NDArray[Any]]:
    place = path.with_suffix(".npz")
    try:
        with place.open("rb") as file, np.load(file, allow_pickle=False) as data:
            return dict(data)
    except Exception as error:  # zipfile.BadZipFile and what else a torn file can raise
        raise _damaged(place, error) from None


def _damaged(path: Path, error: Exception) -> OSError:
    return OSError(
        f"{path} is damaged ({type(error).__name__}: {error}): install sph_gym anew, "
        "or write it with `python -m sph_gym manifest`"
    )


def write(
    scene: str,
    rows: Iterable[tuple[str, Entry, dict[str, Any]]],
    folder: Path = FOLDER,
    sources: str = "",
) -> None:
    """Write the manifest of a scene: id, flow and reference of every instance.

    sources: hash of the sources that computed the references.
    """
    flows, references = dict[str, Entry](), []
    for id_, flow, arrays in rows:
        flows[id_] = flow
        references.append(arrays)
    lengths = [len(arrays["kinetic"]) for arrays in references]
    columns: dict[str, Any] = {
        name: np.concatenate([arrays[name] for arrays in references]).astype(np.float32)
        for name in references[0]
        if name not in _WHOLE
    }
    columns["offsets"] = np.cumsum([0, *lengths])
    columns["cfl_substeps"] = np.array([arrays["cfl_substeps"] for arrays in references])
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(folder / f"{scene}.npz", **columns)
    _write_flows(folder / f"{scene}.json", flows, digests(flows, columns), sources)


def stamp(scene: str, folder: Path = FOLDER) -> Path | None:
    """Write the digests of a manifest anew, and nothing else; None if the scene has none."""
    found = load(scene, folder)
    if found is None:
        return None
    _write_flows(found.path, found.entries, current(found), found.sources)
    return found.path


def current(found: Manifest) -> dict[str, str]:
    """The digests that a manifest ought to have."""
    return digests(found.entries, _columns(found.path))


def digests(flows: Mapping[str, Entry], columns: Mapping[str, NDArray[Any]]) -> dict[str, str]:
    """Hashes of what the ids of this version mean, and of their references."""
    meaning = json.dumps({id_: _row(flow) for id_, flow in flows.items()}, sort_keys=True)
    numbers = hashlib.sha256(VERSION.encode())
    for name in sorted(columns):
        column = np.ascontiguousarray(columns[name])
        numbers.update(repr((name, str(column.dtype), column.shape)).encode() + column.tobytes())
    found = (hashlib.sha256((VERSION + meaning).encode()), numbers)
    return {name: each.hexdigest()[:16] for name, each in zip(DIGESTS, found, strict=True)}


def _row(flow: Entry) -> dict[str, Any]:
    builder, arguments, viscosity = flow.drawn
    row = {"scene": builder, "arguments": arguments, "hash": flow.fingerprint}
    return row if viscosity is None else row | {"viscosity": viscosity}


def _write_flows(
    path: Path, flows: Mapping[str, Entry], found: dict[str, str], sources: str
) -> None:
    header = {"version": VERSION, **found, **({"sources": sources} if sources else {})}
    # one flow a line, so that a change can be seen
    lines = ",\n".join(
        f"{json.dumps(id_)}: {json.dumps(_row(flow))}" for id_, flow in flows.items()
    )
    path.write_text(f'{json.dumps(header)[:-1]}, "instances": {{\n{lines}\n}}}}\n')
    load.cache_clear()
    _columns.cache_clear()
