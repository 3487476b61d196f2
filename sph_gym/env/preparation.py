"""Write the manifests: draw every instance of a scene and compute its reference."""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from sph_gym.env import manifest
from sph_gym.env.draws import FAMILIES, draw
from sph_gym.env.instances import SIZES, Instance
from sph_gym.env.manifest import Entry
from sph_gym.env.reference import as_arrays, fingerprint, reference, sources
from sph_gym.solver.checks import known


def prepare(
    chosen: Sequence[str] | None = None, folder: Path = manifest.FOLDER, redefine: bool = False
) -> list[Path]:
    """Write the manifests of the chosen scenes, or of all, with a progress bar.

    References that were computed before are taken from the cache on disk, so that it can be
    stopped and run again. redefine: let ids of the present version mean other flows.
    Raises ValueError for an unknown scene and, unless redefine, before anything is computed, if
    the folder has other flows under the same version; ImportError that names the extra to install.
    """
    try:
        from tqdm import tqdm
    except ImportError:
        raise ImportError('manifests need more: pip install "sph_gym[studies]"') from None
    scenes = [known("scenes", scene, FAMILIES) for scene in chosen or FAMILIES]
    if not redefine:
        for scene in scenes:
            _check(scene, folder)
    written = []
    with tqdm(total=len(scenes) * sum(SIZES.values()), unit="flow", file=sys.stderr) as bar:
        for scene in scenes:
            bar.set_description(scene)
            rows = []
            for id_, flow in _flows(scene):
                rows.append((id_, flow, _reference(id_, flow)))
                bar.update()
            manifest.write(scene, rows, folder, sources())
            written.append(folder / f"{scene}.json")
    return written


def stamp(chosen: Sequence[str] | None = None, folder: Path = manifest.FOLDER) -> list[Path]:
    """Write the digests of manifests anew, and nothing else. Returns the files.

    Raises ValueError for an unknown scene.
    """
    scenes = [known("scenes", scene, FAMILIES) for scene in chosen or FAMILIES]
    return [path for scene in scenes if (path := manifest.stamp(scene, folder)) is not None]


def _check(scene: str, folder: Path) -> None:
    """ValueError if an id of the present version would come to mean something else."""
    try:
        there = manifest.load(scene, folder)
    except OSError:  # of another version, or damaged: to be replaced
        return
    listed = {} if there is None else there.entries
    for id_, flow in _flows(scene):
        if listed.get(id_, flow) != flow:
            raise ValueError(
                f"manifest: {id_} means another flow in {manifest.VERSION}: give the manifests a "
                "new VERSION in sph_gym/env/manifest.py, or say --redefine"
            )


def _flows(scene: str) -> Iterator[tuple[str, Entry]]:
    """Id and flow of all instances of a scene."""
    for split, size in SIZES.items():
        for number in range(size):
            id_ = f"{scene}/{split}/{number}"
            drawn = draw(scene, split, number, FAMILIES[scene].dx)
            yield id_, Entry(drawn, fingerprint(Instance(id_, drawn).build()))


def _reference(id_: str, flow: Entry) -> dict[str, Any]:
    return as_arrays(reference(Instance(id_, flow.drawn).build()))
