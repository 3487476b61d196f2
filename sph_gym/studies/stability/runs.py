"""A case in one of its variants, from start to end: what became of it, in numbers."""

import math
import time
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from sph_gym.scenes import hydrostatic_tank
from sph_gym.scenes.shared import tanks
from sph_gym.solver.simulation import Report, Simulation
from sph_gym.studies.stability import checks
from sph_gym.studies.stability.case import Case, Variant, held_by_box

# Frames over which one and two threads, and grid and brute force, are compared.
COMPARED = 3
# Of particles, above which brute force is asked about some of them only.
AFFORDABLE = 3000


class Outcome(NamedTuple):
    """What became of a run; the worst of all sizes, and of all frames.

    substeps; step: the largest, in stable ones; blowups: reported ones; cause: of the first;
    silent: frames in which something went wrong without a report, or with one that doesn't say
    what; passed: most particles on the wrong side of a wall; held: most that only the box holds;
    happened: what the case asks for; excess: energy from nowhere, as a
    share of what is at stake; rise: the most that it ever rose above the least before; kinetic:
    the most energy of motion that a fluid at rest has [m g H]; drift: of the momentum, as a share
    of mass times largest speed;
    gain: largest mean compression beyond that of the start; burst: the largest from the end of
    the first frame on; density: the largest of the second half; p99: its 99th percentile;
    clumping: largest share of particles closer than 0.6 dx in the second half; peak: largest
    density of the second half [rho0]; lowest, highest: smallest and largest
    density, in multiples of a lonely particle's; left: smallest density, as a share of the
    smallest of the start; typical: smallest median density [rho0]; fastest: [m/s]; threads: fields
    that differ between one thread and two; grid: largest difference of the evaluation by grid and
    by brute force; observables: difference of runs by grid and by brute force; unlike: of the end
    from that of the case that it must be like, clumped: how many more particles are close there;
    -inf where they weren't compared; seconds: wall clock.
    """

    substeps: int = 0
    step: float = 0.0
    blowups: int = 0
    cause: str = ""
    silent: int = 0
    passed: int = 0
    held: int = 0
    happened: float = math.inf
    excess: float = -math.inf
    rise: float = 0.0
    kinetic: float = 0.0
    drift: float = 0.0
    gain: float = 0.0
    burst: float = 0.0
    density: float = 0.0
    p99: float = 0.0
    clumping: float = 0.0
    peak: float = 0.0
    lowest: float = math.inf
    highest: float = 0.0
    left: float = math.inf
    typical: float = math.inf
    fastest: float = 0.0
    threads: int = 0
    grid: float = -math.inf
    observables: float = -math.inf
    unlike: float = -math.inf
    clumped: float = -math.inf
    seconds: float = 0.0


# Which of two is the worse; what is no number is worst of all, which Python's max overlooks.
_WORSE: dict[str, Any] = {
    "substeps": lambda a, b: a + b,
    "blowups": lambda a, b: a + b,
    "cause": lambda a, b: a or b,
    "silent": lambda a, b: a + b,
    "happened": lambda a, b: float(np.minimum(a, b)),
    "lowest": lambda a, b: float(np.minimum(a, b)),
    "left": lambda a, b: float(np.minimum(a, b)),
    "typical": lambda a, b: float(np.minimum(a, b)),
    "seconds": lambda a, b: a + b,
}


def _larger(a: float, b: float) -> float:
    return type(a)(np.maximum(a, b))


def worst(one: Outcome, other: Outcome) -> Outcome:
    """Both in one: sums of what is counted, the worse of what is measured."""
    values = (
        _WORSE.get(name, _larger)(getattr(one, name), getattr(other, name)) for name in one._fields
    )
    return Outcome(*values)


def run(case: Case, variant: Variant, quick: bool = False) -> Outcome:
    """All sizes of a case in a variant; quick: fewer frames, and every tenth size."""
    began, found = time.perf_counter(), Outcome()
    for size in case.sizes[:: 10 if quick else 1]:
        found = worst(found, _Run(case, variant, size, quick).outcome())
    return found._replace(seconds=time.perf_counter() - began)


class _Run:
    """One simulation of a case."""

    def __init__(self, case: Case, variant: Variant, size: Any, quick: bool) -> None:
        self.case, self.variant, self.size, self.quick = case, variant, size, quick
        self.dtype, self.frames = case.precision(variant), case.lasts(variant, quick)
        self.scene = case.scene(variant, size, quick)
        self.sim = Simulation(self.scene, self.dtype, threads=1)
        self.start = self.sim.diagnostics()["density_error"], self._least()
        self._least_surplus = self.sim.energy_surplus
        self._taken: WeakKeyDictionary[Simulation, int] = WeakKeyDictionary()
        self._begin: tuple[int, dict[str, Any] | None] = 0, None

    def advance(self, sim: Simulation) -> Report:
        """About a frame, with the controls that the case sets: as many steps as there is room for.

        Not just a frame, into which no long step fits as it is.
        """
        self._set_controls(sim)
        dt = sim.controls.dt
        return sim.advance(max(round(self.scene.frame / dt), 1) * dt)

    def _set_controls(self, sim: Simulation) -> None:
        frame = self._taken.get(sim, 0)
        self._taken[sim] = frame + 1
        sim.controls = self.case.steer(sim, frame)
        # at the stiffness that is set; to set it for this only would count as energy at stake
        self.stable = sim.stable_dt()

    def _twin(self, neighbors: str = "grid", threads: int = 1) -> Simulation:
        """Another simulation, at the moment from which runs are compared."""
        sim = Simulation(self.scene, self.dtype, neighbors, threads=threads)
        self._taken[sim], state = self._begin
        if state is not None:
            sim.restore(state)
        return sim

    def outcome(self) -> Outcome:
        """Run it, look at every frame, then compare."""
        found = worst(self._look(Report(0, 0.0), 0), self._compare())
        start, mass = checks.momentum(self.sim), self.sim.mass * self.sim.n_fluid
        for frame in range(self.frames):
            if frame == max(self.frames // 4, 1):
                # not only the hard start itself, but what became of it
                self._begin = frame, self.sim.snapshot()
                found = worst(found, self._compare())
            found = worst(found, self._frame(frame))
            if found.blowups:
                break
        drift = float(np.hypot(*(checks.momentum(self.sim) - start)))
        share = drift / (mass * max(found.fastest, 1e-3 * self.scene.fluid.c0))
        found = found._replace(drift=share, happened=self._happened())
        return worst(worst(found, self._exactness()), self._beside(found.clumping))

    def _frame(self, frame: int) -> Outcome:
        """The next one, and how long its steps were, in stable ones of its start."""
        report = self.advance(self.sim)
        return self._look(report, frame)._replace(step=report.dt / self.stable)

    def _happened(self) -> float:
        """What the case asks for, since the start."""
        start = Simulation(self.scene, self.dtype, threads=1)
        return self.case.event.measure(start, self.sim)

    def _beside(self, clumping: float) -> Outcome:
        """What of it differs from the case that it must be like."""
        if self.case.twin is None:
            return Outcome()
        twin = self.case.twin._replace(frames=self.case.frames, quick=self.case.quick)
        other = _Run(twin, self.variant, self.size, self.quick)
        close = max(other._look(other.advance(other.sim), k).clumping for k in range(self.frames))
        gap = checks.moved_gap(self.scene, self.sim, other.scene, other.sim)
        return Outcome(unlike=gap, clumped=clumping - close)

    def _look(self, report: Report, frame: int) -> Outcome:
        sim = self.sim
        numbers = sim.diagnostics()
        late = 2 * frame >= self.frames
        surplus = sim.energy_surplus
        self._least_surplus = min(self._least_surplus, surplus)
        return Outcome(
            substeps=report.n_substeps,
            blowups=int(report.diverged),
            cause=report.cause,
            silent=int(checks.is_silent(sim, report)),
            passed=self.case.passed(sim),
            held=held_by_box(sim),
            excess=numbers["energy_excess"],
            rise=(surplus - self._least_surplus) / sim.energy_at_stake,
            kinetic=self._unrest(numbers["kinetic_energy"]),
            gain=numbers["density_error"] - self.start[0],
            burst=numbers["density_error"] if report.n_substeps else 0.0,
            density=numbers["density_error"] if late else 0.0,
            p99=numbers["density_error_p99"] if late else 0.0,
            clumping=numbers["clumping"] if late else 0.0,
            peak=self._most() if late else 0.0,
            lowest=self._least() / checks.least_possible(sim),
            highest=self._most() / checks.least_possible(sim),
            left=self._least() / self.start[1],
            typical=self._median(),
            fastest=numbers["max_speed"],
        )

    def _least(self) -> float:
        """The smallest rho / rho0."""
        return float(self.sim.rho[: self.sim.n_fluid].min()) / self.scene.fluid.rho0

    def _most(self) -> float:
        """The largest rho / rho0."""
        return float(self.sim.rho[: self.sim.n_fluid].max()) / self.scene.fluid.rho0

    def _unrest(self, kinetic: float) -> float:
        """Kinetic energy [m g H] of what should be at rest by now."""
        if self.case.calm is None or self.sim.time < self.case.calm[0]:
            return 0.0
        return kinetic / (tanks.weight(self.sim) * hydrostatic_tank.depth_of(self.scene))

    def _median(self) -> float:
        """rho / rho0 of the particle in the middle."""
        return float(np.median(self.sim.rho[: self.sim.n_fluid])) / self.scene.fluid.rho0

    def _exactness(self) -> Outcome:
        """How far grid and brute force are apart on the present state, of all or of a sample."""
        gap = checks.grid_gap if self._affordable else checks.sample_gap
        return Outcome(grid=gap(self.sim))

    @property
    def _affordable(self) -> bool:
        return self.sim.n_particles <= AFFORDABLE

    def _compare(self) -> Outcome:
        """The present state by brute force, and how it goes on on two threads and without grid."""
        frames = min(COMPARED, self.frames)
        found = Outcome(threads=checks.threads_differ(self._twin, self.advance, frames))
        found = worst(found, self._exactness())
        if self.dtype != "float64" or not self._affordable:
            return found
        return worst(found, Outcome(observables=checks.run_gap(self._twin, self.advance, frames)))
