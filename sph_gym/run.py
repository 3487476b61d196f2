"""Run one scene frame by frame: log it, watch, film and save it; or watch what was saved."""

import math
import os
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.blowups import explain
from sph_gym.controllers import Controller
from sph_gym.extras import progress_bar, say
from sph_gym.files import target_path
from sph_gym.readings import Readings
from sph_gym.solver.checks import known, positive
from sph_gym.solver.report import Report
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.warnings import short
from sph_gym.trajectory import Recorder, read, recording_target
from sph_gym.view import History, Painter, Recording, Window, write_video
from sph_gym.view.colors import available, quantity
from sph_gym.view.video import ENDINGS

VIDEO_WIDTH, VIDEO_FPS = 960, 30
# Number of particles that are logged if none are named.
LOGGED = 3
# Characters of a time in a table of particles.
TIME_WIDTH = 12
BAD_START = "before the first step, the start is bad already:"


class Steering(NamedTuple):
    """Controllers of a run, which set the controls before every frame.

    name: of the one that begins, empty for constant controls; controllers: by name, the others are
    those to which the window can hand over.
    """

    name: str = ""
    controllers: Mapping[str, Controller] = MappingProxyType({})


UNSTEERED = Steering()


class PictureStyle(NamedTuple):
    """The colour and arrows of a picture; as for `Painter`."""

    color: str = "speed"
    arrows: bool = False


def run(
    sim: Simulation,
    seconds: float | None = None,
    n_logged: int = LOGGED,
    readings: Readings | None = None,
    window: bool = False,
    video: str | None = None,
    save: str | None = None,
    steering: Steering = UNSTEERED,
    **style: Any,
) -> int:
    """Run a simulation and show it; return 1 if it blew up or came to a break, else 0.

    seconds: physical time [s], by default the scene's duration; n_logged: how many particles to
    log, spread evenly over the fluid, where `readings` name none; readings: of gauges and
    particles, printed, those of gauges recorded as well; a break ends the run; window:
    watch it, until the window is closed; video: film it there; save: where a `Recorder` puts the
    start and every frame; steering: by a controller; style: the parts of a `PictureStyle`. Warnings
    of the simulation are printed as they appear, and at the end in one line. Raises ValueError for
    wrong values and unknown names.
    """
    until = sim.scene.duration if seconds is None else positive("seconds", seconds)
    readings = Readings(sim) if readings is None else readings
    shown = PictureStyle(**style)._asdict()
    # wrong words about pictures are told before anything is computed, or if there are no pictures
    quantity(shown["color"])
    check_targets(video, save)
    kept = nullcontext() if save is None else Recorder(save, sim, readings.gauges)
    try:
        with readings, kept as recorder:
            # the window does the steering itself: there, others can take over
            steer = None if window else steering.controllers.get(steering.name)
            course = Course(sim, until, n_logged, readings, recorder, steer)
            if video is not None:
                painter = Painter(sim.scene, size=VIDEO_WIDTH, **shown)
                pictures = (painter.paint(sim, title=sim.scene.name) for _ in course)
                write_video(video, pictures, VIDEO_FPS)
                print(f"video: {video}")
            elif window:
                view = Window(sim.scene, controllers=steering.controllers, **shown)
                _watch(course, view, steering.name)
            else:
                for _ in course:
                    pass
    except KeyboardInterrupt:
        # the files are complete up to here
        _tell_files(readings, save)
        raise
    if sim.warnings:
        print(f"warnings: {', '.join(map(short, sim.warnings))}")
    _tell_files(readings, save)
    return int(sim.last_report.diverged or readings.offender is not None)


def check_targets(video: str | None, save: str | None) -> None:
    """Raise what `run` raises if a film or a recording can't be written there."""
    if video is not None:
        target_path("video", video, ENDINGS)
    if save is not None:
        recording_target(save, "save")


def _tell_files(readings: Readings, save: str | None) -> None:
    """Print which files a run has written."""
    if readings.path is not None:
        print(f"table: {readings.path}")
    if save is not None:
        print(f"trajectory: {save}")


def replay(path: str | os.PathLike[str], **style: Any) -> int:
    """Show a recording in a window until that is closed, and return 0.

    path: what `run(save=...)` or `doctor.watch` wrote; style: the parts of a `PictureStyle`. Raises
    ValueError for other contents and for a colour that was not recorded, OSError if the file can't
    be opened, ImportError that names the extra to install.
    """
    recording, shown = Recording(read(path)), PictureStyle(**style)
    known("color", shown.color, available(recording.state))
    for line in describe_recording(path, recording):
        print(line)
    window = Window(recording.scene, bounds=recording.bounds, **shown._asdict())
    message, tripped = estimates(recording), recording.tripped
    if tripped is not None:
        message = f"{tripped['message']}".partition("\n")[0] + (message and f" ({message})")
        recording.go(recording.n - 1)
        window.paused, particle = True, int(tripped["particle"])
        window.picked = particle if 0 <= particle < recording.n_fluid else None
    window.play(recording, message)
    return 0


def estimates(recording: Recording) -> str:
    """Return which numbers of the scene are estimated, empty if the recording has them all."""
    names = ", ".join(recording.estimated)
    return f"not recorded, so estimated: {names}" if names else ""


def describe_recording(path: str | os.PathLike[str], recording: Recording) -> list[str]:
    """Return lines about what is in a recording."""
    first, last = recording.time(0), recording.time(recording.n - 1)
    shown = f"{recording.n} {recording.unit}s from t = {first:.6g} s to {last:.6g} s"
    lines = [f"{path}: {recording.scene.name}, {recording.n_fluid} particles, {shown}"]
    return [line for line in (*lines, estimates(recording)) if line]


def _watch(course: "Course", window: Window, steered: str) -> None:
    """Show the run in a window until that is closed."""
    readings = course.readings
    history = History(
        course.sim,
        course.advance,
        course.rewind,
        more=lambda: dict(zip(readings.columns, readings.rows[-1][1:], strict=True)),
        offender=lambda: readings.offender,
    )
    offender, message = readings.offender, ""
    if offender is not None:
        window.paused, window.picked = True, offender.particle
        message = f"{BAD_START} {offender}"
    window.play(history, message, steered)


class Course:
    """A run frame by frame: each is logged, printed and recorded.

    until: the time at which it ends [s], unless a break or a blow-up ends it before; n_logged,
    readings: as for `run`; recorder: of the start and every frame; steer: sets the controls before
    every frame. Iterating runs to the end, with a progress bar. What there is to break on is looked
    for before the first step, too.
    """

    def __init__(
        self,
        sim: Simulation,
        until: float,
        n_logged: int,
        readings: Readings,
        recorder: Recorder | None,
        steer: Controller | None = None,
    ) -> None:
        self.sim, self.readings, self._steer = sim, readings, steer
        self._until, self._recorder = until, recorder
        self._logged = spread(sim, n_logged)
        self._ended, self._latest = False, sim.time
        self._told: set[str] = set()
        self._n_printed = 0
        say("  ".join([_heading(self._logged, readings), *readings.heading()]))
        self._tell()
        self._record()
        self._look_at_start()

    def _look_at_start(self) -> None:
        """End the run before its first step if there is an offender: no step is to blame for it."""
        readings = self.readings
        if readings.break_on is not None:
            readings.offender = readings.break_on.find()
        if readings.offender is not None:
            self._ended = True
            say(BAD_START)
            _tell_end(self.sim.last_report, readings)

    def __iter__(self) -> Iterator[None]:
        frames = math.ceil((self._until - self.sim.time) / self.sim.scene.frame - 1e-9)
        with progress_bar(max(frames, 0), self.sim.scene.name, "frame") as bar:
            while self.advance() is not None:
                bar.update()
                yield

    def advance(self) -> Report | None:
        """Run for a frame and return its report; None if the run is over."""
        sim, readings = self.sim, self.readings
        if self._ended or sim.time >= self._until * (1 - 1e-9):
            return None
        if self._steer is not None:
            sim.controls = self._steer(sim)
        report = readings.advance(min(sim.scene.frame, self._until - sim.time))
        self._print(report)
        self._tell()
        self._record()
        self._ended = report.diverged or readings.offender is not None
        if self._ended:
            _tell_end(report, readings)
        self._latest = sim.time
        return report

    def rewind(self) -> None:
        """Let the run go on from the present state of the simulation, which may be an earlier one.

        What was recorded of the time after it stays in the file, and what comes now follows it.
        """
        self._ended = False
        self.readings.forget()
        self._n_printed = min(self._n_printed, len(self.readings.rows))
        if self.sim.time < self._latest:
            say(f"went back to t = {self.sim.time:.6g} s")

    def _print(self, report: Report) -> None:
        readings = self.readings
        if readings.log is None:
            line = _line(self.sim, report.n_substeps, self._logged)
            say("  ".join([line, *readings.line()]))
            return
        for k in range(self._n_printed, len(readings.rows)):
            say("  ".join([f"{readings.rows[k][0]:{TIME_WIDTH}.6g}", *readings.line(k)]))
        self._n_printed = len(readings.rows)

    def _tell(self) -> None:
        """Print the warnings of kinds that weren't told yet."""
        for warning in self.sim.warnings:
            if warning.kind not in self._told:
                say(f"warning: {warning.message}")
                self._told.add(warning.kind)

    def _record(self) -> None:
        if self._recorder is not None:
            self._recorder.record()


def spread(sim: Simulation, n: int = LOGGED) -> NDArray[Any]:
    """Return the indices of n particles, spread evenly over the fluid; of all if there are less."""
    return np.linspace(0, sim.n_fluid - 1, min(max(n, 0), sim.n_fluid)).astype(int)


def _tell_end(report: Report, readings: Readings) -> None:
    """Print why the run ended early."""
    words = ""
    if report.diverged:
        words = f"{explain(report)}. It was substep {report.n_substeps} of this frame"
    if readings.break_on is None or readings.offender is None:
        say(words)
        return
    first, *table = readings.break_on.describe(readings.offender)
    # the last finite state of a blow-up has no value that would show it
    say(f"break: {words}. The table is of the last finite state:" if words else first)
    say("\n".join(table))


def _heading(logged: NDArray[Any], readings: Readings) -> str:
    if readings.log is not None:
        return f"{'t [s]':>{TIME_WIDTH}}"
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
