"""Run one scene frame by frame: log densities, pressures and gauges, watch, film and save it."""

import csv
import math
import os
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.files import atomic_write
from sph_gym.solver.checks import positive
from sph_gym.solver.gauges import Gauge
from sph_gym.solver.simulation import Report, Simulation
from sph_gym.solver.warnings import short
from sph_gym.trajectory import Recorder
from sph_gym.view import Painter, Window, write_video

VIDEO_WIDTH, VIDEO_FPS = 960, 30


class PictureStyle(NamedTuple):
    """The colour and arrows of a picture; as for `Painter`."""

    color: str = "speed"
    arrows: bool = False


class Readings:
    """The values of gauges over the time of a simulation, for the console and for a CSV file.

    path: of the CSV file, which appears when it is closed, also after an exception or Ctrl-C;
    every: longest time between two rows [s], by default a frame. Raises ValueError for gauges
    that the scene can't have, FileNotFoundError if there is no such directory.
    """

    def __init__(
        self,
        sim: Simulation,
        gauges: Sequence[Gauge] = (),
        path: str | os.PathLike[str] | None = None,
        every: float | None = None,
    ) -> None:
        if (path is not None or every is not None) and not gauges:
            raise ValueError("gauges: expected at least one, for a table or a time between rows")
        if path is not None and not Path(path).parent.is_dir():
            raise FileNotFoundError(f"gauges: expected a file in a folder, got {str(path)!r}")
        self._sim, self.gauges, self.path = sim, tuple(gauges), path
        self._every = math.inf if every is None else positive("every", every)
        self.columns = [name for gauge in self.gauges for name in gauge.columns]
        self.rows = [self._row()]

    def _row(self) -> list[float]:
        values = [value for gauge in self.gauges for value in gauge.read(self._sim).tolist()]
        return [self._sim.time, *values]

    def advance(self, seconds: float) -> Report:
        """Advance the simulation, in equal parts with a reading after each."""
        parts, n_substeps = max(math.ceil(seconds / self._every - 1e-9), 1), 0
        for _ in range(parts):
            report = self._sim.advance(seconds / parts)
            n_substeps += report.n_substeps
            if self.gauges:
                self.rows.append(self._row())
            if report.diverged:
                break
        return report._replace(n_substeps=n_substeps)

    def heading(self) -> list[str]:
        """Return the headings of the console's columns."""
        return [f"{name:>11}" for name in self.columns]

    def line(self) -> list[str]:
        """Return the last values, as wide as their headings."""
        widths = (max(len(name), 11) for name in self.columns)
        values = self.rows[-1][1:]
        return [f"{value:{width}.4g}" for value, width in zip(values, widths, strict=True)]

    def __enter__(self) -> "Readings":
        return self

    def __exit__(self, *exception: object) -> None:
        if self.path is None:
            return
        with (
            atomic_write(self.path, make_folder=False) as draft,
            Path(draft).open("w", newline="", encoding="utf-8") as file,
        ):
            csv.writer(file).writerows([["time [s]", *self.columns], *self.rows])


def run(
    sim: Simulation,
    seconds: float | None = None,
    n_logged: int = 3,
    readings: Readings | None = None,
    window: bool = False,
    video: str | None = None,
    save: str | None = None,
    **style: Any,
) -> int:
    """Run a simulation and show it; return 1 if it blew up, else 0.

    seconds: physical time [s], by default the scene's duration; n_logged: how many particles to
    log, spread evenly over the fluid; readings: of gauges, logged and recorded as well; window:
    watch it, until the window is closed; video: film it there; save: where a `Recorder` puts the
    start and every frame; style: the parts of a `PictureStyle`. Warnings of the simulation are
    printed as they appear, and at the end in one line. Raises ValueError for wrong values and
    unknown names.
    """
    until = sim.scene.duration if seconds is None else positive("seconds", seconds)
    readings = Readings(sim) if readings is None else readings
    shown = PictureStyle(**style)._asdict()
    kept = nullcontext() if save is None else Recorder(save, sim, readings.gauges)
    with readings, kept as recorder:
        frames = _frames(sim, until, n_logged, readings, recorder)
        if video is not None:
            painter = Painter(sim.scene, size=VIDEO_WIDTH, **shown)
            pictures = (painter.paint(sim, title=sim.scene.name) for _ in frames)
            write_video(video, pictures, VIDEO_FPS)
            print(f"video: {video}")
        elif window:
            _watch(sim, frames, Window(sim.scene, **shown))
        else:
            for _ in frames:
                pass
    if sim.warnings:
        print(f"warnings: {', '.join(map(short, sim.warnings))}")
    if readings.path is not None:
        print(f"gauges: {readings.path}")
    if save is not None:
        print(f"trajectory: {save}")
    return int(sim.last_report.diverged)


def _watch(sim: Simulation, frames: Iterator[None], window: Window) -> None:
    """Show frame by frame; leave the last one on the screen until the window is closed."""
    for _ in frames:
        window.show(sim)
        if window.closed:
            return
    window.wait_until_closed()


def _frames(
    sim: Simulation, until: float, n_logged: int, readings: Readings, recorder: Recorder | None
) -> Iterator[None]:
    """Advance frame by frame, log and record after each; ends at `until` or with a blow-up."""
    logged = np.linspace(0, sim.n_fluid - 1, min(max(n_logged, 0), sim.n_fluid)).astype(int)
    print("  ".join([_heading(logged), *readings.heading()]))
    told = _tell(sim, set())
    if recorder is not None:
        recorder.record()
    while sim.time < until * (1 - 1e-9):
        report = readings.advance(min(sim.scene.frame, until - sim.time))
        print("  ".join([_line(sim, report.n_substeps, logged), *readings.line()]))
        told = _tell(sim, told)
        if recorder is not None:
            recorder.record()
        yield
        if report.diverged:
            print(
                f"blew up: cause {report.cause}, first in the link {report.link!r}, "
                f"particle {report.bad_particle}, after {report.n_substeps} substeps of this frame"
            )
            return


def _tell(sim: Simulation, told: set[str]) -> set[str]:
    """Print the warnings of kinds that weren't told yet; return the kinds that were."""
    for warning in sim.warnings:
        if warning.kind not in told:
            print(f"warning: {warning.message}")
    return told | {warning.kind for warning in sim.warnings}


def _heading(logged: NDArray[Any]) -> str:
    columns = [f"rho/rho0 #{i}   p #{i} [Pa]" for i in logged]
    return "  ".join(["   t [s]  substeps  v_max [m/s]  density error", *columns])


def _line(sim: Simulation, n_substeps: int, logged: NDArray[Any]) -> str:
    numbers = sim.diagnostics()
    rho, p = sim.rho / sim.scene.fluid.rho0, sim.p
    start = (
        f"{sim.time:8.4f}  {n_substeps:8d}  {numbers['max_speed']:11.4f}  "
        f"{100 * numbers['density_error']:11.4f} %"
    )
    return "  ".join([start, *(f"{rho[i]:11.4f}  {p[i]:11.4g}" for i in logged)])
