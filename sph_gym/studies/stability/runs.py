"""Runs of cases, from start to end, and the rows of the table that they make."""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Report, Simulation
from sph_gym.studies.results import as_record
from sph_gym.studies.stability import checks
from sph_gym.studies.stability.case import HardCase, Variant
from sph_gym.studies.stability.checks import (
    BY_NAME,
    CHECKS,
    COMPARISON,
    END,
    FRAME,
    LATE,
    CaseCheck,
)
from sph_gym.studies.stability.events import see
from sph_gym.studies.stability.limits import as_limit, known_limit
from sph_gym.studies.table import Row


class CaseOutcome(NamedTuple):
    """Numbers of a run, or of the runs of all sizes together.

    substeps, blowups: how many; cause: of the first blow-up; values: of checks, by name.
    """

    substeps: int
    blowups: int
    cause: str
    values: dict[str, float]


def outcome(stored: Any) -> CaseOutcome:
    """Return an outcome from JSON. Raises ValueError if it wasn't measured at all moments."""
    found = as_record(CaseOutcome)(stored)
    if not {"silent", "grid", "happened"} <= found.values.keys() <= BY_NAME.keys():
        raise ValueError(f"expected values of checks at all moments, got {found.values}")
    return found._replace(values={name: float(value) for name, value in found.values.items()})


def run(case: HardCase, variant: Variant, quick: bool = False) -> CaseOutcome:
    """Run all sizes of a case in a variant; quick: fewer frames, and every tenth size."""
    found = CaseOutcome(0, 0, "", {})
    for size in case.sizes[:: 10 if quick else 1]:
        one = CaseRun(case, variant, size, quick).play()
        found = CaseOutcome(
            found.substeps + one.substeps,
            found.blowups + one.blowups,
            found.cause or one.cause,
            checks.fold(found.values, one.values),
        )
    return found


class CaseRun:
    """One simulation of a case, as the checks see it.

    sim, scene, dtype: what runs; report: of the last frame; stable_dt: the stable step [s] at its
    start; numbers: diagnostics after it; began: those of the start, momentum (2,) [kg/s] and
    least_density [rho0] too; fastest: largest speed so far [m/s]; energy_rise: of the spurious
    energy above the least before, as a share of what is at stake; values: of checks, so far.
    """

    def __init__(
        self, case: HardCase, variant: Variant, size: Any = None, quick: bool = False
    ) -> None:
        self.case: HardCase = case
        self.variant, self.size, self.quick = variant, size, quick
        self.dtype: str = case.precision(variant)
        self.frames: int = case.n_frames(variant, quick)
        self.scene: Scene = case.scene(variant, size, quick)
        self.sim: Simulation = Simulation(self.scene, self.dtype, threads=1)
        self.momentum: Any = checks.momentum(self.sim)
        self.least_density: float = self.density(np.min)
        self.report: Report = Report(0, 0.0)
        self.stable_dt: float = math.inf
        self.substeps, self.fastest = 0, 0.0
        self.energy_rise: float = 0.0
        self.values: dict[str, float] = {}
        self._least_surplus = self.sim.energy_surplus
        self._frames_done: WeakKeyDictionary[Simulation, int] = WeakKeyDictionary()
        self._branch: tuple[int, dict[str, Any] | None] = 0, None
        self.look()
        self.began: dict[str, float] = self.numbers

    def play(self) -> CaseOutcome:
        """Run it to its end or its blow-up, look at every frame, compare it with others."""
        self._measure(FRAME)
        self._measure(COMPARISON)
        for frame in range(self.frames):
            if frame == max(self.frames // 4, 1):
                # not only the hard start itself, but what became of it
                self.branch(frame)
                self._measure(COMPARISON)
            self.step(frame)
            if self.report.diverged:
                break
        self._measure(END)
        return CaseOutcome(self.substeps, int(self.report.diverged), self.report.cause, self.values)

    def step(self, frame: int) -> None:
        """Run the next frame, and look at it."""
        self.report = self.advance(self.sim)
        self.look()
        self._measure(FRAME)
        if 2 * frame >= self.frames:
            self._measure(LATE)

    def advance(self, sim: Simulation) -> Report:
        """Run about a frame, with the controls of the case: as many steps as there is room for.

        Not just a frame, into which no long step fits as it is.
        """
        frame = self._frames_done.get(sim, 0)
        self._frames_done[sim] = frame + 1
        sim.controls = self.case.steer(sim, frame)
        # at the stiffness that is set; to set it for this only would count as energy at stake
        self.stable_dt = sim.stable_dt()
        dt = sim.controls.dt
        return sim.advance(max(round(self.scene.frame / dt), 1) * dt)

    def look(self) -> None:
        """Bring the numbers up to date with the simulation."""
        self.numbers: dict[str, float] = self.sim.diagnostics()
        self.fastest = max(self.fastest, self.numbers["max_speed"])
        self.substeps += self.report.n_substeps
        surplus = self.sim.energy_surplus
        self._least_surplus = min(self._least_surplus, surplus)
        self.energy_rise = (surplus - self._least_surplus) / self.sim.energy_at_stake

    def _measure(self, moment: tuple[str, ...]) -> None:
        self.values = checks.fold(self.values, checks.measure(self, moment))

    def branch(self, frame: int) -> None:
        """Let copies go on from the present state, which `frame` frames have led to."""
        self._branch = frame, self.sim.snapshot()

    def copy(self, neighbors: str = "grid", threads: int = 1) -> Simulation:
        """Return another simulation, at the moment from which runs are compared."""
        sim = Simulation(self.scene, self.dtype, neighbors, threads=threads)
        self._frames_done[sim], state = self._branch
        if state is not None:
            sim.restore(state)
        return sim

    @cached_property
    def twin(self) -> "CaseRun | None":
        """The run of the case that it must be like, at its end; None if there is none."""
        if self.case.twin is None:
            return None
        case = self.case.twin._replace(frames=self.case.frames, quick=self.case.quick)
        twin = CaseRun(case, self.variant, self.size, self.quick)
        for frame in range(self.frames):
            twin.step(frame)
        return twin

    def happened(self) -> float:
        """Return how much of the event of the case has happened since the start."""
        start = see(Simulation(self.scene, self.dtype, threads=1))
        return self.case.event.measure(start, see(self.sim))

    def density(self, extreme: Any) -> float:
        """Return a statistic, such as `np.min`, of the densities of the fluid [rho0]."""
        return float(extreme(self.sim.rho[: self.sim.n_fluid])) / self.scene.fluid.rho0


# --- Rows -----------------------------------------------------------------------------------

Runs = Sequence[tuple[Variant, CaseOutcome]]


def rows(case: HardCase, found: Runs, quick: bool = False) -> Iterator[Row]:
    """Yield every check of a case, with the variant that is worst at it."""
    substeps = float(sum(one.substeps for _, one in found))
    yield Row("substeps", case.name, substeps, "")
    blowups = [(variant, one) for variant, one in found if one.blowups]
    names = ", ".join(f"{variant.name}: {one.cause}" for variant, one in blowups)
    label = f"{case.name} ({names})" if names else case.name
    yield Row("reported blow-ups", label, float(len(blowups)), "", 0.0 if case.stable else None)
    if not case.stable:
        odd = float(sum(one.cause not in case.causes for _, one in blowups))
        yield Row("blow-ups whose cause is not that of the case", label, odd, "", 0.0)
    for check in CHECKS:
        if not check.optional or check.name in case.bounds:
            yield from _check_rows(case, check, found, quick)


def _check_rows(case: HardCase, check: CaseCheck, found: Runs, quick: bool) -> Iterator[Row]:
    """Yield a row for every bound, since precisions and kernels may have their own."""
    by_bound: dict[float | None, list[Row]] = {}
    for variant, one in found:
        # a run that blew up may be anything by then; one that did not is held to all of it
        asked = check.after_blowup or case.stable or not one.blowups
        if asked and check.name in one.values:
            row = _row(case, check, variant, one.values[check.name], quick)
            limit = None if quick else known_limit(case.name, variant.name, check.name)
            if limit is None or row.holds:
                by_bound.setdefault(row.bound, []).append(row)
            else:
                yield as_limit(row, limit)
    for bound in sorted(by_bound, key=lambda bound: math.inf if bound is None else bound):
        values = np.array([row.value for row in by_bound[bound]])
        # unlike Python's extremes, those of numpy are nan wherever a value is
        yield by_bound[bound][int(values.argmin() if check.at_least else values.argmax())]


def _row(case: HardCase, check: CaseCheck, variant: Variant, value: float, quick: bool) -> Row:
    title, unit = (case.event if check.name == "happened" else check[1:])[:2]
    label = case.name if value == 0 else f"{case.name}, {variant.name}"
    bound = case.bound(check.name, variant, quick)
    return Row(title, label, value, unit, bound, check.at_least)


def summary(found: Mapping[str, tuple[HardCase, Runs]]) -> Iterator[Row]:
    """Yield what must hold over all cases."""
    runs = [(case, one) for case, several in found.values() for _, one in several]
    least = min(len(several) for _, several in found.values())
    yield Row("cases", "all", float(len(found)), "", 30.0, at_least=True)
    yield Row("variants of each, at least", "all", float(least), "", 3.0, at_least=True)
    stable = sum(one.blowups for case, one in runs if case.stable)
    yield Row("blow-ups at or below the stable step", "all", float(stable), "", 0.0)
    compared, n = float(sum("grid" in one.values for _, one in runs)), len(runs)
    title = "runs compared with brute force"
    yield Row(title, "all", compared, f"of {n}", float(n), at_least=True)
    for name in ("silent", "passed"):
        total = float(sum(one.values.get(name, 0.0) for _, one in runs))
        yield Row(BY_NAME[name].title, "all", total, "", 0.0)
