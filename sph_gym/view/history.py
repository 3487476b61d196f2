"""The states that a window can go back to: exact snapshots of a running simulation."""

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from sph_gym.blowups import explain
from sph_gym.solver.offender import Offender
from sph_gym.solver.simulation import Report, Simulation
from sph_gym.solver.state import Controls
from sph_gym.view.marks import offender_of
from sph_gym.view.state import Array

# Number of states that are kept.
KEPT = 1000
# The most bytes that they may take; of large states fewer are kept.
ROOM = 2**30
# Number of states that are kept in any case, however large they are.
LEAST = 300
# Number of the last substeps that can be stepped through when something is odd.
SUBSTEPS = 100
# The measures that are drawn over time: title, factor and unit of a diagnostic.
MEASURES = {
    "density_error": ("mean density error", 100.0, "%"),
    "max_speed": ("largest speed", 1.0, "m/s"),
    "energy_excess": ("spurious energy", 100.0, "%"),
    "clumping": ("clumped particles", 100.0, "%"),
}

Numbers = Mapping[str, float]
Steer = Callable[[Simulation], Controls]


class Trouble(NamedTuple):
    """A reason to stop and look: the particle, -1 if it is about none in particular, and why."""

    particle: int
    message: str


class HistoryEntry(NamedTuple):
    """A kept moment.

    snapshot: of the simulation; numbers: by title; controls: with which it came here; n_substeps,
    dt: how many steps of how many seconds it took from the moment before, 0 if that is not known;
    steer: the controller that set the controls.
    """

    snapshot: dict[str, Any]
    numbers: Numbers
    controls: Controls
    n_substeps: int
    dt: float
    steer: Steer | None


class History:
    """A running simulation with the moments behind it: a `Source`.

    sim: is moved to the moment that is shown, so everything about it can be asked; advance: runs it
    on by a frame and returns the report, None if the run is over; without it, others run it;
    rewind: is called before the run goes on with other controls than it had; more: more numbers of
    a moment, by title; offender: of the last frame, if a condition to break on has come true.

    `trouble` says what the last computed frame brought: an offender, a blow-up, or a new warning.

    Going back and forth shows the same states to the last bit. A run that goes on from an earlier
    moment shows what is kept, unless the controls or the controller have been changed: then what
    came after that moment is dropped and computed anew.
    """

    unit = "frame"

    def __init__(
        self,
        sim: Simulation,
        advance: Callable[[], Report | None] | None = None,
        rewind: Callable[[], None] | None = None,
        more: Callable[[], Numbers] | None = None,
        offender: Callable[[], Offender | None] | None = None,
    ) -> None:
        self.sim, self._advance, self._rewind = sim, advance, rewind
        self._more, self._offender = more or dict, offender
        self.trouble: Trouble | None = None
        self._warned = {warning.kind for warning in sim.warnings}
        # sets the controls before every frame that is computed
        self.steer: Steer | None = None
        self._changed = False
        self._entries: list[HistoryEntry] = []
        self._series: dict[str, Array] = {}
        self._at = 0
        self.keep()

    @property
    def n(self) -> int:
        """Number of moments that are kept."""
        return len(self._entries)

    @property
    def at(self) -> int:
        """Index of the present moment."""
        return self._at

    @property
    def is_newest(self) -> bool:
        """True if nothing is known of what comes after the present moment."""
        return self._at == self.n - 1

    @property
    def state(self) -> Simulation:
        """The simulation, at the present moment."""
        return self.sim

    def time(self, k: int) -> float:
        """Return the time of a moment [s]."""
        return float(self._entries[k].snapshot["time"])

    def series(self) -> Mapping[str, Array]:
        """Return (n,) values of every measure over all moments, by their titles."""
        if not self._series:
            moments = [entry.numbers for entry in self._entries]
            self._series = {
                title: np.array([moment.get(title, math.nan) for moment in moments])
                for title in moments[-1]
            }
        return self._series

    def keep(self, n_substeps: int = 0, dt: float = 0.0) -> None:
        """Keep the simulation as it is now as the newest moment."""
        found = self.sim.diagnostics()
        numbers = {
            f"{title} [{unit}]": factor * found[name]
            for name, (title, factor, unit) in MEASURES.items()
        }
        sim = self.sim
        entry = HistoryEntry(
            sim.snapshot(), numbers | dict(self._more()), sim.controls, n_substeps, dt, self.steer
        )
        self._entries.append(entry)
        if len(self._entries) > self._most():
            del self._entries[0]
        self._at, self._changed, self._series = self.n - 1, False, {}

    def _most(self) -> int:
        """Return how many moments may be kept."""
        fluid = self._entries[0].snapshot["fluid"]
        size = sum(column.nbytes for column in fluid.values())
        return max(LEAST, min(KEPT, ROOM // max(size, 1)))

    def go(self, k: int) -> None:
        """Make moment k the present one; what was changed but not run is taken back."""
        k = min(max(k, 0), self.n - 1)
        if k != self._at or self._changed:
            self._at, self._changed = k, False
            self.sim.restore(self._entries[k].snapshot)

    def set_controls(self, controls: Controls) -> None:
        """Let the run go on from the present moment with other controls.

        Raises ValueError for controls that are none.
        """
        self.sim.controls = controls
        self._changed = True

    def forward(self) -> bool:
        """Go to the next moment: one that is kept, else run for a frame; False if that is over."""
        if not (self.is_newest or self._differs):
            self.go(self._at + 1)
            return True
        if self._advance is None:
            return False
        if self._rewind is not None and (self._changed or not self.is_newest):
            self._rewind()
        del self._entries[self._at + 1 :]
        self._series = {}
        if self.steer is not None:
            self.sim.controls = self.steer(self.sim)
        # with the controls that the frame is run with, so that it can be repeated
        here = self._entries[self._at]
        self._entries[self._at] = here._replace(snapshot=self.sim.snapshot())
        report = self._advance()
        self.trouble = None
        if report is not None:
            self.keep(report.n_substeps, report.dt)
            self.trouble = self._find_trouble(report)
        return report is not None

    def follow(self) -> None:
        """Keep the present state of a simulation that others run, unless it is kept already."""
        report, newest = self.sim.last_report, self._entries[-1]
        passed = self.sim.time - float(newest.snapshot["time"])
        if passed == 0:
            # others may have changed it all the same
            self._entries[-1] = newest._replace(snapshot=self.sim.snapshot())
        elif math.isclose(passed, report.n_substeps * report.dt, rel_tol=1e-6):
            self.keep(report.n_substeps, report.dt)
        else:
            self.keep()

    def _find_trouble(self, report: Report) -> Trouble | None:
        offender = None if self._offender is None else self._offender()
        if offender is not None and not report.diverged:
            return Trouble(offender.particle, f"break: {offender}")
        if report.diverged:
            return Trouble(report.bad_particle, explain(report))
        for warning in self.sim.warnings:
            if warning.kind not in self._warned:
                self._warned.add(warning.kind)
                return Trouble(offender_of(self.sim, warning.kind), f"warning: {warning.message}")
        return None

    @property
    def _differs(self) -> bool:
        """True if the kept moments were run with other controls than are wanted now."""
        return self._changed or self._entries[self._at + 1].steer is not self.steer

    def last_substeps(self, n: int = SUBSTEPS) -> "Substeps":
        """Return the last n substeps up to the present moment, by running them once more.

        Fewer if the moments that are kept don't go back so far, or if it isn't known how others
        came from one to the next. The simulation is at the present
        moment afterwards.
        """
        first, found = self._at, 0
        while first > 0 and found < n and self._entries[first].n_substeps > 0:
            found += self._entries[first].n_substeps
            first -= 1
        return Substeps(self, first, found - n)

    def entries(self, first: int, last: int) -> list[HistoryEntry]:
        """Return the kept moments from `first` to `last`, both included."""
        return self._entries[first : last + 1]


class Substeps(History):
    """The last substeps of a run, one by one; `close` returns to the run as it was.

    history: of the run; first: of its moments, from which to repeat it; skipped: so many substeps
    at the start aren't kept.
    """

    unit = "substep"

    def __init__(self, history: History, first: int, skipped: int) -> None:
        self._history = history
        sim, report = history.sim, history.sim.last_report
        frames = history.entries(first, history.at)
        sim.restore(frames[0].snapshot)
        super().__init__(sim)
        for before, after in pairwise(frames):
            sim.restore(before.snapshot)
            # the step of the frame was snapped down to a whole number of them
            sim.controls = after.controls._replace(dt=after.dt)
            skip = min(max(skipped, 0), after.n_substeps - 1)
            skipped -= skip
            if skip > 0:
                sim.advance(skip * after.dt)
                self._entries.clear()
                self.keep(skip, after.dt)
            for _ in range(after.n_substeps - skip):
                if sim.advance(after.dt).diverged:
                    break
                self.keep(1, after.dt)
        # the very state of the run: its frames need not end on the last bit of their substeps
        self._entries[-1], self._series = frames[-1], {}
        sim.last_report = report
        self._at = -1
        self.go(self.n - 1)

    def close(self) -> None:
        """Return the simulation to the present moment of the run."""
        here = self._history.at
        self.sim.restore(self._history.entries(here, here)[0].snapshot)
