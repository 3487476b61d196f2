"""Write the manifests: draw every instance of a scene and compute its reference."""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from sph_gym.env import manifest
from sph_gym.env.draws import FAMILIES, draw
from sph_gym.env.instances import SIZES, Instance
from sph_gym.env.manifest import Entry
from sph_gym.env.reference import as_arrays, fingerprint, reference
from sph_gym.solver.checks import known


def prepare(chosen: Sequence[str] | None = None, folder: Path = manifest.FOLDER) -> list[Path]:
    """Write the manifests of the chosen scenes, or of all, with a progress bar.

    References that were computed before are taken from the cache on disk, so that it can be
    stopped and run again. Raises ValueError for an unknown scene, and ImportError that names the
    extra to install.
    """
    try:
        from tqdm import tqdm
    except ImportError:
        raise ImportError('manifests need more: pip install "sph_gym[studies]"') from None
    scenes = [known("scenes", scene, FAMILIES) for scene in chosen or FAMILIES]
    written = []
    with tqdm(total=len(scenes) * sum(SIZES.values()), unit="flow", file=sys.stderr) as bar:
        for scene in scenes:
            bar.set_description(scene)
            rows = []
            for row in _rows(scene):
                rows.append(row)
                bar.update()
            manifest.write(scene, rows, folder)
            written.append(folder / f"{scene}.json")
    return written


def _rows(scene: str) -> Iterator[tuple[str, Entry, dict[str, Any]]]:
    """Id, flow and reference of all instances of a scene."""
    for split, size in SIZES.items():
        for number in range(size):
            id_ = f"{scene}/{split}/{number}"
            drawn = draw(scene, split, number, FAMILIES[scene].dx)
            built = Instance(id_, drawn).build()
            yield id_, Entry(drawn, fingerprint(built)), as_arrays(reference(built))
