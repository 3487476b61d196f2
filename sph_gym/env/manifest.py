"""Manifests: what the ids of instances mean, and their references, as data that is shipped.

Of every scene there are NAME.json, with what makes each flow and the fingerprint of the scene that
it made, and NAME.npz, with all references one after the other. `python -m sph_gym manifest` writes
them.
"""

import json
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.env.draws import Drawn

FOLDER = Path(__file__).parent / "manifests"
# Of the meaning of the ids; a change of any flow or reference is a new one.
VERSION = "v0"


class Entry(NamedTuple):
    """A flow; fingerprint: of the scene that it made when its reference was computed."""

    drawn: Drawn
    fingerprint: str


class Manifest(NamedTuple):
    """The flows of a scene by their ids, in the order of the references."""

    path: Path
    entries: dict[str, Entry]

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
    """The manifest of a scene; None if it has none. Raises OSError if it can't be read."""
    path = folder / f"{scene}.json"
    if not path.is_file():
        return None
    try:
        rows = json.loads(path.read_text())["instances"]
        entries = {
            id_: Entry(Drawn(row["scene"], row["arguments"], row.get("viscosity")), row["hash"])
            for id_, row in rows.items()
        }
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise _damaged(path, error) from None
    return Manifest(path, entries)


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
    scene: str, rows: Iterable[tuple[str, Entry, dict[str, Any]]], folder: Path = FOLDER
) -> None:
    """Write the manifest of a scene: id, flow and reference of every instance."""
    flows, references = dict[str, Any](), []
    for id_, (drawn, fingerprint), arrays in rows:
        flows[id_] = {"scene": drawn.builder, "arguments": drawn.arguments, "hash": fingerprint}
        if drawn.viscosity is not None:
            flows[id_]["viscosity"] = drawn.viscosity
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
    # one flow a line, so that a change can be seen
    lines = ",\n".join(f"{json.dumps(id_)}: {json.dumps(flow)}" for id_, flow in flows.items())
    text = f'{{"version": "{VERSION}", "instances": {{\n{lines}\n}}}}\n'
    (folder / f"{scene}.json").write_text(text)
    load.cache_clear()
    _columns.cache_clear()
