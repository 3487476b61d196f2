"""Read the points of a legacy .vtk file, as PartVTK of DualSPHysics and others write them.

meshio reads no POLYDATA, which most of them are; of a cloud of points little else is of interest.
Source: VTK User's Guide, 11th edition, "VTK File Formats", and the file format 5.1 of VTK 9.
"""

from pathlib import Path
from typing import Any

import numpy as np

TYPES = {
    "bit": "u1",
    "char": "i1",
    "unsigned_char": "u1",
    "short": "i2",
    "unsigned_short": "u2",
    "int": "i4",
    "unsigned_int": "u4",
    "long": "i8",
    "unsigned_long": "u8",
    "vtkidtype": "i8",
    "vtktypeint64": "i8",
    "float": "f4",
    "double": "f8",
}
VECTORS = ("VECTORS", "NORMALS")
CELLS = ("VERTICES", "LINES", "POLYGONS", "TRIANGLE_STRIPS", "CELLS")


def read_legacy_vtk(path: Path) -> dict[str, Any]:
    """Return the points, as "Points" (n, 3), and the data of points and of the file by name.

    Raises ValueError for a file of another format, and for one that ends too early.
    """
    with path.open("rb") as file:
        head = [file.readline() for _ in range(3)]
        rest = file.read()
    if not head[0].startswith(b"# vtk DataFile"):
        raise ValueError(f"{path}: expected a legacy VTK file, it begins with {head[0][:30]!r}")
    form = head[2].strip().upper()
    if form not in (b"ASCII", b"BINARY"):
        raise ValueError(f"{path}: expected ASCII or BINARY in line 3, got {form[:30]!r}")
    try:
        return _Sections(rest, form == b"BINARY").read()
    except (ValueError, IndexError, KeyError) as error:
        raise ValueError(f"{path}: expected a complete VTK file: {error}") from None


class _Sections:
    """The sections after the first three lines, read from front to back."""

    def __init__(self, data: bytes, binary: bool) -> None:
        self._data, self._binary, self._at = data, binary, 0
        self._of_points = True
        self.found: dict[str, Any] = {}

    def read(self) -> dict[str, Any]:
        while (words := self._line()) is not None:
            self._section([word.decode("latin-1") for word in words])
        return self.found

    def _line(self) -> list[bytes] | None:
        """Return the words of the next line that has any; None at the end."""
        while self._at < len(self._data):
            end = self._data.find(b"\n", self._at)
            end = len(self._data) if end < 0 else end
            words = self._data[self._at : end].split()
            self._at = end + 1
            if words:
                return words
        return None

    def _section(self, words: list[str]) -> None:
        key = words[0].upper()
        if key == "POINTS":
            self.found["Points"] = self._numbers(words[2], 3 * int(words[1])).reshape(-1, 3)
        elif key in CELLS:
            self._skip_cells(words)
        elif key == "CELL_TYPES":
            self._numbers("int", int(words[1]))
        elif key == "METADATA":
            self._skip_metadata()
        elif key in ("POINT_DATA", "CELL_DATA"):
            self._of_points, self._n = key == "POINT_DATA", int(words[1])
        elif key == "SCALARS":
            n_components = int(words[3]) if len(words) > 3 else 1
            self._line()  # the name of the lookup table
            self._keep(words[1], self._numbers(words[2], self._n * n_components), n_components)
        elif key in VECTORS:
            self._keep(words[1], self._numbers(words[2], 3 * self._n), 3)
        elif key == "FIELD":
            self._field(int(words[2]))
        elif key != "DATASET":
            raise ValueError(f"section {words[0][:30]!r} is not known")

    def _field(self, n_arrays: int) -> None:
        for _ in range(n_arrays):
            words = self._line()
            while words is not None and words[0] == b"METADATA":
                self._skip_metadata()
                words = self._line()
            if words is None:
                raise ValueError("a field ends too early")
            name, n_components, n, kind = (word.decode("latin-1") for word in words)
            if kind == "string":
                for _ in range(int(n)):
                    self._line()
                continue
            values = self._numbers(kind, int(n) * int(n_components))
            self._keep(name.replace("%20", " "), values, int(n_components))

    def _keep(self, name: str, values: Any, n_components: int) -> None:
        if self._of_points:
            columns = values if n_components == 1 else values.reshape(-1, n_components)
            self.found.setdefault(name, columns)

    def _skip_cells(self, words: list[str]) -> None:
        """Skip lists of points; since version 5.1 they are two arrays, each under its own line."""
        after = self._data[self._at : self._at + 40].split()
        if after and after[0] == b"OFFSETS":
            for size in (words[1], words[2]):
                line = self._line()
                assert line is not None
                self._numbers(line[1].decode("latin-1"), int(size))
        else:
            self._numbers("int", int(words[2]))

    def _skip_metadata(self) -> None:
        """Skip to the next empty line."""
        end = self._data.find(b"\n\n", self._at)
        self._at = len(self._data) if end < 0 else end + 2

    def _numbers(self, kind: str, n: int) -> Any:
        """Return the next n numbers; binary ones are big-endian."""
        dtype = np.dtype(TYPES[kind.lower()]).newbyteorder(">")
        if self._binary:
            values = np.frombuffer(self._data, dtype, n, self._at)
            self._at += n * dtype.itemsize
            return values.astype(dtype.newbyteorder("="))
        words: list[bytes] = []
        while len(words) < n:
            line = self._line()
            if line is None:
                raise ValueError(f"{n} numbers were to come, there are {len(words)}")
            words += line
        return np.array(words[:n], dtype=np.float64).astype(dtype.newbyteorder("="))
