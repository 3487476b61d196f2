"""One look at all frames of a recording: what the passive checks build on."""

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.doctor.reading import Frame, RecordedFrames
from sph_gym.doctor.reading.frames import Array
from sph_gym.extras import needs_extra

# Number of pairs of neighbouring frames, spread over the recording, that are looked at closely.
PAIRS = 8
# Columns in the order in which a step computes them, and the link that made each.
CHAIN = {"rho": "density", "p": "pressure", "v": "force", "x": "integration"}


class Bad(NamedTuple):
    """The first value that is not finite.

    frame: its number; particle: as `RecordingSurvey.name` has it.
    """

    frame: int
    column: str
    particle: str
    n: int


class FrameSums(NamedTuple):
    """Sums over the fluid of one frame.

    n: particles; center, velocity: (d,) means [m], [m/s], NaN without velocities; kinetic: mean of
    v^2 / 2 [m^2/s^2]; top_speed: [m/s].
    """

    time: float
    n: int
    center: Array
    velocity: Array
    kinetic: float
    top_speed: float


class Change(NamedTuple):
    """The first frame whose particles are not those of the one before.

    lost: (m, d) their last positions [m]; gained: how many are new.
    """

    frame: int
    lost: Array
    gained: int
    names: tuple[str, ...]


class RecordingSurvey:
    """A recording with its fluid put in order, up to the first value that is not finite.

    first: the fluid of frame 0; looks: one a frame; bad: what ended it; change: of the particles;
    doubled: a frame in which two particles have one identity, -1 if none has; still: (n,) which
    fluid particles are at their place in all frames; walls: (m, d) positions of walls at the
    start; walls_move: whether they are elsewhere later; reordered: whether rows change their
    particles, as the check `particles` finds; facts: what other checks have found, by name;
    notes: for the diagnosis.
    """

    def __init__(self, recording: RecordedFrames) -> None:
        self.recording, self.known = recording, recording.known
        self.notes: list[str] = []
        self.looks: list[FrameSums] = []
        self.bad: Bad | None = None
        self.change: Change | None = None
        self.doubled = -1
        self.reordered = self.walls_move = False
        self.facts: dict[str, Any] = {}
        self._fluid: NDArray[np.bool_] | None = None
        first = recording.frame(0)
        self._uses_ids = first.ids is not None and len(np.unique(first.ids)) == len(first.ids)
        if first.ids is not None and not self._uses_ids:
            self.notes.append("identities of the first frame are not all different: not used")
        self.first, self.walls = self.frame(0), _walls(first)
        self.still = np.ones(len(self.first.x), bool)
        before = self.first
        for k in range(len(recording)):
            raw = first if k == 0 else recording.frame(k)
            frame = self._in_order(raw)
            self.walls_move = self.walls_move or not _same_place(first, raw)
            self.bad = self._first_bad(k, frame)
            if self.bad is not None:
                break
            self._compare(k, before, frame)
            self.looks.append(_look(frame))
            before = frame
        self._leave_walls_out()

    def frame(self, k: int) -> Frame:
        """Return the fluid of frame k, sorted by identities if there are any."""
        return self._in_order(self.recording.frame(k))

    def _in_order(self, frame: Frame) -> Frame:
        if frame.wall is not None:
            frame = frame.part(~frame.wall)
        if not self._uses_ids or frame.ids is None:
            return frame._replace(ids=None)
        return frame.part(np.argsort(frame.ids, kind="stable"))

    def name(self, frame: Frame, i: int) -> str:
        """Return how a particle is called: by its identity, or by its place in the frame."""
        return f"{i}" if frame.ids is None else f"with id {int(frame.ids[i])}"

    # --- what the loop over the frames finds -------------------------------------------------

    def _first_bad(self, k: int, frame: Frame) -> Bad | None:
        for column in CHAIN:
            values = getattr(frame, column)
            if values is None:
                continue
            finite = np.isfinite(values)
            wrong = ~(finite.all(axis=1) if values.ndim == 2 else finite)
            if wrong.any():
                i = int(np.argmax(wrong))
                return Bad(k, column, self.name(frame, i), int(wrong.sum()))
        return None

    def _compare(self, k: int, before: Frame, frame: Frame) -> None:
        if frame.ids is not None and self.doubled < 0 and (np.diff(frame.ids) == 0).any():
            self.doubled = k
        if self.change is not None:
            return
        if _same_particles(before, frame):
            self.still &= (frame.x == self.first.x).all(axis=1)
            return
        names: tuple[str, ...] = ()
        lost, gained = np.zeros((0, frame.x.shape[1])), len(frame.x) - len(before.x)
        if frame.ids is not None and before.ids is not None:
            gone = ~np.isin(before.ids, frame.ids)
            lost, gained = before.x[gone], int((~np.isin(frame.ids, before.ids)).sum())
            names = tuple(str(i) for i in before.ids[gone][:3].tolist())
        self.change = Change(k, lost, gained, names)

    def _leave_walls_out(self) -> None:
        """Take particles that never move for walls, if the file doesn't tell walls from fluid."""
        v, n = self.first.v, len(self.still)
        rests = self.still & (True if v is None else (v == 0).all(axis=1))
        told = self.walls is not None or self.known.scene is not None
        if told or not rests.any() or rests.all() or self.change is not None or len(self.looks) < 3:
            return
        self.notes.append(f"{rests.sum()} of {n} particles never move and are taken for walls")
        self.walls, self._fluid = self.first.x[rests], ~rests
        self.first, self.still = self.first.part(~rests), self.still[~rests]

    # --- what checks ask for -----------------------------------------------------------------

    def fluid(self, k: int) -> Frame:
        """Return frame k without what was taken for walls."""
        frame = self.frame(k)
        return frame if self._fluid is None else frame.part(self._fluid)

    @property
    def n_frames(self) -> int:
        """Return the number of frames before the first value that is not finite."""
        return len(self.looks)

    @cached_property
    def times(self) -> Array:
        """Return the time [s] of each of these frames."""
        return np.array([look.time for look in self.looks])

    def interval(self, k: int) -> float:
        """Return the time [s] from frame k to the next, NaN if it isn't told.

        Whole numbers that count the frames are no times.
        """
        if self.n_frames > 2 and (np.diff(self.times) == 1).all():
            return math.nan
        return float(self.times[k + 1] - self.times[k])

    @cached_property
    def sampled(self) -> list[int]:
        """Return the frames that are looked at closely, spread evenly; the last is one of them."""
        if self.n_frames == 0:
            return []
        return np.unique(np.linspace(0, self.n_frames - 1, PAIRS + 1).astype(int)).tolist()

    @cached_property
    def samples(self) -> list[Frame]:
        """Return the fluid of the frames that are looked at closely."""
        return [self.fluid(k) for k in self.sampled]

    @cached_property
    def pressures(self) -> list[Array]:
        """Return the pressures of the frames that are looked at closely, if there are any."""
        return [frame.p for frame in self.samples if frame.p is not None]

    def pairs(self) -> list[tuple[int, Frame, Frame]]:
        """Return (k, frame k, frame k + 1) of the fluid, where both have the same particles."""
        found = []
        for k, frame in zip(self.sampled, self.samples, strict=True):
            if k + 1 < self.n_frames and (self.change is None or k + 1 < self.change.frame):
                found.append((k, frame, self.fluid(k + 1)))
        return found

    @cached_property
    def spacing(self) -> float:
        """Return the spacing [m] of the first frame: dx, or the median distance of neighbours."""
        if self.known.scene is not None:
            return self.known.scene.dx
        return float(np.median(nearest(self.fluid(0).x))) if self.n_frames else math.nan

    def when(self, k: int) -> str:
        """Return in words which frame it is."""
        time = self.looks[k].time if k < self.n_frames else math.nan
        return f"frame {k}" if math.isnan(time) else f"frame {k} (t = {time:.4g} s)"


def nearest(x: Array, others: Array | None = None) -> Array:
    """Return (n,) distances [m] to the nearest other particle; infinite if there is none.

    Raises ImportError that names the extra if scipy is missing.
    """
    if others is None:
        return distances(x, x, 2)[:, 1] if len(x) > 1 else np.full(len(x), np.inf)
    return distances(x, others, 1)[:, 0] if len(others) else np.full(len(x), np.inf)


def distances(x: Array, others: Array, k: int, reach: float = math.inf) -> Array:
    """Return (n, k) distances [m] to the k nearest of the others within reach [m], else infinite.

    Raises ImportError that names the extra if scipy is missing.
    """
    with needs_extra("studies"):
        from scipy.spatial import cKDTree
    found = np.asarray(cKDTree(others).query(x, k, distance_upper_bound=reach)[0], float)
    return found.reshape(len(x), k)


def _same_particles(before: Frame, frame: Frame) -> bool:
    if len(before.x) != len(frame.x):
        return False
    if before.ids is None or frame.ids is None:
        return True
    return bool((before.ids == frame.ids).all())


def _walls(frame: Frame) -> Array | None:
    return None if frame.wall is None or not frame.wall.any() else frame.x[frame.wall]


def _same_place(first: Frame, frame: Frame) -> bool:
    """Return whether walls are where they were."""
    before, now = _walls(first), _walls(frame)
    if before is None or now is None:
        return before is now
    return before.shape == now.shape and bool((before == now).all())


def _look(frame: Frame) -> FrameSums:
    n, d = frame.x.shape
    nothing: Any = np.full(d, math.nan)
    if n == 0:
        return FrameSums(frame.time, 0, nothing, nothing, math.nan, math.nan)
    center = frame.x.mean(axis=0)
    if frame.v is None:
        return FrameSums(frame.time, n, center, nothing, math.nan, math.nan)
    square = (frame.v**2).sum(axis=1)
    return FrameSums(
        frame.time,
        n,
        center,
        frame.v.mean(axis=0),
        float(square.mean() / 2),
        math.sqrt(float(square.max())),
    )
