"""Manifests: the meaning of the ids of instances, and their references, as data that is shipped.

Every environment has NAME.json, with what makes each flow and the fingerprint of the scene that it
made, and NAME.npz, with all references one after the other, rounded to a share of the largest
value that a quantity has in its flow (PARTS). `python -m sph_gym manifest` writes them. On top of
NAME.json are the version of the ids, digests of flows and references, so that none changes unseen,
and a hash of the sources that computed the references.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.env.contexts import Context
from sph_gym.env.distributions import Drawn
from sph_gym.files import atomic_write

FOLDER = Path(__file__).parent / "manifests"
# Version of the meaning of the ids: a change of any flow or reference needs a new one. Manifests
# of another version are not read.
VERSION = "v1"
DIGESTS = ("flows", "references")
# Quantities of a reference, and how many numbers each is in a frame.
ROWS = {"com": 2, "extent": 2, "kinetic": 1, "clumping": 1, "noise": 1, "spread": 5}
# Each is rounded to so many parts of its largest value, below a hundredth of a tolerance.
BITS = {"com": 13, "extent": 13, "kinetic": 13, "clumping": 12, "noise": 11, "spread": 9}
PARTS = np.repeat([2 ** BITS[name] - 1 for name in ROWS], list(ROWS.values()))


class Entry(NamedTuple):
    """A flow; fingerprint: of the scene that it made when its reference was computed."""

    drawn: Drawn
    fingerprint: str

    def row(self) -> dict[str, Any]:
        """Return the flow as JSON data."""
        builder, arguments, context = self.drawn
        row = {"scene": builder, "arguments": arguments, "hash": self.fingerprint}
        return row if context is None else row | {"context": _changed(context)}

    @staticmethod
    def of(row: Mapping[str, Any]) -> "Entry":
        """Return the flow of such a row."""
        context = Context(**row["context"]) if "context" in row else None
        return Entry(Drawn(row["scene"], row["arguments"], context), row["hash"])


def _changed(context: Context) -> dict[str, Any]:
    """Return what isn't as usual in a context."""
    usual = Context()._asdict()
    return {name: value for name, value in context._asdict().items() if value != usual[name]}


class Manifest(NamedTuple):
    """The flows of an environment by their ids, in the order of the references.

    version: of the ids; digests: of flows and references when they were written, empty if they
    weren't stamped; sources: hash of the sources that computed the references, empty if unknown.
    """

    path: Path
    entries: dict[str, Entry]
    version: str
    digests: dict[str, str]
    sources: str

    def arrays(self, id_: str) -> dict[str, NDArray[Any]]:
        """Return the reference of an instance: arrays by name, a row for every frame."""
        columns = _columns(self.path)
        return unpacked(columns, list(self.entries).index(id_))


def entry(id_: str) -> Entry | None:
    """Return the flow that the manifests list under an id, None if there is none."""
    found = load(id_.split("/")[0])
    return None if found is None else found.entries.get(id_)


def lengths(name: str) -> dict[str, int]:
    """Return the steps of an episode of each listed flow of an environment, by id."""
    found = load(name)
    if found is None:
        return {}
    # a reference has one row more, the start
    steps = np.diff(_columns(found.path)["offsets"]) - 1
    return dict(zip(found.entries, steps.tolist(), strict=True))


@cache
def load(name: str, folder: Path = FOLDER) -> Manifest | None:
    """Return the manifest of an environment, None if it has none.

    Raises OSError if it can't be read or is of another version.
    """
    path = folder / f"{name}.json"
    if not path.is_file():
        return None
    try:
        data = json.loads(path.read_text())
        version, rows = data["version"], data["instances"]
        digests = {kind: data[kind] for kind in DIGESTS if kind in data}
        entries = {id_: Entry.of(row) for id_, row in rows.items()}
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
    name: str,
    rows: Iterable[tuple[str, Entry, dict[str, Any]]],
    folder: Path = FOLDER,
    sources: str = "",
) -> None:
    """Write the manifest of an environment: id, flow and reference of every instance.

    sources: hash of the sources that computed the references.
    """
    ids, flows, references = zip(*rows, strict=True)
    columns = packed(references)
    with atomic_write(folder / f"{name}.npz") as draft:
        np.savez_compressed(draft, **columns)
    entries = dict(zip(ids, flows, strict=True))
    _write_flows(folder / f"{name}.json", entries, _digests(entries, columns), sources)


def packed(references: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return references as few bytes: changes from frame to frame in whole parts of the largest.

    High and low bytes are kept apart, and quantities one after the other, since equal bytes side by
    side compress well.
    """
    scales, changes = [], []
    for arrays in references:
        rows = np.column_stack([arrays[name] for name in ROWS]).astype(np.float64)
        scale = np.abs(rows).max(axis=0).astype(np.float32)
        parts = np.rint(PARTS * (rows / np.where(scale > 0, scale, 1.0))).astype(np.int32)
        change = np.diff(parts, axis=0, prepend=0)
        # small changes of either sign as small numbers
        changes.append((change << 1) ^ (change >> 31))
        scales.append(scale)
    table = np.concatenate(changes).T
    return {
        "high": (table >> 8).astype(np.uint8),
        "low": (table & 255).astype(np.uint8),
        "scales": np.array(scales),
        "offsets": np.cumsum([0, *map(len, changes)]),
        "cfl_substeps": np.array([arrays["cfl_substeps"] for arrays in references]),
    }


def unpacked(columns: Mapping[str, NDArray[Any]], k: int) -> dict[str, Any]:
    """Return reference k of packed ones: arrays by name, a row for every frame."""
    frames = slice(*columns["offsets"][k : k + 2])
    high, low = (columns[name][:, frames].astype(np.int32) for name in ("high", "low"))
    change = high << 8 | low
    parts = np.cumsum((change >> 1) ^ -(change & 1), axis=1).T
    rows = parts * (columns["scales"][k].astype(np.float64) / PARTS)
    ends = np.cumsum(list(ROWS.values()))[:-1]
    named = {
        name: block if width > 1 else block[:, 0]
        for (name, width), block in zip(ROWS.items(), np.split(rows, ends, axis=1), strict=True)
    }
    return named | {"cfl_substeps": float(columns["cfl_substeps"][k])}


def stamp(name: str, folder: Path = FOLDER) -> Path | None:
    """Write the digests of a manifest anew, and nothing else; None if there is no manifest."""
    found = load(name, folder)
    if found is None:
        return None
    _write_flows(found.path, found.entries, current(found), found.sources)
    return found.path


def current(found: Manifest) -> dict[str, str]:
    """Return the digests that a manifest ought to have."""
    return _digests(found.entries, _columns(found.path))


def _digests(flows: Mapping[str, Entry], columns: Mapping[str, NDArray[Any]]) -> dict[str, str]:
    """Return hashes of the meaning of the ids of this version, and of their references."""
    meaning = json.dumps({id_: flow.row() for id_, flow in flows.items()}, sort_keys=True)
    numbers = hashlib.sha256(VERSION.encode())
    for name in sorted(columns):
        column = np.ascontiguousarray(columns[name])
        numbers.update(repr((name, str(column.dtype), column.shape)).encode() + column.tobytes())
    found = (hashlib.sha256((VERSION + meaning).encode()), numbers)
    return {name: each.hexdigest()[:16] for name, each in zip(DIGESTS, found, strict=True)}


def _write_flows(
    path: Path, flows: Mapping[str, Entry], digests: dict[str, str], sources: str
) -> None:
    header = {"version": VERSION, **digests, **({"sources": sources} if sources else {})}
    # one flow a line, so that a change can be seen
    lines = ",\n".join(
        f"{json.dumps(id_)}: {json.dumps(flow.row())}" for id_, flow in flows.items()
    )
    with atomic_write(path) as draft:
        draft.write_text(f'{json.dumps(header)[:-1]}, "instances": {{\n{lines}\n}}}}\n')
    load.cache_clear()
    _columns.cache_clear()
