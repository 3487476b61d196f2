"""Find the frames of a recording: one file of many, a numbered series, a .pvd, a folder."""

import re
from collections import defaultdict
from pathlib import Path
from xml.etree import ElementTree

# What one frame may be stored as.
FRAME_SUFFIXES = (".vtk", ".vtu", ".csv", ".npz", ".hdf5", ".h5")
_NUMBERED = re.compile(r"(.*?)(\d+)(\.[A-Za-z]\w*)")


def series_of(path: Path) -> list[Path]:
    """Return the files that differ from this one by their number only, in its order."""
    found = _NUMBERED.fullmatch(path.name)
    if found is None:
        return [path]
    return _groups(path.parent).get((found[1], found[3]), [path])


def series_in(folder: Path) -> list[Path]:
    """Return the numbered series in a folder, that of the fluid if there are several.

    A single .pvd is a series by itself. Raises ValueError if there is no series, and if it isn't
    clear which one is meant.
    """
    indices = sorted(folder.glob("*.pvd"))
    if len(indices) == 1:
        return indices
    groups = {key: files for key, files in _groups(folder).items() if len(files) > 1}
    if not groups:
        raise ValueError(
            f"{folder}: expected a .pvd or a numbered series of {', '.join(FRAME_SUFFIXES)}, got "
            f"{_some(sorted(each.name for each in folder.iterdir()))}"
        )
    fluid = [files for (stem, _), files in groups.items() if "fluid" in stem.lower()]
    chosen = fluid if len(fluid) == 1 else list(groups.values())
    if len(chosen) > 1:
        raise ValueError(
            f"{folder}: expected one numbered series, got {_some([f[0].name for f in chosen])}; "
            "name one of its files"
        )
    return chosen[0]


def read_pvd(path: Path) -> tuple[list[Path], list[float]]:
    """Return the files of a .pvd and their times [s].

    Raises ValueError if it is none, and for flows in several parts.
    """
    try:
        sets = [each.attrib for each in ElementTree.parse(path).iter("DataSet")]
    except ElementTree.ParseError as error:
        raise ValueError(f"{path}: expected ParaView's index of files: {error}") from None
    files = [path.parent / each.get("file", "") for each in sets]
    times = [float(each.get("timestep", "nan")) for each in sets]
    if not files:
        raise ValueError(f"{path}: expected DataSet entries, got none")
    if len(set(times)) < len(times):
        raise ValueError(f"{path}: expected one file for each time, got {len(files)} files")
    return files, times


def _groups(folder: Path) -> dict[tuple[str, str], list[Path]]:
    """Return numbered files by what stands before and after the number, sorted by it."""
    found: dict[tuple[str, str], dict[int, Path]] = defaultdict(dict)
    for each in folder.iterdir():
        name = _NUMBERED.fullmatch(each.name)
        if name is not None and name[3].lower() in FRAME_SUFFIXES:
            found[name[1], name[3]][int(name[2])] = each
    return {key: [files[n] for n in sorted(files)] for key, files in found.items()}


def _some(names: list[str], most: int = 8) -> str:
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(names[:most]) or "nothing") + rest
