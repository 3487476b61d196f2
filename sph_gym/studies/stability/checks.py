"""What is looked at after every frame, and comparisons of runs that must agree."""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from sph_gym.solver import engine, teams
from sph_gym.solver.diagnostics import Ledger
from sph_gym.solver.kernels import ALL_KERNELS, density_kernel
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Report, Simulation
from sph_gym.solver.walls import Walls

FIELDS = ("x", "v", "rho", "p", "a")
CAUSES = ("cfl", "stiffness", "clumping", "tunnelling", "energy", "nan")
LINKS = ("neighbours", "density", "pressure", "force", "integration", "walls")
# Faster [m/s] is a blow-up by the solver's own contract.
TOP_SPEED = 5000.0


def is_finite(sim: Simulation) -> bool:
    """Whether every number of the state is."""
    return all(bool(np.isfinite(getattr(sim, field)).all()) for field in FIELDS)


def is_silent(sim: Simulation, report: Report) -> bool:
    """Whether something went wrong without a word, or a blow-up without its story.

    By the contract's own numbers. A run that stays within them isn't excused by that: `report`
    holds its energy, its densities and its walls to the bounds of the case.
    """
    if not is_finite(sim):
        return True
    if report.diverged:
        told = report.cause in CAUSES and report.link in LINKS
        return not (told and 0 <= report.bad_particle < sim.n_fluid)
    numbers = sim.diagnostics()
    return numbers["max_speed"] > TOP_SPEED or not numbers["energy_excess"] <= Ledger.TOLERANCE


def greatest(values: Sequence[float]) -> float:
    """The largest, or nan if any is: Python's max passes over a nan that isn't the first."""
    return float(np.max(np.asarray(values, np.float64)))


def least_possible(sim: Simulation) -> float:
    """What a particle's own mass makes of rho0: nobody's density can be less."""
    kernel = ALL_KERNELS[sim.scene.fluid.kernel](sim.scene.h)
    return sim.mass * float(density_kernel(kernel, np.zeros(1))[0]) / sim.scene.fluid.rho0


def momentum(sim: Simulation) -> Any:
    """(2,) [kg/s], summed in double precision."""
    return sim.mass * sim.v[: sim.n_fluid].astype(np.float64).sum(axis=0)


# --- Runs that must agree -------------------------------------------------------------------


@contextmanager
def eager_threads() -> Iterator[None]:
    """Even the smallest fluid and the shortest call are shared by all threads.

    The solver shares only what is worth it; that it is right does not depend on it.
    """
    limits = engine.PARTICLES_PER_THREAD, engine.WORTH_WAKING
    choose: Any = teams.Pace.choose
    engine.PARTICLES_PER_THREAD, engine.WORTH_WAKING = 1, 1
    teams.Pace.choose = lambda self, most: most  # type: ignore[method-assign]
    try:
        yield
    finally:
        engine.PARTICLES_PER_THREAD, engine.WORTH_WAKING = limits
        teams.Pace.choose = choose  # type: ignore[method-assign]


Advance = Callable[[Simulation], Report]
# Makes one of the runs, with so many `threads` or by `neighbors`.
Twin = Callable[..., Simulation]


def threads_differ(twin: Twin, advance: Advance, frames: int) -> int:
    """In how many fields, reports included, runs on one and two threads differ by any bit."""
    with eager_threads():
        single, double = (twin(threads=n) for n in (1, 2))
        reports = [[advance(sim) for _ in range(frames)] for sim in (single, double)]
    wrong = sum(
        getattr(single, field).tobytes() != getattr(double, field).tobytes() for field in FIELDS
    )
    return wrong + (reports[0] != reports[1])


def grid_gap(sim: Simulation) -> float:
    """Largest difference of rho, p and a between grid and brute force on the present state.

    In multiples of the largest magnitude of each field, and of pressure and acceleration at least
    of those of a flow at Mach 0.1: at rest, both are small differences of densities.
    """
    brute = Simulation(sim.scene, sim.dtype, "brute", threads=1)
    brute.restore(sim.snapshot())
    for each in (sim, brute):
        each.evaluate()
    gaps = []
    for field, floor in _least(sim).items():
        one, other = (getattr(each, field).astype(np.float64) for each in (sim, brute))
        largest = max(float(np.abs(other).max()), floor)
        gaps.append(float(np.abs(one - other).max()) / largest)
    return greatest(gaps)


# Of the particles of a flow that is too large for brute force, how many are compared.
SAMPLE = 20


def sample_gap(sim: Simulation) -> float:
    """`grid_gap` of particles at random, each against brute force on all within 2 h of it.

    Its neighbours' densities, which its acceleration depends on, need no more.
    """
    sim.evaluate()
    # as the engine counts them: far from its origin, float32 would have no digits for the rest
    x, v = (np.asarray(a, np.float64) for a in (sim._places, sim.v))
    rng = np.random.default_rng(0)
    chosen = rng.choice(sim.n_fluid, min(SAMPLE, sim.n_fluid), replace=False)
    return greatest([_patch_gap(sim, x, v, int(i)) for i in chosen])


def _patch_gap(sim: Simulation, x: Any, v: Any, i: int) -> float:
    scene, n = sim._local, sim.n_fluid
    near = np.hypot(*(x - x[i]).T) < 2.001 * scene.h
    fluid, wall = near[:n], x[n:][near[n:]]
    walls = Walls(wall) if len(wall) else None
    patch = dataclasses.replace(scene, x=x[:n][fluid], v=v[:n][fluid], walls=walls)
    brute = Simulation(patch, sim.dtype, "brute", threads=1)
    brute.controls = sim.controls
    brute.evaluate()
    here = int(fluid[:i].sum())
    gaps = []
    for field, floor in _least(sim).items():
        other = np.asarray(getattr(brute, field), np.float64)
        gap = np.abs(np.asarray(getattr(sim, field)[i], np.float64) - other[here])
        gaps.append(float(gap.max()) / max(float(np.abs(other).max()), floor))
    return greatest(gaps)


def _least(sim: Simulation) -> dict[str, float]:
    """What the largest rho [kg/m^3], p [Pa] and a [m/s^2] count as, at least."""
    dynamic = (0.1 * sim.sound_speed) ** 2
    return {"rho": 0.0, "p": sim.scene.fluid.rho0 * dynamic, "a": dynamic / sim.scene.h}


def run_gap(twin: Twin, advance: Advance, frames: int) -> float:
    """How far apart runs on grid and brute force are after some frames, by their observables.

    Centre of mass and extents in dx, kinetic energy as a share of the larger one and of that of
    Mach 0.01; the largest counts.
    """
    ends = []
    for neighbors in ("grid", "brute"):
        sim = twin(neighbors=neighbors)
        for _ in range(frames):
            if advance(sim).diverged:
                break
        ends.append(sim.diagnostics())
    return _observable_gap(sim.scene, ends)


def moved_gap(scene: Scene, sim: Simulation, other_scene: Scene, other: Simulation) -> float:
    """The same of two simulations, each seen from the middle of where it began."""
    ends = []
    for began, each in ((scene, sim), (other_scene, other)):
        numbers, middle = each.diagnostics(), np.asarray(began.x).mean(axis=0)
        shift = {"com_x": numbers["com_x"] - middle[0], "com_y": numbers["com_y"] - middle[1]}
        ends.append(numbers | shift)
    return _observable_gap(scene, ends)


def _observable_gap(scene: Scene, ends: Sequence[dict[str, float]]) -> float:
    one, other = ends
    lengths = [abs(one[name] - other[name]) / scene.dx for name in LENGTHS]
    least = 0.5 * 1e-4 * scene.fluid.c0**2 * scene.fluid.rho0 * scene.dx**2
    energies = [each["kinetic_energy"] for each in ends]
    gap = abs(energies[0] - energies[1]) / max(*energies, least)
    return greatest([gap, *lengths])


LENGTHS = ("com_x", "com_y", "extent_x", "extent_y")
