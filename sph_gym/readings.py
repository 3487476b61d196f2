"""Values of gauges and particles over a run, for the console and for a table."""

import math
import os
from collections.abc import Sequence
from typing import NamedTuple

from sph_gym.files import target_path, write_csv
from sph_gym.solver.break_on import BreakOn
from sph_gym.solver.checks import positive, whole
from sph_gym.solver.gauges import Gauge
from sph_gym.solver.offender import Offender
from sph_gym.solver.particle_log import ParticleLog
from sph_gym.solver.report import Report, count_substeps
from sph_gym.solver.simulation import Simulation


class Every(NamedTuple):
    """Largest distance between rows of a table. number: of "s", seconds, or "steps", substeps."""

    number: float
    unit: str = "s"

    @classmethod
    def parse(cls, text: str, unit: str = "s") -> "Every":
        """Return the distance of a text such as "0.002s", "5steps", or a number in `unit`.

        Raises ValueError for other texts, and for what is no whole number of steps above 0.
        """
        number, wanted = text.strip(), unit
        for ending, name in (("steps", "steps"), ("step", "steps"), ("s", "s")):
            if number.endswith(ending):
                number, wanted = number[: -len(ending)], name
                break
        try:
            value = float(number)
        except ValueError:
            raise ValueError(
                f"every: expected seconds such as 0.002s or substeps such as 5steps, got {text!r}"
            ) from None
        value = whole("every", value, at_least=1) if wanted == "steps" else positive("every", value)
        return cls(value, wanted)

    def parts(self, seconds: float, dt: float) -> list[float]:
        """Return the parts [s] of a time, after each of which there is a row; dt: of a step [s]."""
        if self.unit == "s":
            n = max(math.ceil(seconds / self.number - 1e-9), 1)
            return [seconds / n] * n
        n_steps, step = count_substeps(seconds, dt), int(self.number)
        exact = seconds / n_steps
        rest = n_steps % step
        return [exact * step] * (n_steps // step) + [exact * rest] * (rest > 0)


class Readings:
    """The values of gauges and particles over time, for the console and for a CSV file.

    path: of the CSV file, which appears when it is closed, also after an exception or Ctrl-C;
    every: at most so far apart are two rows, by default a frame, which ends with one in any case;
    log: particles to read with the gauges; break_on:
    what to stop at; it is looked for after every row, after every step if `every` isn't given.
    `n_substeps` counts all substeps.
    Raises ValueError for gauges and particles that the scene can't have, FileNotFoundError if
    there is no such directory.
    """

    def __init__(
        self,
        sim: Simulation,
        gauges: Sequence[Gauge] = (),
        path: str | os.PathLike[str] | None = None,
        every: Every | None = None,
        log: ParticleLog | None = None,
        break_on: BreakOn | None = None,
    ) -> None:
        if path is not None and not gauges and log is None:
            raise ValueError("gauges: expected at least one, or quantities to log, for a table")
        if every is not None and not gauges and log is None and break_on is None:
            raise ValueError(
                "every: expected a gauge, quantities to log or a condition to break on"
            )
        if path is not None:
            target_path("gauges", path)
        self._sim, self.gauges, self.path = sim, tuple(gauges), path
        self._every, self.log, self.break_on = every, log, break_on
        self.offender: Offender | None = None
        self.n_substeps = 0
        if log is not None:
            log.check(sim)
        self._read = (*self.gauges, *(() if log is None else (log,)))
        self.columns = [name for each in self._read for name in each.columns]
        self.rows = [self._row()]

    def _row(self) -> list[float]:
        values = [value for each in self._read for value in each.read(self._sim).tolist()]
        return [self._sim.time, *values]

    def advance(self, seconds: float) -> Report:
        """Advance the simulation in parts, with a reading after each, up to the first offender."""
        every, n_substeps = self._every, 0
        if every is None and self.break_on is not None:
            every = Every(1, "steps")
        dt = self._sim.controls.dt
        for part in [seconds] if every is None else every.parts(seconds, dt):
            report = self._sim.advance(part)
            n_substeps += report.n_substeps
            if self.break_on is not None:
                self.offender = self.break_on.find()
            ends = report.diverged or self.offender is not None
            if self._read and (self._every is not None or ends):
                self.rows.append(self._row())
            if ends:
                break
        else:
            if self._read and self._every is None:
                self.rows.append(self._row())
        self.n_substeps += n_substeps
        return report._replace(n_substeps=n_substeps)

    def forget(self) -> None:
        """Drop what was read and found after the present time: the run goes on from an earlier one.

        The offender is forgotten in any case, for the run goes on.
        """
        self.offender = None
        self.rows = [row for row in self.rows if row[0] <= self._sim.time]

    def heading(self) -> list[str]:
        """Return the headings of the console's columns."""
        return [f"{name:>11}" for name in self.columns]

    def line(self, k: int = -1) -> list[str]:
        """Return the values of row k, the last one by default, as wide as their headings."""
        widths = (max(len(name), 11) for name in self.columns)
        values = self.rows[k][1:]
        return [f"{value:{width}.5g}" for value, width in zip(values, widths, strict=True)]

    def __enter__(self) -> "Readings":
        return self

    def __exit__(self, *exception: object) -> None:
        if self.path is not None:
            write_csv(self.path, ["time [s]", *self.columns], self.rows)
