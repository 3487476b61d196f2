"""Write the manifests: draw every instance of an environment and compute its reference."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from sph_gym.env import manifest
from sph_gym.env.distributions import FAMILIES, draw
from sph_gym.env.fingerprint import fingerprint
from sph_gym.env.instances import SIZES, Instance
from sph_gym.env.manifest import Entry
from sph_gym.env.reference import as_arrays, reference, sources
from sph_gym.extras import progress_bar
from sph_gym.solver.checks import known


def prepare(
    chosen: Sequence[str] | None = None,
    folder: Path = manifest.FOLDER,
    redefine: bool = False,
    again: bool = False,
) -> list[Path]:
    """Write the manifests of the chosen environments, or of all, with a progress bar.

    References that the folder or the cache on disk have are taken from there, and what is there is
    written when it is stopped, so that it can be run again to go on. redefine: let ids of the
    present version mean other flows; again: take no reference from the folder.
    Raises ValueError for an unknown name and, unless redefine, before anything is computed, if
    the folder has other flows under the same version; ImportError that names the extra to install.
    """
    names = _names(chosen)
    with progress_bar(len(names) * sum(SIZES.values()), unit="flow") as bar:
        if not redefine:
            for name in names:
                _check(name, folder)
        for name in names:
            bar.set_description(name)
            listed = None if again else _listed(name, folder)
            rows, flows = [], list(_flows(name))
            try:
                for id_, flow in flows:
                    rows.append((id_, flow, _reference(id_, flow, listed)))
                    bar.update()
            finally:
                # what it did not come to stays
                kept = [pair for pair in flows[len(rows) :] if _is_listed(listed, *pair)]
                rows += [(id_, flow, _reference(id_, flow, listed)) for id_, flow in kept]
                if rows:
                    manifest.write(name, rows, folder, sources())
    return [folder / f"{name}.json" for name in names]


def stamp(chosen: Sequence[str] | None = None, folder: Path = manifest.FOLDER) -> list[Path]:
    """Write the digests of manifests anew, and nothing else. Return the files.

    Raises ValueError for an unknown name.
    """
    stamped = [manifest.stamp(name, folder) for name in _names(chosen)]
    return [path for path in stamped if path is not None]


def _names(chosen: Sequence[str] | None) -> list[str]:
    return [known("scenes", name, FAMILIES) for name in chosen or FAMILIES]


def _check(name: str, folder: Path) -> None:
    """Raise ValueError if an id of the present version would come to mean another flow."""
    there = _listed(name, folder)
    listed = {} if there is None else there.entries
    for id_, flow in _flows(name):
        if listed.get(id_, flow) != flow:
            raise ValueError(
                f"manifest: {id_} means another flow in {manifest.VERSION}: give the manifests a "
                "new VERSION in sph_gym/env/manifest.py, or say --redefine"
            )


def _listed(name: str, folder: Path) -> manifest.Manifest | None:
    """Return the manifest that is there; None if it is of another version or damaged."""
    try:
        return manifest.load(name, folder)
    except OSError:
        return None


def _flows(name: str) -> Iterator[tuple[str, Entry]]:
    """Yield id and flow of all instances of an environment."""
    for split, size in SIZES.items():
        for number in range(size):
            id_ = f"{name}/{split}/{number}"
            drawn = draw(name, split, number, FAMILIES[name].dx)
            yield id_, Entry(drawn, fingerprint(Instance(id_, drawn).build()))


def _is_listed(listed: manifest.Manifest | None, id_: str, flow: Entry) -> bool:
    return listed is not None and listed.entries.get(id_) == flow


def _reference(id_: str, flow: Entry, listed: manifest.Manifest | None) -> dict[str, Any]:
    if listed is not None and _is_listed(listed, id_, flow):
        return listed.arrays(id_)
    return as_arrays(reference(Instance(id_, flow.drawn).build()))
