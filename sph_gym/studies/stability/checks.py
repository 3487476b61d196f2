"""Checks: what is measured in every run of a case, and the bound that it must keep.

`CHECKS` is the list from which runs, bounds and the rows of the table are derived: a further
check is one more entry.
"""

import math
import operator
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sph_gym.scenes import hydrostatic_tank
from sph_gym.scenes.shared import tanks
from sph_gym.solver.confinement import stroke_at
from sph_gym.solver.energy import Ledger
from sph_gym.solver.failure import CAUSES
from sph_gym.solver.integrators import TOP_SPEED
from sph_gym.solver.kernels import ALL_KERNELS, density_kernel
from sph_gym.solver.simulation import Report, Simulation
from sph_gym.studies.stability import comparisons

if TYPE_CHECKING:
    from sph_gym.studies.stability.runs import CaseRun

# Links of the chain that a blow-up may show in first.
LINKS = ("neighbours", "density", "pressure", "force", "integration", "walls")
# Particles above which brute force is asked about some of them only.
AFFORDABLE = 3000
# Frames over which one and two threads, and grid and brute force, are compared.
COMPARED = 3
# Differences from brute force, of the largest magnitude, in the two precisions; of observables.
SAME, ALIKE = {"float64": 1e-12, "float32": 5e-5}, 1e-8
# Shares of mass times largest speed that round-off may leave of the momentum in the two precisions.
ROUND_OFF = {"float64": 1e-14, "float32": 1e-6}
# Least share of a lonely particle's density, allowing for round-off in float32.
LONELY = 1 - 1e-5
# Bound of the compression in the most compressed hundredth, as the environments allow.
DENSE = 0.04

# When a check is measured: after every frame, after those of the second half, where the run is
# compared with others (at the start and after a quarter), at the end.
FRAME, LATE, COMPARISON, END = ("frame",), ("late",), ("comparison",), ("end",)
# A number, one for each precision, the name of the check that has the same, None: no bound.
Bound = float | Mapping[str, float] | str | None


class CaseCheck(NamedTuple):
    """A number that is measured in a run, and the bound that it must keep.

    name: keyword by which `hard_case` gives a case another bound; title, unit: of its row; when:
    the moments of measuring; measure: a run to the number, None if there is none; bound: unless
    the case has its own; fold: of two values that of both, nan if either is; at_least: whether
    the bound is a lower one; optional: whether only cases that give a bound have a row;
    after_blowup: whether runs that blew up must keep it too.
    """

    name: str
    title: str
    unit: str
    when: tuple[str, ...]
    measure: Callable[["CaseRun"], float | None]
    bound: Bound = None
    fold: Callable[[float, float], float] = np.maximum
    at_least: bool = False
    optional: bool = False
    after_blowup: bool = False


# --- Measures -------------------------------------------------------------------------------


def is_finite(sim: Simulation) -> bool:
    """Return whether every number of the state is finite."""
    return all(bool(np.isfinite(getattr(sim, field)).all()) for field in comparisons.FIELDS)


def is_silent(sim: Simulation, report: Report) -> bool:
    """Return whether something went wrong unreported, or a blow-up lacks cause, link or particle.

    The bounds are the solver's own. A run that keeps them is not excused by that: other checks
    hold its energy, its densities and its walls to the bounds of the case.
    """
    if not is_finite(sim):
        return True
    if report.diverged:
        explained = report.cause in CAUSES and report.link in LINKS
        return not (explained and 0 <= report.bad_particle < sim.n_fluid)
    numbers = sim.diagnostics()
    return numbers["max_speed"] > TOP_SPEED or not numbers["energy_excess"] <= Ledger.TOLERANCE


def momentum(sim: Simulation) -> Any:
    """Return the momentum (2,) [kg/s] of the fluid, summed in double precision."""
    return sim.mass * sim.v[: sim.n_fluid].astype(np.float64).sum(axis=0)


def lonely_density(sim: Simulation) -> float:
    """Return the density of a particle without neighbours [rho0], the least that there can be."""
    kernel = ALL_KERNELS[sim.scene.fluid.kernel](sim.scene.h)
    return sim.mass * float(density_kernel(kernel, np.zeros(1))[0]) / sim.scene.fluid.rho0


def n_passed(sim: Simulation, behind: Callable[[Any, float], Any] | None = None) -> int:
    """Return how many fluid particles are out of the box, or `behind` a wall.

    behind: positions (n, 2) [m] and dx to which of them are on its wrong side.
    """
    x, low, high, slack = _in_box(sim)
    wrong = ((x < low - slack) | (x > high + slack)).any(axis=1)
    return int((wrong if behind is None else wrong | behind(x, sim.scene.dx)).sum())


def n_held_by_box(sim: Simulation) -> int:
    """Return how many fluid particles lie on the box: no boundary particle stopped them."""
    x, low, high, slack = _in_box(sim)
    return int(((np.abs(x - low) <= slack) | (np.abs(x - high) <= slack)).any(axis=1).sum())


def _in_box(sim: Simulation) -> tuple[Any, Any, Any, float]:
    """Return positions (n, 2) [m], lower and upper sides of the present box, and a slack.

    Sides are infinite where there is no box.
    """
    x = sim.x[: sim.n_fluid].astype(np.float64)
    walls = sim.scene.walls
    # a wall that was rounded to the precision of the particles
    slack = 1e-9 + 4 * float(np.finfo(sim.x.dtype).eps) * float(np.abs(x).max())
    if walls is None or walls.box is None:
        return x, np.full(2, -math.inf), np.full(2, math.inf), slack
    box = np.array(walls.box)
    if walls.motion is not None:
        stroke = walls.motion.stroke()
        dx, dy, _, _ = stroke_at(stroke, sim.time)
        box += (stroke.left * dx, stroke.right * dx, stroke.bottom * dy, stroke.top * dy)
    return x, box[::2], box[1::2], slack


def _drift(run: "CaseRun") -> float:
    change = float(np.hypot(*(momentum(run.sim) - run.momentum)))
    speed = max(run.fastest, 1e-3 * run.scene.fluid.c0)
    return change / (run.sim.mass * run.sim.n_fluid * speed)


def _grid(run: "CaseRun") -> float:
    few = run.sim.n_particles <= AFFORDABLE
    return (comparisons.grid_gap if few else comparisons.sample_gap)(run.sim)


def _observables(run: "CaseRun") -> float | None:
    if run.dtype != "float64" or run.sim.n_particles > AFFORDABLE:
        return None
    return comparisons.run_gap(run.copy, run.advance, min(COMPARED, run.frames))


def _threads(run: "CaseRun") -> float:
    return comparisons.threads_differ(run.copy, run.advance, min(COMPARED, run.frames))


def _unrest(run: "CaseRun") -> float | None:
    if run.case.calm is None or run.sim.time < run.case.calm:
        return None
    depth = hydrostatic_tank.depth_of(run.scene)
    return run.numbers["kinetic_energy"] / (tanks.weight(run.sim) * depth)


def _clumped(run: "CaseRun") -> float | None:
    if run.twin is None:
        return None
    return run.values.get("clumping", 0.0) - run.twin.values.get("clumping", 0.0)


# --- The list -------------------------------------------------------------------------------

_always = partial(CaseCheck, after_blowup=True)
_smallest = partial(CaseCheck, fold=np.minimum, at_least=True)
_if_asked = partial(CaseCheck, optional=True)

# fmt: off
CHECKS = (
    _always("step", "longest step", "stable steps", FRAME,
            lambda run: run.report.dt / run.stable_dt, optional=True, at_least=True),
    _always("silent", "frames that failed in silence", "", FRAME,
            lambda run: is_silent(run.sim, run.report), 0.0, fold=operator.add),
    _always("passed", "particles behind a wall", "", FRAME,
            lambda run: n_passed(run.sim, run.case.behind), 0.0),
    _always("threads", "fields that differ on two threads", "", COMPARISON, _threads, 0.0),
    _always("held", "particles that only the box holds", "", FRAME,
            lambda run: n_held_by_box(run.sim) or None),
    _always("drift", "spurious momentum", "of the largest", END, _drift, optional=True),
    _always("grid", "grid against brute force, rho, p, a", "of the largest", COMPARISON + END,
            _grid, SAME),
    _always("observables", "runs on grid and brute force", "dx, energy", COMPARISON,
            _observables, ALIKE),
    _smallest("happened", "what must have happened", "", END, lambda run: run.happened()),
    CaseCheck("excess", "spurious energy", "of what is at stake", FRAME,
          lambda run: run.numbers["energy_excess"], 0.02),
    CaseCheck("rise", "rise of spurious energy", "of what is at stake", FRAME,
          lambda run: run.energy_rise, "excess"),
    CaseCheck("gain", "mean compression beyond the start's", "rho0", FRAME,
          lambda run: run.numbers["density_error"] - run.began["density_error"], "density"),
    _if_asked("burst", "mean compression after the first frame", "rho0", FRAME,
              lambda run: run.numbers["density_error"] if run.report.n_substeps else None),
    CaseCheck("density", "mean compression, second half", "rho0", LATE,
          lambda run: run.numbers["density_error"], 0.02),
    CaseCheck("p99", "99th percentile of compression, second half", "rho0", LATE,
          lambda run: run.numbers["density_error_p99"], DENSE),
    _if_asked("clumping", "closer than 0.6 dx, second half", "of the particles", LATE,
              lambda run: run.numbers["clumping"]),
    _if_asked("peak", "largest density, second half", "rho0", LATE,
              lambda run: run.density(np.max)),
    _smallest("lowest", "least density", "a lonely particle's", FRAME,
              lambda run: run.density(np.min) / lonely_density(run.sim), LONELY),
    _if_asked("highest", "largest density", "a lonely particle's", FRAME,
              lambda run: run.density(np.max) / lonely_density(run.sim)),
    _smallest("left", "least density of fluid that stays together", "the start's least", FRAME,
              lambda run: run.density(np.min) / run.least_density, optional=True),
    _smallest("typical", "least median density", "rho0", FRAME,
              lambda run: run.density(np.median), optional=True),
    _if_asked("kinetic", "kinetic energy once at rest", "m g H", FRAME, _unrest),
    _if_asked("unlike", "end unlike that of its twin", "dx, energy", END,
              lambda run: comparisons.displaced_gap(run.sim, run.twin.sim) if run.twin else None),
    _if_asked("clumped", "more than its twin closer than 0.6 dx", "of the particles", END,
              _clumped),
)
# fmt: on
BY_NAME = {check.name: check for check in CHECKS}


def fold(one: Mapping[str, float], other: Mapping[str, float]) -> dict[str, float]:
    """Return the values of both: sums of what is counted, the worse of what is measured."""
    both = dict(one)
    for name, value in other.items():
        both[name] = float(BY_NAME[name].fold(both[name], value) if name in both else value)
    return both


def measure(run: "CaseRun", moment: tuple[str, ...]) -> dict[str, float]:
    """Return the values of the checks that are measured at a moment."""
    found = {check.name: check.measure(run) for check in CHECKS if moment[0] in check.when}
    return {name: float(value) for name, value in found.items() if value is not None}
