"""Runs of a setting: error, work and processor time, and the benchmark that measures a machine."""

import math
import time
from functools import cache
from typing import NamedTuple

import numpy as np

from sph_gym import scenes
from sph_gym.controllers import Controller
from sph_gym.recommend.settings import FIXED, RULES, Setting, build
from sph_gym.scenes.shared.reference import Measure
from sph_gym.scenes.shared.refinement import RMS, Refinement, share
from sph_gym.solver.simulation import Report, Simulation
from sph_gym.solver.state import Controls
from sph_gym.timing import Runner, own_clock, pinned

# Fluid particles of the benchmark's dam break, and particle-steps of one timed call.
SIZE, WORK = 1000, 200_000
# Seconds of a benchmark: of one by itself, and of one beside a run.
CAREFUL, BRIEF = 2.0, 0.05

# Controls [dt, stiffness, xsph] of every frame.
Schedule = list[list[float]]


class RunOutcome(NamedTuple):
    """One run.

    error: a share, NaN after a blow-up; cause: of the blow-up; seconds: of physical time;
    particles: fluid and wall; interactions: pairs (i, j) of all force evaluations; compression:
    mean over fluid and frames of max(rho / rho0 - 1, 0); mach: the largest speed over the sound
    speed of its moment; both at the ends of frames; wall, own: seconds by the clock and of
    processor time.
    """

    error: float
    cause: str
    seconds: float
    particles: int
    substeps: int
    interactions: float
    compression: float
    mach: float
    wall: float
    own: float


class Meter:
    """Sets the controls of a simulation before each advance, and measures what it costs."""

    def __init__(self, sim: Simulation, controller: Controller | None = None) -> None:
        self.sim, self.controller = sim, controller
        self.wall = self.own = self.interactions = self.mach = self._compressions = 0.0
        self.substeps = self._frames = 0
        self._clock, self._advance = own_clock(), sim.advance
        sim.advance = self.advance  # type: ignore[method-assign]

    def advance(self, seconds: float) -> Report:
        """Advance as `Simulation.advance`; the controller is timed too, the measuring isn't."""
        began, own = time.perf_counter(), self._clock()
        if self.controller is not None:
            self.sim.controls = self.controller(self.sim)
        report = self._advance(seconds)
        self.own += self._clock() - own
        self.wall += time.perf_counter() - began
        self.substeps += report.n_substeps
        sim = self.sim
        self.interactions += report.n_substeps * float(sim.neighbor_counts.sum())
        ratio = sim.rho[: sim.n_fluid] / sim.scene.fluid.rho0
        self._frames += 1
        self._compressions += float(np.maximum(ratio - 1, 0.0).mean())
        self.mach = max(self.mach, sim.max_speed / sim.sound_speed)
        return report

    @property
    def compression(self) -> float:
        """Mean over all frames so far."""
        return self._compressions / max(self._frames, 1)


def execute(
    case: Refinement, setting: Setting, other: int = 0, schedule: Schedule | None = None
) -> RunOutcome:
    """Run a setting from start to end, pinned to one core, on one thread.

    other: which of the other cases, 0 for none; schedule: the controls of an agent. A blow-up is
    an outcome without an error. Raises ValueError for settings that the scene doesn't allow.
    """
    scene = build(case, setting, other)
    with pinned():
        sim = Simulation(scene, setting.dtype, threads=1)
        compile_ahead(sim, _controller(setting.controller, schedule))
        meter = Meter(sim, _controller(setting.controller, schedule))
        error, cause = _judge(case, sim)
    return RunOutcome(
        error, cause, scene.duration, sim.n_particles, meter.substeps, meter.interactions,
        meter.compression, meter.mach, meter.wall, meter.own,
    )  # fmt: skip


def _controller(name: str, schedule: Schedule | None) -> Controller | None:
    """Return what sets the controls in every frame; None where they stay as they are."""
    if name == FIXED:
        return None
    if name in RULES:
        return RULES[name]()
    assert schedule
    frames = iter(schedule)
    return lambda sim: Controls(*next(frames, schedule[-1]))


def compile_ahead(sim: Simulation, controller: Controller | None = None) -> None:
    """Compile everything that a run calls; the state stays as it was.

    controller: another one than that of the run, since some remember what they did.
    """
    start = sim.snapshot()
    sim.advance(sim.controls.dt)
    if controller is not None:
        sim.controls = controller(sim)
        sim.advance(sim.controls.dt)
    sim.evaluate()
    sim.diagnostics()
    sim.restore(start)


def _judge(case: Refinement, sim: Simulation) -> tuple[float, str]:
    """Run to the end; return the error, and the cause of a blow-up."""
    reference = scenes.reference(case.scene)
    assert reference is not None
    errors: list[float] = []

    def look(share: float = 0.0) -> None:
        if case.measure == RMS:
            errors.append(reference.error(sim))

    try:
        look()
        measures = reference.judge(reference.run(sim, look))
    except (RuntimeError, ArithmeticError, np.linalg.LinAlgError) as error:
        return math.nan, str(error) or repr(error)
    if case.measure == RMS:
        mean = float(np.sqrt(np.nanmean(np.square(errors))))
        measures = [Measure(RMS, mean, reference.unit)]
    for found in measures:
        if found.quantity == case.measure:
            return share(float(found.value), found.unit), ""
    raise ValueError(
        f"{case.scene}: expected arguments for which there is a reference, got {case.given()}"
    )


@cache
def _benchmark() -> Runner:
    scene = scenes.make("dam_break", dx=(2.0 / SIZE) ** 0.5, width=1.0, height=2.0, tank=4.0)
    runner = Runner(scene, work=WORK)
    runner.home = runner.sim.engine.state()
    return runner


def rate(seconds: float = BRIEF) -> float:
    """Return the present speed of this machine: particle-steps of a small dam break per second.

    The median of calls for so many seconds of processor time, on one pinned thread.
    """
    runner, clock, steps = _benchmark(), own_clock(), list[float]()
    while not steps or sum(steps) * runner.n_steps < seconds:
        steps.append(runner.seconds(clock))
    return runner.sim.n_particles / float(np.median(steps))
