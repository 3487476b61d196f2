"""Recordings, whatever the file: frames of particles, and what is known of the flow.

Arrays of a frame are float64 and belong to it; None stands for what the file doesn't hold.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.scene import Scene

Array = NDArray[np.float64]
# A coordinate is constant if it spreads over less than this share of the widest one.
CONSTANT = 1e-6


class Frame(NamedTuple):
    """The particles at one time, in 2 or 3 dimensions (d).

    x: (n, d) positions [m]; v: (n, d) velocities [m/s]; rho: (n,) densities [kg/m^3]; p: (n,)
    pressures [Pa]; ids: (n,) whole numbers by which particles are known in other frames; wall:
    (n,) which are no fluid; time: [s], NaN if the file doesn't tell.
    """

    x: Array
    v: Array | None = None
    rho: Array | None = None
    p: Array | None = None
    ids: NDArray[np.int64] | None = None
    wall: NDArray[np.bool_] | None = None
    time: float = float("nan")

    @property
    def columns(self) -> dict[str, Any]:
        """Return all but the time by name."""
        return {name: column for name, column in self._asdict().items() if name != "time"}

    def part(self, chosen: NDArray[np.generic]) -> "Frame":
        """Return some of the particles; chosen: indices, or (n,) True for each that is wanted."""
        return self._replace(
            **{name: column[chosen] for name, column in self.columns.items() if column is not None}
        )


class Known(NamedTuple):
    """The facts that a recording tells of its flow; None where it doesn't.

    scene: that of this project's own recordings; stiffness: (frames,) Tait's B [Pa] in each frame.
    """

    scene: Scene | None = None
    stiffness: Array | None = None


@dataclass(frozen=True)
class RecordedFrames:
    """Frames that are read when they are asked for.

    path: of the file or folder; form: what kind of recording it is, in words; loads: one function
    a frame that reads it.
    """

    path: str
    form: str
    loads: Sequence[Callable[[], Frame]]
    known: Known = field(default_factory=Known)

    def __len__(self) -> int:
        return len(self.loads)

    def frame(self, k: int) -> Frame:
        """Read frame k."""
        return self.loads[k]()


def planar(recording: RecordedFrames) -> RecordedFrames:
    """Return the recording without the coordinate that is the same for all, if it has three.

    Files of ParaView are always three-dimensional, and a plane flow of DualSPHysics is in x and z.
    """
    first = recording.frame(0)
    if first.x.shape[1] != 3 or len(first.x) == 0:
        return recording
    finite = first.x[np.isfinite(first.x).all(axis=1)]
    spread = np.ptp(finite, axis=0) if len(finite) else np.array([1.0, 1.0, 0.0])
    flat = spread <= CONSTANT * spread.max()
    if not flat.any():
        return recording
    kept = np.delete(np.arange(3), np.flatnonzero(flat)[-1])

    def flattened(load: Callable[[], Frame]) -> Callable[[], Frame]:
        def read() -> Frame:
            frame = load()
            v = None if frame.v is None else frame.v[:, kept]
            return frame._replace(x=frame.x[:, kept], v=v)

        return read

    return replace(recording, loads=[flattened(load) for load in recording.loads])
