"""Run one scene frame by frame: log densities and pressures, watch it, film it, save it."""

from collections.abc import Iterator
from contextlib import nullcontext
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.checks import positive
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.warnings import short
from sph_gym.trajectory import Recorder
from sph_gym.view import Painter, Window, write_video

VIDEO_WIDTH, VIDEO_FPS = 960, 30


def run(
    sim: Simulation,
    seconds: float | None = None,
    n_logged: int = 3,
    color: str = "speed",
    arrows: bool = False,
    window: bool = False,
    video: str | None = None,
    save: str | None = None,
) -> int:
    """Run a simulation and show it; return 1 if it blew up, else 0.

    seconds: physical time [s], by default the scene's duration; n_logged: how many particles to
    log, spread evenly over the fluid; color, arrows: as for `Painter`; window: watch it, until
    the window is closed; video: film it there; save: where a `Recorder` puts the start and every
    frame. Warnings of the simulation are printed as they appear, and at the end in one line.
    Raises ValueError for wrong values and unknown names.
    """
    until = sim.scene.duration if seconds is None else positive("seconds", seconds)
    with nullcontext() if save is None else Recorder(save, sim) as recorder:
        frames = _frames(sim, until, n_logged, recorder)
        if video is not None:
            painter = Painter(sim.scene, size=VIDEO_WIDTH, color=color, arrows=arrows)
            pictures = (painter.paint(sim, title=sim.scene.name) for _ in frames)
            write_video(video, pictures, VIDEO_FPS)
            print(f"video: {video}")
        elif window:
            _watch(sim, frames, Window(sim.scene, color=color, arrows=arrows))
        else:
            for _ in frames:
                pass
    if sim.warnings:
        print(f"warnings: {', '.join(map(short, sim.warnings))}")
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
    sim: Simulation, until: float, n_logged: int, recorder: Recorder | None
) -> Iterator[None]:
    """Advance frame by frame, log and record after each; ends at `until` or with a blow-up."""
    logged = np.linspace(0, sim.n_fluid - 1, min(max(n_logged, 0), sim.n_fluid)).astype(int)
    print(_heading(logged))
    told = _tell(sim, set())
    if recorder is not None:
        recorder.record()
    while sim.time < until * (1 - 1e-9):
        report = sim.advance(min(sim.scene.frame, until - sim.time))
        print(_line(sim, report.n_substeps, logged))
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
