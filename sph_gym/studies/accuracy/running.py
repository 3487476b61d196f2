"""One execution of a setting: its error, its work and its time."""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from sph_gym import scenes
from sph_gym.scenes.shared.reference import Reference, Run
from sph_gym.solver.simulation import Report, Simulation
from sph_gym.studies.accuracy import policies
from sph_gym.studies.accuracy.problems import RMS, Problem, share
from sph_gym.studies.accuracy.settings import Setting, build
from sph_gym.studies.timing import own_clock, pinned


class Outcome(NamedTuple):
    """One execution; measures: quantity, value and unit of everything that was judged.

    compression: mean over fluid and frames of max(rho / rho0 - 1, 0); mach: the largest speed over
    the sound speed of its moment; both of the ends of frames.
    """

    error: float
    cause: str
    measures: list[list[Any]]
    seconds: float
    particles: int
    substeps: int
    interactions: float
    compression: float
    mach: float
    wall: float
    own: float


class Meter:
    """Sets the controls of a simulation before each advance, and counts what it costs."""

    def __init__(self, sim: Simulation, controller: Callable[[Simulation], Any] | None) -> None:
        self.sim, self.controller = sim, controller
        self.wall = self.own = self.interactions = self.squeezed = self.mach = 0.0
        self.substeps = self.frames = 0
        self._clock, self._advance = own_clock(), sim.advance
        sim.advance = self.advance  # type: ignore[method-assign]

    def advance(self, seconds: float) -> Report:
        """As `Simulation.advance`, with the controller's time in it and the counting outside."""
        began, own = time.perf_counter(), self._clock()
        if self.controller is not None:
            self.sim.controls = self.controller(self.sim)
        report = self._advance(seconds)
        self.own += self._clock() - own
        self.wall += time.perf_counter() - began
        self.substeps += report.n_substeps
        self.interactions += report.n_substeps * float(self.sim.neighbor_counts.sum())
        self._look()
        return report

    def _look(self) -> None:
        """How far the fluid is from an incompressible one at the end of a frame."""
        sim = self.sim
        ratio = sim.rho[: sim.n_fluid] / sim.scene.fluid.rho0
        self.frames += 1
        self.squeezed += float(np.maximum(ratio - 1, 0.0).mean())
        self.mach = max(self.mach, sim.max_speed / sim.sound_speed)

    @property
    def compression(self) -> float:
        """The mean over all frames so far."""
        return self.squeezed / max(self.frames, 1)


def execute(
    problem: Problem,
    setting: Setting,
    other: int = 0,
    played: policies.Schedule | None = None,
) -> Outcome:
    """Run a setting from start to end, pinned to one core, on one thread.

    other: the case that nothing is fitted to; played: the controls of an agent. A blow-up is an
    outcome without an error. Raises ValueError for settings that the scene doesn't allow.
    """
    scene = build(problem, setting, other)
    with pinned():
        sim = Simulation(scene, setting.dtype, threads=1)
        _compile(sim, policies.controller(setting.controller, played))
        meter = Meter(sim, policies.controller(setting.controller, played))
        error, cause, measures = _judged(problem, sim)
    return Outcome(
        error, cause, measures, scene.duration, sim.n_particles, meter.substeps,
        meter.interactions, meter.compression, meter.mach, meter.wall, meter.own,
    )  # fmt: skip


def _compile(sim: Simulation, controller: Callable[[Simulation], Any] | None) -> None:
    """Let everything that a run calls be compiled; the state stays as it was.

    controller: one of its own, since some remember what they did.
    """
    home = sim.snapshot()
    sim.advance(sim.controls.dt)
    if controller is not None:
        sim.controls = controller(sim)
        sim.advance(sim.controls.dt)
    sim.restore(home)


def _judged(problem: Problem, sim: Simulation) -> tuple[float, str, list[list[Any]]]:
    reference = scenes.reference(problem.scene)
    assert reference is not None
    if problem.measure == RMS:
        reference = _watched(reference)
    try:
        run = reference.run(sim)
        measures = [[m.quantity, float(m.value), m.unit] for m in reference.judge(run)]
    except (RuntimeError, ArithmeticError, np.linalg.LinAlgError) as error:
        return math.nan, str(error) or repr(error), []
    return _error(problem, reference, run, measures), "", measures


def _watched(reference: Reference) -> Reference:
    """One that also observes the error of every frame."""

    def observe(sim: Simulation) -> dict[str, Any]:
        return {**reference.observe(sim), "frame_error": reference.error(sim)}

    return replace(reference, observe=observe)


def _error(problem: Problem, reference: Reference, run: Run, measures: list[list[Any]]) -> float:
    if problem.measure == RMS:
        errors = run.series("frame_error")
        return share(float(np.sqrt(np.nanmean(errors**2))), reference.unit)
    for quantity, value, unit in measures:
        if quantity == problem.measure:
            return share(value, unit)
    raise ValueError(
        f"{problem.scene}: expected arguments for which there is a reference, got {problem.given()}"
    )
